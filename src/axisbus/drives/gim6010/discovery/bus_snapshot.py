"""Snapshot of a bus by listening: modules of each protocol, CANopen nodes, and identifiers that belong to none of them.

Theory of operation. ``ProtocolListener`` recognises CAN Simple and the 29-bit protocol; error control (700h plus node)
indicates a CANopen node. All other identifiers are stored with the number of their frames. An identifier that belongs to no known
node is foreign: nothing is sent on it. If there is foreign traffic, silent node IDs get no requests unless the user asks for that.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection
from dataclasses import dataclass, field

from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple import heartbeat
from axisbus.drives.gim6010.can_simple.heartbeat import Heartbeat, Heartbeats, count_senders
from axisbus.drives.gim6010.can_simple.identifier import COMMANDS, can_id, canopen_identifiers, split
from axisbus.drives.gim6010.can_simple.messages import STATES
from axisbus.drives.gim6010.factory_protocols import Protocol, ProtocolListener, Speaker, addresses

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
    beats: dict[int, Heartbeats] = field(default_factory=dict)
    states: dict[int, int] = field(default_factory=dict)  # byte of error control, by CANopen node
    heard: Counter[tuple[int, bool]] = field(default_factory=Counter)
    proven: set[int] = field(default_factory=set)  # CAN Simple nodes that answered a request
    answering: set[int] = field(default_factory=set)  # CANopen nodes that answered a request
    _proven: dict[int, Speaker] = field(default_factory=dict)  # a module once recognised stays recognised
    # listeners begun after a module's restart, which interrupts its count
    _anew: dict[int, ProtocolListener] = field(default_factory=dict)
    _raw: dict[int, deque[tuple[float, bytes]]] = field(default_factory=dict)

    def note(self, frame: CanFrame) -> None:
        """Take a frame; frames must come in order of time. Never raises."""
        for each in (self.listening, *self._anew.values()):
            each.note(frame)
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
        return any(node not in self.simple and self._beats_alone(node) for node in self._raw)

    @property
    def simple(self) -> set[int]:
        """All node IDs with CAN Simple."""
        return {*self.speakers, *self.twins, *self.proven}

    @property
    def canopen(self) -> set[int]:
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
        known = {can_id(node, command) for node in self.simple for command in COMMANDS}
        known |= canopen_identifiers(sorted(self.canopen)).keys()
        extended = {address for identifier in self.listening.extended for address in addresses(identifier)}
        return sorted(
            (
                UnknownIdentifier(identifier, wide, count)
                for (identifier, wide), count in self.heard.items()
                if (extended.isdisjoint(addresses(identifier)) if wide else identifier not in known)
            ),
            key=lambda each: (each.extended, each.can_id),
        )

    def used(self, identifiers: Collection[int]) -> bool:
        """Whether anything was heard on one of these identifiers of 11 bits."""
        return any((each, False) in self.heard for each in identifiers)

    def _beat(self, node: int, frame: CanFrame) -> None:
        before = self.beats.get(node, Heartbeats())
        seen = before.after(node, frame.data)
        if isinstance(seen, Heartbeats):
            if seen.restarts > before.restarts:  # store the modules recognised so far, and start a new proof
                self._proven |= self.speakers
                self._anew[node] = ProtocolListener()
            self.beats[node] = seen
            self._raw.setdefault(node, deque(maxlen=_KEPT)).append((frame.time, frame.data))

    def _beats_alone(self, node: int) -> bool:
        """Whether all frames with this node's heartbeat identifier look like heartbeats, and no known CANopen node owns it."""
        owners = canopen_identifiers(sorted(self.canopen))
        return can_id(node, heartbeat.COMMAND) not in owners and self._look_alike(node)

    def _look_alike(self, node: int) -> bool:
        found = [heartbeat.read(node, data) for _, data in self._raw[node]]
        return all(isinstance(each, Heartbeat) and each.layouts and each.state in STATES for each in found)
