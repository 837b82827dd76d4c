"""Recordings of means: the instruments of a mast against each other."""
