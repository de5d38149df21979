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

import itertools
import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from statistics import median

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.codec import Unexpected, short
from axisbus.drives.gim6010.can_simple.fields import BIT, MessageField
from axisbus.drives.gim6010.can_simple.identifier import Identifier, can_id, require_node
from axisbus.drives.gim6010.can_simple.messages import HEARTBEAT_FIELDS, IDLE, LENGTH, state_words

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
    layouts = frozenset(
        layout
        for layout in known
        if not any(byte & never for byte, never in zip(data[5:8], _NEVER_SET[layout], strict=True))
    )
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


# -- Detects several modules with the same node ID by the heartbeats of one identifier ---------------------------------
#
# Theory of operation. Two modules with the same node ID send heartbeats with one identifier. If the heartbeats contain a life
# counter (firmware 0.5.12 and later), the frames are two interleaved counts: each frame is assigned to the count that it
# continues, or starts a new one. Without a counter there are two heartbeats in each period, so that short and long intervals
# alternate. Two modules whose heartbeats coincide, or are half a period apart, look like one; they are detected by their two
# answers to one request.


ENOUGH = 4  # frames of a count
_MISSED = 3  # counts from one frame to the next at most, if some were lost
_LIFE, _ROUND = 7, 256
_EVEN = 0.1  # share of the period by which heartbeats of one module may be early or late
_APART = 0.2  # share of the period by which the two intervals must differ


def count_senders(beats: Sequence[tuple[float, bytes]]) -> int:
    """Return the minimum number of modules that sent these heartbeats (time in s, eight bytes each), oldest first."""
    lives = [data[_LIFE] for _, data in beats]
    return max(_counting(lives), _paced([time for time, _ in beats]) if len(set(lives)) == 1 else 1)


def _counting(lives: Sequence[int]) -> int:
    """Return the number of simultaneous counts; a count that ends before another begins is a module that restarted."""
    counts: list[list[int]] = []  # indices into ``lives``
    for place, life in enumerate(lives):
        steps = [((life - lives[each[-1]]) % _ROUND, -each[-1], each) for each in counts]
        fitting = [each for each in steps if 1 <= each[0] <= _MISSED]
        if fitting:  # the count with the fewest lost frames, then the most recent one
            min(fitting)[2].append(place)
        else:
            counts.append([place])
    spans = [(each[0], each[-1]) for each in counts if len(each) >= ENOUGH]
    return (
        max((sum(first <= place < last for first, last in spans) for place in range(len(lives))), default=1)
        or 1
    )


def _paced(times: Sequence[float]) -> int:
    """Return 2 if short and long intervals alternate regularly; otherwise 1, also if one module is sometimes late."""
    steps = [after - before for before, after in itertools.pairwise(times)]
    if len(steps) < 2 * ENOUGH:
        return 1
    turns = steps[::2], steps[1::2]
    usual = [median(each) for each in turns]
    period = sum(usual)
    even = all(
        abs(step - length) <= _EVEN * period
        for each, length in zip(turns, usual, strict=True)
        for step in each
    )
    return 2 if even and abs(usual[0] - usual[1]) > _APART * period else 1


# ----------------------------------------------------------------------------------------------------------------------
# Monitors the heartbeat of one module: its last state, and whether it is present, unique, and not restarted.


_SILENCE, PERIODS = 0.6, 5  # s, or periods of its heartbeat, after which a module is lost
_KEPT = 32


class HeartbeatMonitor:
    """The heartbeats of one node ID; times are s of the clock of their frames."""

    def __init__(self, node: int) -> None:
        """``node`` 0 to 63. Raises ArgumentError: the node ID is invalid."""
        require_node(node)
        self.node = node
        self.alone = True  # no second module of this node ID was heard
        self._identifier = can_id(node, COMMAND)
        self.beats = Heartbeats()
        self.stamps: deque[tuple[float, bytes]] = deque(maxlen=_KEPT)
        self._restarts = 0

    def take(self, frame: CanFrame) -> bool:
        """Take a frame; return whether it is a heartbeat of this module."""
        if frame.extended or frame.remote or frame.can_id != self._identifier:
            return False
        return self.hear(bytes(frame.data), frame.time)

    def hear(self, data: bytes, stamp: float) -> bool:
        """Take the data of a heartbeat received at ``stamp``; return whether they are valid."""
        seen = self.beats.after(self.node, data)
        if not isinstance(seen, Heartbeats):
            return False
        self.beats = seen
        self.stamps.append((stamp, data))
        self.alone = count_senders(list(self.stamps)) == 1
        return True

    @property
    def last(self) -> Heartbeat | None:
        return self.beats.last

    @property
    def at(self) -> float:
        """Time of the last heartbeat; -inf if there was none."""
        return self.stamps[-1][0] if self.stamps else -math.inf

    @property
    def period(self) -> float:
        """Mean period in s; 0 if unknown."""
        if len(self.stamps) < 2:
            return 0.0
        return (self.stamps[-1][0] - self.stamps[0][0]) / (len(self.stamps) - 1)

    def is_silent(self, now: float, first: float = _SILENCE) -> bool:
        """Whether the last heartbeat is so old that the module counts as lost; ``first`` (s): the limit if it is the only one."""
        return now - self.at > (max(_SILENCE, PERIODS * self.period) if len(self.stamps) > 1 else first)

    def settle(self) -> None:
        """Count restarts from now on."""
        self._restarts = self.beats.restarts

    @property
    def restarted(self) -> bool:
        """Whether its life counter has restarted since ``settle``."""
        return self.beats.restarts > self._restarts

    def against(self, now: float) -> str:
        """Return the reason not to move the module; empty if exactly one module sends heartbeats, is idle and has no error."""
        last = self.last
        if last is None or self.is_silent(now):
            return f"module {self.node} sends no heartbeat, by which alone it can be followed"
        if not self.alone:
            return f"several modules have the node ID {self.node}: all of them would move"
        if last.state != IDLE:
            return f"module {self.node} is in {state_words(last.state)}, and not idle: another program controls it"
        found = self.errors()
        return f"module {self.node} has errors: {'; '.join(found)}" if found else ""

    def lost(self, now: float) -> str:
        """Return the reason why the module can no longer be monitored; empty if it can."""
        if self.is_silent(now):
            return "the module is no longer heard"
        if self.restarted:
            return "the module restarted meanwhile"
        return "" if self.alone else "a second module of this node ID is heard"

    def errors(self) -> list[str]:
        """Return the errors in its last heartbeat, a sentence each."""
        return [] if self.last is None else reported_errors(self.last, {})


def reported_errors(beat: Heartbeat, words: Mapping[str, int]) -> list[str]:
    """Return a sentence for each error in a heartbeat and in the error words by category; empty if there is none."""
    told = {"axis": beat.axis_error, **words}
    found = [text for category, word in told.items() for text in faults.words(category, word)]
    return found + [f"{part}: its heartbeat reports a fault" for part in beat.faults if not told.get(part)]
