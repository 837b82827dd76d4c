"""An independent world in which recordings with concealed causes are made, sealed and scored.

Nothing here may use the equations of the product: a test forbids imports of its instruments,
simulation, diagnosis, estimation and turbulence packages.
"""
