"""Equations of one instrument each."""
