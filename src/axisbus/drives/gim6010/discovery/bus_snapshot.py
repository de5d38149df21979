"""Snapshot of a bus by listening: modules of each protocol, CANopen nodes, and identifiers that belong to none of them.

Theory of operation. ``ProtocolListener`` recognises CAN Simple, ``Heartbeat29`` the 29-bit protocol; error control (700h plus node)
indicates a CANopen node. All other identifiers are stored with the number of their frames. An identifier that belongs to no known
node is foreign: nothing is sent on it. If there is foreign traffic, silent node IDs get no requests unless the user asks for that.
"""

from __future__ import annotations

import itertools
from collections import Counter, deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from statistics import median

from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple import heartbeat
from axisbus.drives.gim6010.can_simple.coexistence import canopen_identifiers
from axisbus.drives.gim6010.can_simple.heartbeat import Heartbeat, Heartbeats
from axisbus.drives.gim6010.can_simple.identifier import COMMANDS, can_id, split
from axisbus.drives.gim6010.can_simple.states import STATES
from axisbus.drives.gim6010.factory_protocols import (
    Heartbeat29,
    Protocol,
    ProtocolListener,
    Speaker,
    addresses,
)

_KEPT = 64  # heartbeats of a node that are evaluated
_DOUBTFUL = 8  # frames that look like heartbeats, on an identifier of another node
_LENGTH = 8
_MOST = 512  # identifiers that are stored


@dataclass(frozen=True, slots=True)
class UnknownIdentifier:
    """An identifier of no known node: the number of its frames, and its meaning in CANopen and CAN Simple."""

    can_id: int
    extended: bool
    frames: int

    @property
    def words(self) -> str:
        """As text: ``2A5h (heard 12 x; as CANopen it were ...; as CAN Simple command 05h of node 21)``."""
        if self.extended:
            return f"{self.can_id:08X}h, of 29 bits (heard {self.frames} x)"
        node, command = split(self.can_id)
        would = canopen_identifiers(cob.NODE_IDS).get(self.can_id)
        as_canopen = f"; as CANopen it were {would}" if would else ""
        return f"{self.can_id:03X}h (heard {self.frames} x{as_canopen}; as CAN Simple command {command:02X}h of node {node})"


