"""Makes modules on a serial line look like modules on a CAN bus: commands become register writes, register values become frames."""
