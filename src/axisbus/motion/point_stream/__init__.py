"""Streams of set-points: the curve through them, and the axes that go along it while it grows."""
