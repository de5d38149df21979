"""The limits of an axis as bars: from where to where, where the present value lies, and whether it is near them or beyond."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from axisbus.cia402.state import PowerState
from axisbus.motion.modes import FOLLOWED
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot

NEAR = 0.8  # of the way from the middle to a limit
UNKNOWN = "unknown"
_NEAR, _BEYOND = "near its limit", "beyond its limit"
_NOT_HOMED, _NOT_LED = "holds once it is homed", "holds while positions lead it"

Span = tuple[float, float]


_DECIMALS = range(3, 7)


def places(increment: float) -> int:
    """Return with how many decimals values are told of which ``increment`` is the least: 3, or more where those tell too little."""
    needed = math.ceil(-math.log10(increment)) if increment > 0 else 0
    return min(max(needed, _DECIMALS[0]), _DECIMALS[-1])


def number(value: float, decimals: int) -> str:
    """Return a value as a text, with so many decimals; what rounds to 0 has no sign."""
    return f"{value:z.{decimals}f}"


class Bar(NamedTuple):
    """What one bar is of: the name of the axis's value, and its limits in ``unit``; None where none is known.

    ``slack``: what is so little beyond a limit stands at it. ``decimals``: of its value.
    """

    name: str
    title: str
    unit: str
    span: Span | None
    slack: float = 0.0
    decimals: int = _DECIMALS[0]


class BarValue(NamedTuple):
    """What a bar shows: its value as a text and, in parts of its length, where that lies and where 0 does (None: not known).

    ``told``: what is to be known of it, in words; ``kind`` of that for its looks.
    """

    text: str
    now: float | None = None
    at: float | None = None
    zero: float | None = None
    kind: str = ""
    told: str = ""


def bars_of(parameters: AxisParameters) -> list[Bar]:
    """Return the bars of an axis; nothing is made up where neither cell file nor drive gives a limit."""
    units, limits = parameters.units, parameters.limits
    unit, increment = units.position.unit, abs(units.position.to_units(1))
    torque = "of rated torque" if units.rated_torque is None else "N·m"
    slack, decimals = parameters.place_window * increment, places(increment)
    lag = _both(_lag(parameters, increment))
    return [
        Bar("position", "Position", unit, limits.position, slack, decimals),
        Bar("velocity", "Velocity", f"{unit}/s", _both(limits.velocity), decimals=decimals),
        Bar("torque", "Torque", torque, _both(limits.torque)),
        Bar("following_error", "Following error", unit, lag, decimals=decimals),
    ]


def mark(bar: Bar, value: float | None, loose: str = "") -> BarValue:
    """Return what a bar shows of a value, None if unknown; ``loose``: why its limits do not hold at present, empty if they do."""
    if value is None or bar.span is None:
        return BarValue(UNKNOWN if value is None else number(value, bar.decimals))
    low, high = bar.span
    at, zero = (min(1.0, max(0.0, (each - low) / (high - low))) for each in (value, 0.0))
    kind, told = ("loose", loose) if loose else _judged(bar.span, bar.slack, value)
    return BarValue(number(value, bar.decimals), min(high, max(low, value)), at, zero, kind, told)


def marks(
    parameters: AxisParameters, snapshot: Snapshot, read: Callable[[str], float | None]
) -> dict[str, dict[str, object]]:
    """Return what each bar of an axis shows, by its name; ``read`` returns a value by name, None if it is unknown."""
    why = _loose(parameters, snapshot)
    return {
        bar.name: mark(bar, read(bar.name), why.get(bar.name, ""))._asdict()
        for bar in bars_of(parameters)
        if bar.span is not None
    }


def _loose(parameters: AxisParameters, snapshot: Snapshot) -> dict[str, str]:
    """Return which limits nobody keeps at present, and why."""
    found = {}
    if parameters.homing.required and not snapshot.homed:
        found["position"] = _NOT_HOMED
    if snapshot.power_state is not PowerState.OPERATION_ENABLED or snapshot.mode not in FOLLOWED:
        found["following_error"] = _NOT_LED
    return found


def _judged(span: Span, slack: float, value: float) -> tuple[str, str]:
    middle, half = (span[0] + span[1]) / 2, (span[1] - span[0]) / 2
    off = abs(value - middle)
    if off > half + slack:
        return "beyond", _BEYOND
    return ("near", _NEAR) if off > NEAR * half else ("", "")


def _both(limit: float | None) -> Span | None:
    return None if not limit else (-limit, limit)


def _lag(parameters: AxisParameters, increment: float) -> float | None:
    """Return how far the axis may lag, in units: by the cell file, else by the drive's own 6065h; no finer than increments tell."""
    own = parameters.following_error
    own = parameters.drive_following_error if own is None else own
    if own is None:
        return None
    return round(own * increment, math.floor(-math.log10(increment))) or own * increment
