"""Shared code of the scenarios: a line of simulated drives, programs of their own, removable safety nets, and golden messages."""
