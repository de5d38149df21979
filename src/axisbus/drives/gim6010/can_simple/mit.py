"""MIT control: position, velocity, gains and torque in one frame, and the module's answer (manual v2.2, 4.1.2).

Theory of operation
-------------------
Each value is transmitted as a number of steps over a range of the firmware. The ranges are fixed up to 0.5.14; from 0.6.0 on they
are five parameters (``mit_max_*``), which change the meaning of the same bytes. Therefore ranges are an argument: a frame packed
with other ranges than the module's is wrong by their ratio. The firmware wraps values beyond the range: a position just above the
range becomes a position at its other end. Therefore every value is limited to its range before, and the result lists the changes.

Eight bytes of 0, the contents of a forgotten buffer, mean full negative torque. They are never made. They could only arise with
both gains at 0, when position and velocity have no effect (torque = kp · position error + kd · velocity error + torque); in this
case the velocity is sent one step higher. No bytes mean exactly 0 either: the neutral frame contains half a step of torque
(0.012 N·m of 50).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

from axisbus.drives.gim6010.can_simple.codec import (
    DecodedMessage,
    Outgoing,
    Reason,
    Unexpected,
    decode,
    pack_places,
)
from axisbus.drives.gim6010.can_simple.fields import MessageField
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.errors import ArgumentError

MIT_CONTROL = named("Mit_Control")


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True, slots=True)
class MitRanges:
    """Ranges of the transmitted values: ± rad, ± rad/s and ± N·m at the output; gains from 0, in the firmware's units.

    The defaults are the manual's. From firmware 0.6.0 on they are parameters of the module (``mit_max_*``): read them and pass them
    here.

    Raises:
        ArgumentError: a range is not between 1e-6 and 1e6.
    """

    position: float = 12.5
    velocity: float = 65.0
    kp: float = 500.0
    kd: float = 5.0
    torque: float = 50.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not _finite(value) or not 1e-6 <= value <= 1e6:
                raise ArgumentError(f"{value!r} is not a range of MIT control's {each.name}")


MANUAL = MitRanges()


@dataclass(frozen=True, slots=True)
class MitCommand:
    """Command of an axis: position (rad) and velocity (rad/s) of the output, torque (N·m) at the output, and the two gains.

    ``kp`` and ``kd`` are in the firmware's units (0 to 500 and 0 to 5 by the manual); ``MitSettings`` converts them.

    Raises:
        ArgumentError: a value is not a finite number.
    """

    position: float
    velocity: float
    kp: float
    kd: float
    torque: float

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not _finite(value):
                raise ArgumentError(f"{each.name} of MIT control: {value!r} is not a finite number")


@dataclass(frozen=True, slots=True)
class Changed:
    """One value that was changed before sending: ``sent`` instead of ``asked``, in the value's unit."""

    name: str
    asked: float
    sent: float

    def __str__(self) -> str:
        return f"{self.name} {self.sent:.6g} instead of {self.asked:.6g}"


@dataclass(frozen=True, slots=True)
class Packed:
    """A frame and the changes to its command: values limited to their range, and the step that keeps it from being all zeros."""

    frame: Outgoing
    clipped: tuple[Changed, ...] = ()
    shifted: tuple[Changed, ...] = ()


@dataclass(frozen=True, slots=True)
class MitFeedback:
    """A module's answer: position (rad), velocity (rad/s) and torque (N·m) at the output.

    ``at_end`` names the values at an end of their range. Positions beyond the range may also wrap without this sign: if the output
    can turn farther than the range (two turns either way by the manual), use the position from the encoder's messages.
    """

    node: int
    position: float
    velocity: float
    torque: float
    at_end: tuple[str, ...] = ()


def pack(node: int, command: MitCommand, ranges: MitRanges = MANUAL) -> Packed:
    """Return the frame for ``node`` (0 to 63), with each value limited to its range and rounded to the nearest step.

    Raises:
        ArgumentError: the node ID is invalid.
    """
    steps = {field.name: 0 for field in MIT_CONTROL.sent}
    clipped = []
    for field, name, low, high in _spans(MIT_CONTROL.sent, ranges):
        asked = float(getattr(command, name))
        sent = min(max(asked, low), high)
        if sent != asked:
            clipped.append(Changed(name, asked, sent))
        steps[field.name] = _step(field, sent, low, high)
    shifted = () if any(steps.values()) else (_off_zero(steps, command, ranges),)
    data = pack_places(field.place_raw(steps[field.name]) for field in MIT_CONTROL.sent)
    return Packed(Outgoing(can_id(node, MIT_CONTROL.command), data), tuple(clipped), shifted)


def unpack(node: int, data: bytes, ranges: MitRanges = MANUAL) -> MitCommand | Unexpected:
    """Return the command contained in a frame to ``node``, each value at its step, or the reason why the frame is invalid."""
    values = _values(node, data, ranges, from_module=False)
    return values if isinstance(values, Unexpected) else MitCommand(**values)


def read(node: int, data: bytes, ranges: MitRanges = MANUAL) -> MitFeedback | Unexpected:
    """Return the answer of ``node`` (six or eight bytes), or the reason why it is invalid: another node, too few bytes."""
    values = _values(node, data, ranges, from_module=True)
    if isinstance(values, Unexpected):
        return values
    ends = [name for _, name, low, high in _spans(MIT_CONTROL.answer, ranges) if values[name] in (low, high)]
    return MitFeedback(node, **values, at_end=tuple(ends))


def _spans(
    table: tuple[MessageField, ...], ranges: MitRanges
) -> Iterator[tuple[MessageField, str, float, float]]:
    """Yield the fields that have a range, each with the name of its value and both ends."""
    for field in table:
        name = field.name.lower()
        if hasattr(ranges, name):
            high = float(getattr(ranges, name))
            yield field, name, 0.0 if name in ("kp", "kd") else -high, high


def _step(field: MessageField, value: float, low: float, high: float) -> int:
    most = field.type.bounds[1]
    return min(max(math.floor((value - low) * most / (high - low) + 0.5), 0), most)


def _off_zero(steps: dict[str, int], command: MitCommand, ranges: MitRanges) -> Changed:
    steps["Velocity"] = 1
    field, _, low, high = next(each for each in _spans(MIT_CONTROL.sent, ranges) if each[1] == "velocity")
    return Changed("velocity", command.velocity, _value(field, 1, low, high))


def _value(field: MessageField, step: int, low: float, high: float) -> float:
    most = field.type.bounds[1]
    return high if step == most else low + step * (high - low) / most


def _values(node: int, data: bytes, ranges: MitRanges, *, from_module: bool) -> dict[str, float] | Unexpected:
    found = decode(can_id(node, MIT_CONTROL.command), data, from_module=from_module)
    if isinstance(found, Unexpected):
        return found
    if not isinstance(found, DecodedMessage):
        return Unexpected(node, MIT_CONTROL.command, data, Reason.NOT_SENT)
    table = MIT_CONTROL.answer if from_module else MIT_CONTROL.sent
    return {
        name: _value(field, int(found.values[field.name]), low, high)
        for field, name, low, high in _spans(table, ranges)
    }
