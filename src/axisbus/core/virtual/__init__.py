"""Axes without a drive, which the core leads alone."""
