"""The named inputs and outputs of a core's nodes, in its cycle and outside of it."""
