"""Slave axes that follow a master axis: gears and cams (PLCopen part 1, synchronised motion)."""
