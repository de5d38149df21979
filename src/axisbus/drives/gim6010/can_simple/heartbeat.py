"""The module's heartbeat in each of its layouts, distinguished as far as its bytes allow.

Theory of operation
-------------------
The manual has three layouts (v2.2, 4.1.2), and no frame identifies its layout. Firmware up to 0.5.11 has a byte for each of motor,
encoder and controller. Firmware 0.5.12 put these into bits and added a life counter; 0.5.13 added the system's bit. Owners report
deviations: bit 3 instead of bit 7 for "trajectory done" in the oldest firmware, and a temperature in the byte that the manual
reserves.

A frame with all flags at 0 fits every layout. Therefore a reading keeps all layouts that its bytes allow, and reports a flag only
if these layouts agree; if one of them shows a fault, it is reported as a fault. Several frames together (a counter that advances, a
flag byte that stays the same) exclude layouts: see ``Heartbeats``. A flag of 1 is read as a fault, as in the manual's first layout
and by most owners; one owner reads it the other way round.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

from axisbus.drives.gim6010.can_simple.codec import Unexpected, short
from axisbus.drives.gim6010.can_simple.fields import BIT, MessageField
from axisbus.drives.gim6010.can_simple.identifier import Identifier
from axisbus.drives.gim6010.can_simple.messages import HEARTBEAT_FIELDS, LENGTH

COMMAND = 0x01
_STILL = 3  # repetitions after which the byte is not a life counter: a frame may be seen twice on the wire


class HeartbeatLayout(Enum):
    """Layout of a firmware's heartbeat."""

    FIRST = "firmware 0.5.11 and earlier"
    COUNTED = "firmware 0.5.12"
    NEWEST = "firmware 0.5.13 and later"


_BY_BYTES = (
    *HEARTBEAT_FIELDS[:2],  # error and state
    MessageField("Motor_Fault", BIT, 5 * 8),
    MessageField("Encoder_Fault", BIT, 6 * 8),
    MessageField("Controller_Fault", BIT, 7 * 8),
    MessageField("Traj_Done", BIT, 7 * 8 + 7),
)
TRAJ_DONE_BY_OWNERS = MessageField("Traj_Done", BIT, 7 * 8 + 3)  # of the first layout
LAYOUTS = {
    HeartbeatLayout.FIRST: _BY_BYTES,
    HeartbeatLayout.COUNTED: tuple(each for each in HEARTBEAT_FIELDS if each.name != "System_Fault"),
    HeartbeatLayout.NEWEST: HEARTBEAT_FIELDS,
}
ALL = frozenset(HeartbeatLayout)
_WITH_LIFE = frozenset({HeartbeatLayout.COUNTED, HeartbeatLayout.NEWEST})
# Bits that a layout leaves at 0. Byte 6 of the later layouts is reserved, but owners saw a temperature there: it is not checked.
_NEVER_SET = {
    HeartbeatLayout.FIRST: (0xFE, 0xFE, 0x76),
    HeartbeatLayout.COUNTED: (0x78, 0x00, 0x00),
    HeartbeatLayout.NEWEST: (0x70, 0x00, 0x00),
}


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """One heartbeat; a flag is None if the possible layouts do not agree on it, or do not contain it.

    ``layouts`` are the layouts that its bytes allow; if there are none, only ``axis_error`` and ``state`` are known. ``life`` (0 to
    255) is None if the byte may be a flag byte.
    """

    axis_error: int
    state: int
    motor_fault: bool | None
    encoder_fault: bool | None
    controller_fault: bool | None
    system_fault: bool | None
    trajectory_done: bool | None
    life: int | None
    layouts: frozenset[HeartbeatLayout]

    @property
    def faults(self) -> tuple[str, ...]:
        """The parts for which the heartbeat reports a fault; "axis" if the error word is not 0."""
        flags = {
            "axis": bool(self.axis_error),
            "motor": self.motor_fault,
            "encoder": self.encoder_fault,
            "controller": self.controller_fault,
            "system": self.system_fault,
        }
        return tuple(name for name, fault in flags.items() if fault)


