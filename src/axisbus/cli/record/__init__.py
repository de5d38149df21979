"""``axisbus record`` and ``axisbus plot``: make, plot, compare and export recordings; one module for each subcommand."""
