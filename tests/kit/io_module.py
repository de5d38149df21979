"""The inputs and outputs of most cells with an I/O module: a sensor and a lamp."""

# To be formatted with ``node``: more keys of its table.
MODULE = """
[nodes.5]
eds = "builtin:generic-cia401"
{node}
[io.part]
node = 5
object = "6000h:01"
bit = 2
[io.lamp]
node = 5
object = "6200h:01"
bit = 3
safe = 0
"""

# A measured value of it, in a unit.
LEVEL = """
[io.level]
node = 5
object = "6401h:02"
scale = 100
offset = -1.0
unit = "m"
"""
