"""The checks of a cell before the first frame is sent; one module for each subject."""
