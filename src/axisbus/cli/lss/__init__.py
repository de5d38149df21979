"""`axisbus lss`: one file for each subcommand."""
