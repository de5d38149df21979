"""`axisbus config`: one file for each subcommand."""
