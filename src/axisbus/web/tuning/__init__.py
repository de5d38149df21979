"""Tuning on the page: a monitored step there and back, its measurement, and its results."""
