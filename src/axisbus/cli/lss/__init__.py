"""``axisbus lss``: one module for each subcommand."""
