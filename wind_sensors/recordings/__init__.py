"""Bags, tables and logs: the only room that opens files."""
