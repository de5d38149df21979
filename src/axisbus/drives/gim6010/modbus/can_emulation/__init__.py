"""Modules on a serial line as modules on a bus: orders become registers that are written, and what is read is told."""
