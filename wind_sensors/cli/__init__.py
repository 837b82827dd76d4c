"""The command `wind`; nobody imports this."""
