"""`axisbus eds`: one file for each subcommand."""
