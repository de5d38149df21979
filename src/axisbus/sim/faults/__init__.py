"""Planned faults of simulated nodes: when each begins and ends, and which settings it changes."""
