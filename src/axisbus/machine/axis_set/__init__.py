"""Axes that receive one command together."""
