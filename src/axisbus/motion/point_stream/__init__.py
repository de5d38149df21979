"""Streams of points: the curve through them, and the axes that follow it while it grows."""
