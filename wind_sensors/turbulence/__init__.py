"""Spectra, structure functions, the surface layer, and synthetic turbulence."""
