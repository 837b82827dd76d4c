"""Signals to wind."""
