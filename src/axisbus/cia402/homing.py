"""Homing methods (CiA 402-2 11.3, object 6098h) with the switch or pulse that each one searches for."""

from __future__ import annotations

NONE = 0  # no method is selected
METHODS: dict[int, str] = {
    NONE: "no homing",
    1: "negative limit switch, then index pulse",
    2: "positive limit switch, then index pulse",
    3: "positive home switch, index pulse on its negative side",
    4: "positive home switch, index pulse on its positive side",
    5: "negative home switch, index pulse on its positive side",
    6: "negative home switch, index pulse on its negative side",
    **dict.fromkeys(range(7, 11), "home switch and index pulse, starting in positive direction"),
    **dict.fromkeys(range(11, 15), "home switch and index pulse, starting in negative direction"),
    17: "negative limit switch",
    18: "positive limit switch",
    19: "positive home switch, negative side",
    20: "positive home switch, positive side",
    21: "negative home switch, positive side",
    22: "negative home switch, negative side",
    **dict.fromkeys(range(23, 27), "home switch edge, starting in positive direction"),
    **dict.fromkeys(range(27, 31), "home switch edge, starting in negative direction"),
    33: "next index pulse in negative direction",
    34: "next index pulse in positive direction",
    35: "the actual position is home (older numbering)",
    37: "the actual position is home",
}

# Methods that define home at the present position, without motion.
IN_PLACE = frozenset({35, 37})


def needs_speeds(method: int) -> bool:
    """Whether a method is known to move and so needs the speeds of 6099h; manufacturer-specific (negative) methods are unknown."""
    return method > 0 and method not in IN_PLACE


def describe(method: int) -> str:
    """Return the description of a method; negative numbers are manufacturer-specific."""
    if method < 0:
        return "manufacturer-specific"
    return METHODS.get(method, "reserved")
