"""Protocols of a GIM6010-8 before it is switched to CANopen, distinguished from CANopen by listening only.

Theory of operation
-------------------
CAN Simple has 11-bit identifiers, node << 5 | command; its heartbeat is command 1 with 8 bytes, by default every 100 ms (manual
v2.2, 4.1.2). The heartbeat of node 4 is therefore 081h, like an EMCY of CANopen node 1, and that of node 12 is 181h, like its first
TPDO. So a single frame proves nothing. Required are ``ENOUGH`` frames of one identifier, all with 8 bytes, a valid state byte,
flags only at the manual's positions, and a possible heartbeat period. In addition, depending on the identifier:

- if CiA 301 allows no device to send it (``_RESERVED``): nothing; with a life counter, not even the period;
- otherwise, with the life counter of firmware 0.5.12 and later: no error control (heartbeat, boot-up, guarding) of the CANopen node
  to which the identifier would belong;
- otherwise, without a life counter: no error control, NMT or SYNC on the whole bus, and the module's position frames (command 9);
  or as EMCY of that node, the frames would repeat "no error" again and again.

Its newest firmware may use a third protocol with 29-bit identifiers: priority (3 bits), type (8), destination (8), source (8),
sequence (2). Its heartbeat is type 48h, with a life counter in the upper three bits of its first byte.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from itertools import pairwise
from statistics import median
from typing import ClassVar, NamedTuple

from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.identifier import split
from axisbus.drives.gim6010.can_simple.messages import STATES, command_name
from axisbus.wording import counted

ENOUGH = 4  # frames that prove a heartbeat
BIT_RATE = 500_000  # factory setting
_KEPT = 16  # last frames that are stored and evaluated
_PERIOD = (0.005, 2.5)  # s: possible periods of a heartbeat
_JITTER = 0.35  # share of the period by which a frame may be early or late
_LOST = 3  # periods from one frame to the next at most, if some were lost
_MOST = 256  # identifiers that are stored

_LENGTH = 8
_COMMAND_BITS = 5
_HEARTBEAT, _POSITION = 0x01, 0x09
_RESERVED = (
    frozenset(range(0x001, 0x080)) | frozenset(range(0x6E0, 0x700)) | frozenset(range(0x780, 0x7E4))
)  # CiA 301 7.3.5, without the SRDOs of EN 50325-5 and LSS
_HEARTBEAT_29, _TYPE_SHIFT = 0x48, 18
_SEQUENCE = 0x3  # bits of a 29-bit identifier that vary
_FLAGS = 0x8F  # motor, encoder, controller, system fault, trajectory done (bit 7)
_LEGACY_FLAGS = 0x89  # flags of firmware 0.5.11 and earlier, in the last byte


class Protocol(Enum):
    """A protocol of the module other than CANopen."""

    CAN_SIMPLE = "CAN Simple"
    EXTENDED = "the 29-bit protocol of newer firmware"


class Speaker(NamedTuple):
    """A module that was heard; ``period`` of its heartbeat in seconds (None: unknown), ``state`` of ``STATES``."""

    protocol: Protocol
    node: int
    can_id: int
    period: float | None
    state: int | None
    axis_error: int = 0

    @property
    def plain(self) -> dict[str, object]:
        return {
            "protocol": "CAN Simple" if self.protocol is Protocol.CAN_SIMPLE else "29-bit",
            "node_id": self.node,
            "can_id": self.can_id,
            "period": self.period,
            "state": STATES.get(self.state or 0),
            "axis_error": self.axis_error,
        }

    @property
    def words(self) -> str:
        """Module, identifier, period and state: ``node 1 (021h every 100 ms: idle)``."""
        width = 3 if self.protocol is Protocol.CAN_SIMPLE else 8
        often = "" if self.period is None else f" every {self.period * 1000:.0f} ms"
        how = "" if self.state is None else f": {STATES[self.state]}"
        wrong = f", axis error {error_words(self.axis_error)}" if self.axis_error else ""
        return f"node {self.node} ({self.can_id:0{width}X}h{often}{how}{wrong})"


@dataclass(slots=True)
class ProtocolListener:
    """Recognises modules with another protocol; holds the last heartbeats by identifier, and the signs of CANopen so far."""

    factory_rate: ClassVar[int] = BIT_RATE
    make: ClassVar[str] = "a GIM6010-8"

    frames: int = 0  # without error frames
    _heard: dict[tuple[int, bool], deque[tuple[float, bytes]]] = field(default_factory=dict)
    _positions: dict[int, deque[bytes]] = field(default_factory=dict)
    _other: set[tuple[int, bool]] = field(default_factory=set)  # identifiers of no heartbeat, certainly
    _canopen: set[int] = field(default_factory=set)  # nodes with error control
    _service: bool = False  # NMT or SYNC was heard
    _wide: dict[int, deque[float]] = field(default_factory=dict)  # times of heartbeats of 29 bits

    def note(self, frame: CanFrame) -> None:
        """Take a frame; frames must come in order of time."""
        if frame.error:
            return
        self.frames += 1
        if not frame.extended:
            self._standard(frame)
        elif is_beat(frame):
            key = frame.can_id & ~_SEQUENCE
            self._keep(frame, key)
            if key in self._wide or len(self._wide) < _MOST:
                self._wide.setdefault(key, deque(maxlen=_KEPT)).append(frame.time)

    @property
    def speakers(self) -> list[Speaker]:
        """Modules with another protocol, by protocol and node."""
        found = [speaker for key in self._heard if (speaker := self._judge(*key)) is not None]
        return sorted(found, key=lambda each: (each.protocol is Protocol.EXTENDED, each.node))

    @property
    def extended(self) -> tuple[int, ...]:
        """Identifiers of the heartbeats of modules with the 29-bit protocol, without the sequence, lowest first."""
        return tuple(sorted(key for key, times in self._wide.items() if _beats(list(times))))

    def speaker(self, frame: CanFrame) -> Speaker | None:
        """Return the sender of a frame, if it is known to be a module with another protocol."""
        if frame.error or frame.remote:
            return None
        if frame.extended:
            key = frame.can_id & ~_SEQUENCE
            return self._judge(key, True) if (key, True) in self._heard else None
        beat = frame.can_id & ~0x1F | _HEARTBEAT
        if (beat, False) not in self._heard:
            return None
        plain = frame.can_id in _RESERVED or frame.can_id & 0x1F == _HEARTBEAT
        if not plain and (frame.can_id & 0x1F != _POSITION or self._supervised(frame.can_id)):
            return None
        return self._judge(beat, False)

    def text(self, frame: CanFrame) -> str | None:
        """Return the text of a frame of a module with another protocol: its command, and the contents of a heartbeat."""
        speaker = self.speaker(frame)
        if speaker is None:
            return None
        beat = frame.extended or frame.can_id == speaker.can_id
        name = "heartbeat" if beat else command_name(split(frame.can_id).command)
        said = heartbeat_words(speaker, frame.data) if beat else ""
        return f"{speaker.protocol.value}, node {speaker.node}, {name}: {said or frame.data.hex(' ').upper() or 'no data'}"

    def commands(self, can_ids: Iterable[int]) -> set[int]:
        """Return the 11-bit identifiers among ``can_ids`` that a module with CAN Simple takes for commands to it."""
        nodes = {each.node for each in self.speakers if each.protocol is Protocol.CAN_SIMPLE}
        return {can_id for can_id in can_ids if split(can_id).node in nodes}

    def heard(self) -> list[str]:
        """Return the modules heard, a line per protocol; empty if there are none."""
        lines, speakers = [], self.speakers
        for protocol in Protocol:
            found = [each for each in speakers if each.protocol is protocol]
            if found:
                who = counted(len(found), "module speaks", "modules speak")
                lines.append(
                    f"{who} {protocol.value}, not CANopen: {', '.join(each.words for each in found)}"
                )
        return lines

    def remedies(self) -> list[str]:
        """Return what to do about the modules heard, a line per protocol."""
        protocols = {each.protocol for each in self.speakers}
        return [remedy for protocol, remedy in REMEDIES.items() if protocol in protocols]

    def _standard(self, frame: CanFrame) -> None:
        self._signs(frame)
        command = frame.can_id & 0x1F
        if command == _HEARTBEAT and not frame.remote:
            self._keep(frame, frame.can_id)
        elif command == _POSITION and len(frame.data) == _LENGTH:
            node = frame.can_id >> _COMMAND_BITS
            self._positions.setdefault(node, deque(maxlen=_KEPT)).append(frame.data)

    def _signs(self, frame: CanFrame) -> None:
        """Note frames that only CANopen sends: error control (or a request for it), NMT commands, SYNC."""
        function, node = frame.can_id & 0x780, frame.can_id & 0x7F
        if function == cob.HEARTBEAT and node and (frame.remote or len(frame.data) == 1):
            self._canopen.add(node)
        elif not frame.remote and (
            (frame.can_id == cob.NMT and len(frame.data) == 2)
            or (frame.can_id == cob.SYNC and len(frame.data) < 2)
        ):
            self._service = True

    def _keep(self, frame: CanFrame, can_id: int) -> None:
        key = can_id, frame.extended
        if key in self._other:
            return
        if len(frame.data) != _LENGTH:
            self._heard.pop(key, None)
            self._other.add(key)
        elif not frame.extended and not (_life(frame.data) or _legacy(frame.data)):
            self._heard.pop(key, None)  # later frames start a new proof
        elif key in self._heard or len(self._heard) < _MOST:
            self._heard.setdefault(key, deque(maxlen=_KEPT)).append((frame.time, frame.data))

    def _judge(self, can_id: int, extended: bool) -> Speaker | None:
        beats = self._heard[can_id, extended]
        if len(beats) < ENOUGH or (not extended and self._supervised(can_id)):
            return None
        pace = _pace([time for time, _ in beats])
        data = [each for _, each in beats]
        return _extended(can_id, data, pace) if extended else self._simple(can_id, data, pace)

    def _simple(self, can_id: int, data: Sequence[bytes], pace: _Pace) -> Speaker | None:
        lives = all(_life(each) for each in data) and _counts([each[7] for each in data], 256)
        if not lives and not (pace.kept and all(_legacy(each) for each in data)):
            return None
        if can_id not in _RESERVED and not (pace.plausible and self._alone(can_id, data, lives=lives)):
            return None
        newest = data[-1]
        error = int.from_bytes(newest[:4], "little")
        node = can_id >> _COMMAND_BITS
        return Speaker(Protocol.CAN_SIMPLE, node, can_id, pace.period, newest[4], error)

    def _alone(self, can_id: int, data: Sequence[bytes], *, lives: bool) -> bool:
        """Whether no received frame indicates a CANopen device behind an identifier that such a device may have."""
        if self._supervised(can_id):
            return False
        if lives or (can_id & 0x780 == cob.EMCY and not any(any(each[:4]) for each in data)):
            return True  # no device sends "no error" (an EMCY of zeros) again and again
        positions = self._positions.get(can_id >> _COMMAND_BITS, ())
        return (
            not self._canopen
            and not self._service
            and len(positions) >= ENOUGH
            and all(_floats(each) for each in positions)
        )

    def _supervised(self, can_id: int) -> bool:
        return can_id not in _RESERVED and can_id & 0x7F in self._canopen


_SWITCH = "axisbus gim6010 set-id gives it a free node ID from 1 to 63, and axisbus gim6010 to-canopen changes its protocol"
REMEDIES = {
    Protocol.CAN_SIMPLE: f"a GIM6010-8 leaves its factory like this (500 kbit/s, node ID 0 or 1): {_SWITCH}",
    Protocol.EXTENDED: "the manufacturer's firmware 0.6.8 and later may use it, and the manual does not describe it: ask the "
    f"manufacturer, or try over USB whether it can be changed ({_SWITCH}, both with --usb)",
}


def heartbeat_words(speaker: Speaker, data: bytes) -> str:
    """Return the contents of a heartbeat as text, ``idle, no axis error``; of other frames nothing."""
    if speaker.protocol is Protocol.EXTENDED:
        return f"life {data[0] >> 5}" if len(data) == _LENGTH else ""
    if len(data) != _LENGTH or data[4] not in STATES:
        return ""
    error = int.from_bytes(data[:4], "little")
    return f"{STATES[data[4]]}, {'no axis error' if not error else f'axis error {error_words(error)}'}"


def error_words(error: int) -> str:
    """Return an axis error in hexadecimal with the names of its bits (manual v2.2, 5.7)."""
    names = [each.name for each in faults.FAULTS if each.category == "axis" and each.bits & error]
    return f"0x{error:08X}" + (f" ({', '.join(names)})" if names else "")


# -- checks of one frame, or several -------------------------------------------------------------------------------------------


class _Pace(NamedTuple):
    """Timing of frames: the median time between two in seconds (None: unknown), and whether they are periodic."""

    period: float | None
    kept: bool
    timed: bool

    @property
    def plausible(self) -> bool:
        """Whether a heartbeat is possible: the frames have a possible period, or no times at all."""
        return self.kept or not self.timed


def _pace(times: Sequence[float]) -> _Pace:
    steps = [after - before for before, after in pairwise(times)]
    if not any(steps):
        return _Pace(None, False, False)
    usual = median(steps)
    if not _PERIOD[0] <= usual <= _PERIOD[1] or not all(0 < step <= (_LOST + 1) * usual for step in steps):
        return _Pace(None, False, True)
    period = sum(steps) / sum(max(1, round(step / usual)) for step in steps)
    return (
        _Pace(period, True, True) if all(_kept(step / period) for step in steps) else _Pace(None, False, True)
    )


def _kept(periods: float) -> bool:
    whole = round(periods)
    return 1 <= whole <= _LOST and abs(periods - whole) <= _JITTER


def _life(data: bytes) -> bool:
    """Whether the data look like a heartbeat of firmware 0.5.12 and later, apart from its counter."""
    return data[4] in STATES and not data[5] & ~_FLAGS and not data[6]


def _legacy(data: bytes) -> bool:
    """Whether the data look like a heartbeat of firmware 0.5.11 and earlier."""
    return data[4] in STATES and data[5] < 2 and data[6] < 2 and not data[7] & ~_LEGACY_FLAGS


def _counts(values: Sequence[int], modulo: int) -> bool:
    """Whether the values count up by one per frame, lost frames included."""
    steps = [(after - before) % modulo for before, after in pairwise(values)]
    return all(1 <= step <= _LOST for step in steps) and median(steps) == 1


def _floats(data: bytes) -> bool:
    """Whether the data are two floats of a size possible for turns and turns per second."""
    return all(value == 0.0 or 1e-9 < abs(value) < 1e6 for value in struct.unpack("<ff", data))


def _extended(can_id: int, data: Sequence[bytes], pace: _Pace) -> Speaker | None:
    node = can_id >> 2 & 0xFF
    if not (1 <= node <= 254 and pace.plausible and _counts([each[0] >> 5 for each in data], 8)):
        return None
    return Speaker(Protocol.EXTENDED, node, can_id, pace.period, None)


# -- The 29-bit protocol: recognised by its heartbeats, and never used for requests ------------------------------------
#
# Theory of operation. Only one heartbeat identifier is published: 19200404h, of node 1. Its type 48h is in bits 25 to 18; bits 17
# to 10 and bits 9 to 2 both contain 1. It is not published which of the two is the sender; if they differ, both are reported.
# Several heartbeats of one identifier, with a possible heartbeat period, count as a module.


def is_beat(frame: CanFrame) -> bool:
    """Return whether a frame has the identifier of a heartbeat of the 29-bit protocol."""
    return frame.extended and not frame.remote and frame.can_id >> _TYPE_SHIFT & 0xFF == _HEARTBEAT_29


def addresses(can_id: int) -> tuple[int, ...]:
    """Return the values of the two address fields of a 29-bit identifier, without duplicates."""
    return tuple(dict.fromkeys((can_id >> 10 & 0xFF, can_id >> 2 & 0xFF)))


def _beats(times: list[float]) -> bool:
    if len(times) < ENOUGH:
        return False
    return _PERIOD[0] <= median(after - before for before, after in pairwise(times)) <= _PERIOD[1]
