"""``axisbus od``: one module for each subcommand."""