@dataclass(slots=True)
class BusSnapshot:
    """Follows a bus: the modules recognised, the last heartbeats by node, and the number of frames of each identifier."""

    listening: ProtocolListener = field(default_factory=ProtocolListener)
    wide: Heartbeat29 = field(default_factory=Heartbeat29)
    beats: dict[int, Heartbeats] = field(default_factory=dict)
    states: dict[int, int] = field(default_factory=dict)  # byte of error control, by CANopen node
    heard: Counter[tuple[int, bool]] = field(default_factory=Counter)
    proven: set[int] = field(default_factory=set)  # CAN Simple nodes that answered a request
    answering: set[int] = field(default_factory=set)  # CANopen nodes that answered a request
    _proven: dict[int, Speaker] = field(default_factory=dict)  # a module once recognised stays recognised
    _anew: dict[int, ProtocolListener] = field(
        default_factory=dict
    )  # listeners begun after a module's restart, which interrupts its count
    _raw: dict[int, deque[tuple[float, bytes]]] = field(default_factory=dict)

    def note(self, frame: CanFrame) -> None:
        """Take a frame; frames must come in order of time. Never raises."""
        for each in (self.listening, *self._anew.values()):
            each.note(frame)
        self.wide.note(frame)
        if frame.error:
            return
        key = frame.can_id, frame.extended
        if key in self.heard or len(self.heard) < _MOST:
            self.heard[key] += 1
        if frame.extended or frame.remote:
            return
        node, command = split(frame.can_id)
        if command == heartbeat.COMMAND and len(frame.data) == _LENGTH:
            self._beat(node, frame)
        if frame.can_id - cob.HEARTBEAT in cob.NODE_IDS and len(frame.data) == 1:
            self.states[frame.can_id - cob.HEARTBEAT] = frame.data[0] & 0x7F

    @property
    def speakers(self) -> dict[int, Speaker]:
        """Modules whose heartbeats prove CAN Simple, by node ID."""
        for listening in (self.listening, *self._anew.values()):
            for each in listening.speakers:
                if each.protocol is Protocol.CAN_SIMPLE:
                    self._proven[each.node] = each
        return dict(self._proven)

    @property
    def unproven(self) -> bool:
        """Whether frames look like heartbeats of CAN Simple, so that more of them may prove it."""
        owned = canopen_identifiers(sorted(self.canopen))
        return any(
            node not in self.simple
            and can_id(node, heartbeat.COMMAND) not in owned
            and self._look_alike(node)
            for node in self._raw
        )

    @property
    def simple(self) -> set[int]:
        """All node IDs with CAN Simple."""
        return {*self.speakers, *self.twins, *self.proven}

    @property
    def canopen(self) -> set[int]:
        """All CANopen nodes."""
        return {*self.states, *self.answering}

    @property
    def twins(self) -> dict[int, int]:
        """Node IDs of CAN Simple that several modules share, with the number of modules; not if CANopen uses the identifier."""
        found = {
            node: count_senders(list(beats)) for node, beats in self._raw.items() if self._beats_alone(node)
        }
        return {node: count for node, count in found.items() if count > 1}

    @property
    def doubtful(self) -> dict[int, int]:
        """Node IDs of CAN Simple whose heartbeats may arrive on an identifier of a known CANopen node, with their number."""
        return {
            node: len(beats)
            for node, beats in self._raw.items()
            if len(beats) >= _DOUBTFUL and node not in self.simple and self._look_alike(node)
        }

    def foreign(self) -> list[UnknownIdentifier]:
        """Return the identifiers that belong to no known node, lowest first."""
        known = self._known()
        extended = {address for identifier in self.wide.modules for address in addresses(identifier)}
        return sorted(
            (
                UnknownIdentifier(identifier, wide, count)
                for (identifier, wide), count in self.heard.items()
                if (not _of_extended(identifier, extended) if wide else identifier not in known)
            ),
            key=lambda each: (each.extended, each.can_id),
        )

    def used(self, identifiers: Collection[int]) -> bool:
        """Whether anything was heard on one of these identifiers of 11 bits."""
        return any((each, False) in self.heard for each in identifiers)

    def _known(self) -> set[int]:
        simple = {can_id(node, command) for node in self.simple for command in COMMANDS}
        return simple | set(canopen_identifiers(sorted(self.canopen)))

    def _beat(self, node: int, frame: CanFrame) -> None:
        before = self.beats.get(node, Heartbeats())
        seen = before.after(node, frame.data)
        if isinstance(seen, Heartbeats):
            if seen.restarts > before.restarts:
                self._restarted(node)
            self.beats[node] = seen
            self._raw.setdefault(node, deque(maxlen=_KEPT)).append((frame.time, frame.data))

    def _beats_alone(self, node: int) -> bool:
        """Whether all frames with this node's heartbeat identifier look like heartbeats, and no known CANopen node owns it."""
        owners = canopen_identifiers(sorted(self.canopen))
        return can_id(node, heartbeat.COMMAND) not in owners and self._look_alike(node)

    def _look_alike(self, node: int) -> bool:
        return all(_looks_like_a_beat(node, data) for _, data in self._raw[node])

    def _restarted(self, node: int) -> None:
        """Store the modules recognised so far, and start a new proof for this node."""
        self._proven |= self.speakers
        self._anew[node] = ProtocolListener()


def _of_extended(identifier: int, speakers: set[int]) -> bool:
    """Whether the source or destination of a 29-bit identifier may be one of these modules."""
    return not speakers.isdisjoint(addresses(identifier))


def _looks_like_a_beat(node: int, data: bytes) -> bool:
    found = heartbeat.read(node, data)
    return isinstance(found, Heartbeat) and bool(found.layouts) and found.state in STATES


# -- Detects several modules with the same node ID by the heartbeats of one identifier ---------------------------------
#
# Theory of operation. Two modules with the same node ID send heartbeats with one identifier. If the heartbeats contain a life
# counter (firmware 0.5.12 and later), the frames are two interleaved counts: each frame is assigned to the count that it
# continues, or starts a new one. Without a counter there are two heartbeats in each period, so that short and long intervals
# alternate. Two modules whose heartbeats coincide, or are half a period apart, look like one; they are detected by their two
# answers to one request.


ENOUGH = 4  # frames of a count
_LOST = 3  # counts from one frame to the next at most, if some were lost
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
        fitting = [each for each in steps if 1 <= each[0] <= _LOST]
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
