"""Recordings of axes over time, as files and plots."""
