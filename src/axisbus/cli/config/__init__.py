"""``axisbus config``: one module for each subcommand."""
