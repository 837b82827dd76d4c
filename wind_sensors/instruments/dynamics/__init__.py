"""Compiled equations of motion of rotors and vanes."""
