"""``axisbus record`` and ``axisbus plot``: recordings made, drawn, compared and exported; one file for each subcommand."""
