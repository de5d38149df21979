"""``axisbus jitter``: the regularity of a cell's cycle, as a table, histograms and a plot."""
