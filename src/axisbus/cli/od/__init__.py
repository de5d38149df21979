"""`axisbus od`: one file for each subcommand."""
