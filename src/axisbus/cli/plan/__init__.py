"""``axisbus plan``: the timetable of a cell's cycle, as a table and as a plot."""