def read(node: int, data: bytes, known: Collection[HeartbeatLayout] = ALL) -> Heartbeat | Unexpected:
    """Return the contents of a node's heartbeat, according to those of the ``known`` layouts that its bytes allow."""
    if len(data) < LENGTH:
        return short(Identifier(node, COMMAND), data, LENGTH)
    error = int.from_bytes(data[:4], "little")
    told = _without_error(bytes(data[4:LENGTH]), frozenset(known))
    return replace(told, axis_error=error) if error else told


@lru_cache(maxsize=1024)  # ten arrive in a second, and few differ from the one before
def _without_error(end: bytes, known: frozenset[HeartbeatLayout]) -> Heartbeat:
    """Return the contents of the bytes after the error word."""
    data = bytes(LENGTH - len(end)) + end
    layouts = frozenset(each for each in known if _fits(data, each))
    return Heartbeat(
        0,
        data[4],
        _fault(data, layouts, "Motor_Fault"),
        _fault(data, layouts, "Encoder_Fault"),
        _fault(data, layouts, "Controller_Fault"),
        _fault(data, layouts, "System_Fault"),
        _done(data, layouts),
        data[7] if layouts and layouts <= _WITH_LIFE else None,
        layouts,
    )


def _fits(data: bytes, layout: HeartbeatLayout) -> bool:
    return not any(byte & never for byte, never in zip(data[5:8], _NEVER_SET[layout], strict=True))


def _flags(data: bytes, layouts: Collection[HeartbeatLayout], name: str) -> Iterator[bool | None]:
    for layout in layouts:
        field = next((each for each in LAYOUTS[layout] if each.name == name), None)
        yield None if field is None else bool(field.take_raw(data))


def _fault(data: bytes, layouts: Collection[HeartbeatLayout], name: str) -> bool | None:
    """Return True if one layout shows a fault, False only if all layouts show none, and None otherwise."""
    flags = set(_flags(data, layouts, name))
    if True in flags:
        return True
    return False if flags == {False} else None


def _done(data: bytes, layouts: Collection[HeartbeatLayout]) -> bool | None:
    """Return whether the trajectory has ended, if all layouts agree; otherwise None."""
    flags = set(_flags(data, layouts, "Traj_Done"))
    if HeartbeatLayout.FIRST in layouts and TRAJ_DONE_BY_OWNERS.take_raw(data):
        flags = (flags | {True}) if layouts != {HeartbeatLayout.FIRST} else {True}
    return flags.pop() if len(flags) == 1 else None


@dataclass(frozen=True, slots=True)
class Heartbeats:
    """State derived from all heartbeats of one node so far; ``after`` returns the state with the next one included.

    ``missed`` counts the heartbeats that were sent but not received, according to the life counter. ``restarts`` counts how often
    the counter started again: the module restarted, or 128 or more heartbeats were lost; the two cannot be distinguished.
    """

    layouts: frozenset[HeartbeatLayout] = ALL
    last: Heartbeat | None = None
    heard: int = 0
    missed: int = 0
    restarts: int = 0
    gap: int = 0  # heartbeats missing before the last one
    _byte: int = -1
    _still: int = 0

    def after(self, node: int, data: bytes) -> Heartbeats | Unexpected:
        """Return this state with one more heartbeat, or the reason why that heartbeat is invalid."""
        fits = read(node, data, self.layouts)
        if isinstance(fits, Unexpected):
            return fits
        # If no layout is left, one that was excluded may be right after all: the module may have other firmware now.
        fresh = replace(self, layouts=ALL, _still=0) if not fits.layouts else self
        still = fresh._still + 1 if data[7] == self._byte else 0
        layouts = fresh.layouts - _WITH_LIFE if still >= _STILL else fresh.layouts
        beat = read(node, data, layouts)
        assert isinstance(beat, Heartbeat)  # its length is good
        return fresh._noted(beat, data[7], still)

    def _noted(self, beat: Heartbeat, byte: int, still: int) -> Heartbeats:
        gap = restarted = 0
        if beat.life is not None and self.last is not None and self.last.life is not None:
            step = (beat.life - self.last.life) % 256
            restarted = int(step > 128)
            gap = step - 1 if 1 < step <= 128 else 0
        return Heartbeats(
            beat.layouts,
            beat,
            self.heard + 1,
            self.missed + gap,
            self.restarts + restarted,
            gap,
            byte,
            still,
        )
