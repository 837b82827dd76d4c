"""Frames, platform velocity, lever arm."""
