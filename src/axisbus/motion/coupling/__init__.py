"""Axes that are led by another one: gears and cams (PLCopen part 1, synchronised motion)."""
