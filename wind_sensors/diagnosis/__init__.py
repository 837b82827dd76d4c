"""Recorded minus simulated: the physics that was left out."""
