"""The present values of the axes as texts, each with its age; unknown values are shown as unknown."""

from __future__ import annotations

from axisbus.cia402 import statusword
from axisbus.cia402.modes import ModeOfOperation, short
from axisbus.errors import AxisbusError, StaleError, seen_of
from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.motion.parameters import AxisParameters
from axisbus.web.view.bars import UNKNOWN, marks, number, places
from axisbus.web.view.error_text import in_page_terms

Values = dict[str, object]
_OLD = 1.0  # seconds; an older process image does not count as present


def all_axes(machine: Machine, now: float) -> dict[str, Values]:
    """Return the values of every axis by name; does not block. ``now`` in seconds of the monotonic clock."""
    facts = machine.session.axes
    return {axis.name: one_axis(axis, facts[axis.name].parameters, now) for axis in machine}


def one_axis(axis: Axis, parameters: AxisParameters, now: float) -> Values:
    """Return the values of an axis; ``known`` says whether its states are up to date."""
    snapshot, error = axis.snapshot, axis.error
    image_age = max(0.0, now - snapshot.now)
    known = _state(axis) is not None and image_age < _OLD
    mode = None if snapshot.mode is None else ModeOfOperation(snapshot.mode)
    word = snapshot.statusword if known else None
    decimals = places(abs(parameters.units.position.to_units(1)))
    return {
        "known": known,
        "state": snapshot.state.value if known else UNKNOWN,
        "power": snapshot.power_state.value if known else UNKNOWN,
        "mode": f"mode {short(mode) if known and mode is not None else UNKNOWN}",
        "bits": "" if word is None else ", ".join(statusword.bit_words(word, mode)),
        "homed": ("homed" if snapshot.homed else "not homed") if known else UNKNOWN,
        "position": _number(axis, "position", known, decimals),
        "velocity": _number(axis, "velocity", known, decimals),
        "torque": _number(axis, "torque", known, 3),
        "target": "" if axis.target is None or not known else number(axis.target, decimals),
        "position_age": _age(now - snapshot.position_stamp) if snapshot.position is not None else "",
        "image_age": _age(image_age),
        "bars": marks(parameters, snapshot, lambda name: _value(axis, name, known)),
        "error": None if error is None else explained(error),
    }


def explained(error: AxisbusError) -> dict[str, str]:
    """Return the three texts of an error, and the page of its symptom."""
    texts = {"message": error.message, "observed": seen_of(error), "remedy": error.remedy}
    return {**{name: in_page_terms(text) for name, text in texts.items()}, "page": error.page}


def _state(axis: Axis) -> object | None:
    try:
        return axis.state
    except StaleError:
        return None


def _number(axis: Axis, name: str, known: bool, decimals: int) -> str:
    value = _value(axis, name, known)
    return UNKNOWN if value is None else number(value, decimals)


def _value(axis: Axis, name: str, known: bool) -> float | None:
    """Return a value of the axis by its name, None if it is unknown."""
    try:
        return float(getattr(axis, name)) if known else None
    except StaleError:
        return None


def _age(seconds: float) -> str:
    seconds = max(0.0, seconds)
    return f"{seconds * 1000:.0f} ms" if seconds < 1.0 else f"{seconds:.1f} s"
