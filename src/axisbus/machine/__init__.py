"""The machine: the public API of axes, groups, commands, inputs and outputs, and node access."""
