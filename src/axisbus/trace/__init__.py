"""Frames decoded to words: pure, frame by frame, by what the cell's files say and by what the bus itself shows."""
