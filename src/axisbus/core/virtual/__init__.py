"""Axes without a drive: virtual axes, which only the core moves, and encoders."""
