"""Stop an axis, monitor its motion, and detect its standstill."""
