"""Axes that act together: groups, gates, lines, and the clock of a path."""
