"""Wind from cups, propellers, vanes and bivanes: models, estimation, simulation, diagnosis."""

__version__ = "0.1.0"
