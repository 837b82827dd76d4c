"""Sealing, running and opening: three steps that two people can play."""
