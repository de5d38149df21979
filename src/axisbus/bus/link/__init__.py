"""The adapter and what stands directly on it: frames in and out, bus-off, listening, recordings of candump."""
