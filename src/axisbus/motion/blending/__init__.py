"""Motions that pass into the next one without a stop: of one axis, and of a group."""
