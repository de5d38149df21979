"""Streams of points as their user sees them."""
