"""Distances that are laid over what leads an axis."""
