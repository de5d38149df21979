"""The table of the commands of a fleet: the verbs, their values, and whether they need a lease."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from axisbus.errors import ArgumentError
from axisbus.fleet.messages import CommandAsk, Value
from axisbus.motion.numbers import short_repr


@dataclass(frozen=True, slots=True)
class ZenohVerb:
    """The requirements of a verb: ``lease``; exactly one axis (``single``); values by name, each with its type.

    ``call`` is the library's method if its name differs from the verb.
    """

    lease: bool = True
    single: bool = False
    needs: Mapping[str, type] = field(default_factory=dict)
    optional: Mapping[str, type] = field(default_factory=dict)
    call: str = ""


@dataclass(frozen=True, slots=True)
class BridgeAction:
    """A command to execute: the library's ``call`` for each of the ``axes``, with these values."""

    verb: str
    call: str
    axes: tuple[str, ...]
    values: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        values = ", ".join(f"{name}={value}" for name, value in self.values.items())
        return f"{' and '.join(self.axes)}: {self.verb}({values})"


_RAMPS = {"velocity": float, "acceleration": float, "deceleration": float}
_PROFILE = {**_RAMPS, "jerk": float, "timeout": float}
_TURNS = {name: kind for name, kind in _PROFILE.items() if name != "velocity"}
JOG = "jog"
VERBS: Mapping[str, ZenohVerb] = {
    "halt": ZenohVerb(lease=False),
    "quick_stop": ZenohVerb(lease=False),
    "halt_all": ZenohVerb(lease=False, call="halt"),
    "quick_stop_all": ZenohVerb(lease=False, call="quick_stop"),
    "enable": ZenohVerb(optional={"allow_moving": bool}),
    "disable": ZenohVerb(optional={"coast": bool}),
    "reset": ZenohVerb(),
    "stop": ZenohVerb(),
    "release": ZenohVerb(),
    "home": ZenohVerb(optional={"method": int, "timeout": float}),
    "move_absolute": ZenohVerb(
        single=True, needs={"position": float}, optional={**_PROFILE, "direction": int}
    ),
    "move_relative": ZenohVerb(single=True, needs={"distance": float}, optional=_PROFILE),
    "move_additive": ZenohVerb(single=True, needs={"distance": float}, optional=_PROFILE),
    "move_velocity": ZenohVerb(single=True, needs={"velocity": float}, optional=_TURNS),
    "torque_control": ZenohVerb(
        single=True, needs={"torque": float}, optional={"slope": float, "timeout": float}
    ),
    "set_position": ZenohVerb(single=True, needs={"position": float}),
    "set_override": ZenohVerb(needs={"factor": float}),
    JOG: ZenohVerb(
        single=True, needs={"velocity": float, "press": int, "sent": float}, optional={"acceleration": float}
    ),
}
STOPS = frozenset(name for name, verb in VERBS.items() if not verb.lease)
ALL = "_all"  # the suffix of a stop of all axes
_TYPE_TEXTS = {float: "a number", int: "a whole number", bool: "true or false"}


def action_of(verb: str, request: CommandAsk, axes: Collection[str]) -> BridgeAction:
    """Return the command to execute; ``axes`` are those of the cell, and a command without axes is for all of them.

    Raises:
        ArgumentError: the verb or an axis is unknown, or a value is missing, unknown or of another type.
    """
    row = VERBS.get(verb)
    if row is None:
        raise ArgumentError(f"there is no command {verb!r}", remedy=f"there are {', '.join(VERBS)}")
    named = tuple(axes) if verb.endswith(ALL) else request.axes or tuple(axes)
    if verb in STOPS:  # if one of its axes is invalid, the others are stopped; values are ignored
        return BridgeAction(verb, row.call or verb, tuple(dict.fromkeys(named)))
    for name in named:
        if name not in axes:
            raise ArgumentError(
                f"the cell has no axis {name!r}", observed=f"it has {', '.join(axes) or 'none'}"
            )
    if len(set(named)) < len(named):
        raise ArgumentError(f"{verb}: an axis is named twice")
    if row.single and len(request.axes) != 1:
        raise ArgumentError(f"{verb}: no axis is given", remedy="name the one axis to move")
    return BridgeAction(verb, row.call or verb, named, _values(verb, row, request.values))


def _values(verb: str, row: ZenohVerb, given: Mapping[str, Value]) -> dict[str, Any]:
    known = {**row.needs, **row.optional}
    for name in given:
        if name not in known:
            raise ArgumentError(
                f"{verb}: there is no value {name!r}", remedy=f"it takes {', '.join(known) or 'none'}"
            )
    for name in row.needs:
        if given.get(name) is None:
            raise ArgumentError(f"{verb}: no {name} given", remedy=f"give it as {_TYPE_TEXTS[known[name]]}")
    return {
        name: _typed(verb, name, value, known[name]) for name, value in given.items() if value is not None
    }


def _typed(verb: str, name: str, value: Value, kind: type) -> Any:
    matches = type(value) is kind or (kind is float and type(value) is int)
    with suppress(OverflowError):  # an integer too large for a float
        if matches:
            return kind(value)
    raise ArgumentError(
        f"{verb}: {short_repr(value)} is not a valid {name}", remedy=f"give it as {_TYPE_TEXTS[kind]}"
    )
