"""``axisbus jitter``: how evenly a cell's cycle is kept, as a table, histograms and a picture."""
