"""Everything that can be found wrong with a cell before the first frame; one module for each matter."""
