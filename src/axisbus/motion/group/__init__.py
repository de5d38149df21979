"""Axes that act together: groups, gates, the ways that they go, and their travel along them."""
