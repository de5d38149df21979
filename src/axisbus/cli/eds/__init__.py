"""``axisbus eds``: one module for each subcommand."""
