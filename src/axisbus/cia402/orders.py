"""Objects whose writing is an order and no setting: it acts at once, and nothing of it can be configured, backed up or restored."""

from __future__ import annotations

from axisbus.cia301 import objects as c301
from axisbus.cia402 import objects as o

# First-axis objects that make a drive move, let it move, or let its load go: the controlword, modes, targets and offsets of every
# mode, and the digital outputs, which release brakes (CiA 402-2).
MOVING = frozenset(
    {
        *(o.CONTROLWORD, o.MODES_OF_OPERATION, o.TARGET_TORQUE, o.TARGET_POSITION, o.TARGET_VELOCITY),
        *(o.POSITION_OFFSET, o.VELOCITY_OFFSET, o.TORQUE_OFFSET, 0x6042, 0x60C1, 0x60FE),
    }
)

_COMMANDED = "it commands the drive: it could energise or move it, or let its load go"

# Communication objects -> what writing them does (CiA 301 7.5.2, CiA 302-2, -3).
_COMMUNICATION: tuple[tuple[range, str], ...] = (
    (range(c301.PREDEFINED_ERROR_FIELD, c301.PREDEFINED_ERROR_FIELD + 1), "it clears the error history"),
    (range(c301.STORE_PARAMETERS, c301.STORE_PARAMETERS + 1), "it stores parameters"),
    (range(c301.RESTORE_DEFAULTS, c301.RESTORE_DEFAULTS + 1), "it restores the factory's parameters"),
    (range(0x1013, 0x1014), "it sets the clock"),
    (range(0x1023, 0x1027), "it is a command to the device's operating system"),
    (range(0x1F50, 0x1F60), "it loads, starts or stops the device's program"),
    (range(0x1F82, 0x1F84), "it commands other nodes"),
)


def order(index: int) -> str:
    """Return what writing an object of any axis does at once, in words; empty where it is a setting."""
    if first_axis(index) in MOVING:
        return _COMMANDED
    return next((what for indices, what in _COMMUNICATION if index in indices), "")


def first_axis(index: int) -> int:
    """Return the index of the same object on the first axis (objects of CiA 402 repeat every 800h)."""
    return 0x6000 + (index - 0x6000) % o.AXIS_OFFSET if 0x6000 <= index < 0xA000 else index
