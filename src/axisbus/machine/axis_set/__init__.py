"""Axes that take one command for all."""
