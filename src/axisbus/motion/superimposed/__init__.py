"""Distances superimposed on the motion of an axis."""
