"""Faults of stand-ins that are planned: when each begins and ends, and what it turns."""
