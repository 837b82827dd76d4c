"""The `wind` command: one module for each subcommand."""
