"""Decode frames to text: pure, frame by frame, using the cell's files and the traffic of the bus itself."""
