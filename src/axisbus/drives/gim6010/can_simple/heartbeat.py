"""The heartbeat in each of its layouts, told apart as far as its bytes allow.

Theory of operation
-------------------
The manual has three layouts (v2.2, 4.1.2), and no frame names its own. Firmware up to 0.5.11 has a byte for each of motor, encoder
and controller; 0.5.12 put these into bits and added a life counter; 0.5.13 added the system's bit. Owners report more: bit 3
instead of bit 7 for "trajectory done" in the oldest, and a temperature in the byte that the manual reserves. A frame with all
flags down fits every layout. So a reading keeps all layouts that its bytes allow, and says of a flag only what they agree on; where
one of them says fault, it is a fault. What follows from several frames (a counter goes on, a flag byte stands) narrows them:
``Heartbeats``. A flag of 1 is taken for a fault, as the manual's first layout and most owners say; one owner reads it the other
way.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

from axisbus.drives.gim6010.can_simple.codec import short
from axisbus.drives.gim6010.can_simple.decoded_message import Unexpected
from axisbus.drives.gim6010.can_simple.fields import BIT, UINT8, UINT32, MessageField
from axisbus.drives.gim6010.can_simple.identifier import Identifier
from axisbus.drives.gim6010.can_simple.messages import HEARTBEAT_FIELDS, LENGTH

COMMAND = 0x01
_STILL = 3  # times that a counter stood before it is taken for none: a frame may be seen twice on the wire


class HeartbeatLayout(Enum):
    """What a firmware's heartbeat holds where."""

    FIRST = "firmware 0.5.11 and earlier"
    COUNTED = "firmware 0.5.12"
    NEWEST = "firmware 0.5.13 and later"


_ERROR_AND_STATE = (MessageField("Axis_Error", UINT32), MessageField("Axis_State", UINT8, 32))
_BY_BYTES = (
    *_ERROR_AND_STATE,
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
# The bits that a layout leaves at 0; byte 6 of the later ones is reserved, and owners saw a temperature there.
_NEVER_SET = {
    HeartbeatLayout.FIRST: (0xFE, 0xFE, 0x76),
    HeartbeatLayout.COUNTED: (0x78, 0x00, 0x00),
    HeartbeatLayout.NEWEST: (0x70, 0x00, 0x00),
}


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """One heartbeat; a flag is None where the layouts that it may have do not agree, or have none.

    ``layouts`` are those that its bytes allow; with none of them only ``axis_error`` and ``state`` are known. ``life`` (0 to 255)
    is None where it may be a flag byte.
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
        """The parts that it reports a fault of; the axis where its error word is not 0."""
        flags = {
            "axis": bool(self.axis_error),
            "motor": self.motor_fault,
            "encoder": self.encoder_fault,
            "controller": self.controller_fault,
            "system": self.system_fault,
        }
        return tuple(name for name, fault in flags.items() if fault)


def read(node: int, data: bytes, known: Collection[HeartbeatLayout] = ALL) -> Heartbeat | Unexpected:
    """Return what the heartbeat of a node says, by those of the ``known`` layouts that its bytes allow."""
    if len(data) < LENGTH:
        return short(Identifier(node, COMMAND), data, LENGTH)
    error = int.from_bytes(data[:4], "little")
    told = _without_error(bytes(data[4:LENGTH]), frozenset(known))
    return replace(told, axis_error=error) if error else told


@lru_cache(maxsize=1024)  # ten come in a second, and hardly one says anything new
def _without_error(end: bytes, known: frozenset[HeartbeatLayout]) -> Heartbeat:
    """Return what the bytes say that follow the error word."""
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
    """True as soon as one layout says so; no fault only where all say so."""
    flags = set(_flags(data, layouts, name))
    if True in flags:
        return True
    return False if flags == {False} else None


def _done(data: bytes, layouts: Collection[HeartbeatLayout]) -> bool | None:
    """Whether the trajectory is at its end: only what all layouts agree on."""
    flags = set(_flags(data, layouts, "Traj_Done"))
    if HeartbeatLayout.FIRST in layouts and TRAJ_DONE_BY_OWNERS.take_raw(data):
        flags = (flags | {True}) if layouts != {HeartbeatLayout.FIRST} else {True}
    return flags.pop() if len(flags) == 1 else None


@dataclass(frozen=True, slots=True)
class Heartbeats:
    """What the heartbeats of one node have told so far; ``after`` gives what they tell with the next one.

    ``missed`` counts the heartbeats that the life counter says were sent and did not come, ``restarts`` the times that it began
    anew (a restarted module, or more than half a round lost, which nobody can tell apart).
    """

    layouts: frozenset[HeartbeatLayout] = ALL
    last: Heartbeat | None = None
    heard: int = 0
    missed: int = 0
    restarts: int = 0
    gap: int = 0  # heartbeats that were missed before the last one
    _byte: int = -1
    _still: int = 0

    def after(self, node: int, data: bytes) -> Heartbeats | Unexpected:
        """Return this with one more heartbeat, or what is wrong with that."""
        fits = read(node, data, self.layouts)
        if isinstance(fits, Unexpected):
            return fits
        # A layout that was ruled out may be the right one after all, where none is left: a module with other firmware.
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
