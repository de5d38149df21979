"""Monitors the heartbeat of one module in motion: its last state, and whether it is present, unique, and not restarted."""

from __future__ import annotations

import math
from collections import deque

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.heartbeat import COMMAND, Heartbeat, Heartbeats
from axisbus.drives.gim6010.can_simple.identifier import NODES, can_id
from axisbus.drives.gim6010.can_simple.states import IDLE, state_words
from axisbus.drives.gim6010.discovery.duplicate_node_ids import count_senders
from axisbus.errors import ArgumentError

_SILENCE, PERIODS = 0.6, 5  # s, or periods of its heartbeat, after which a module is lost
_KEPT = 32


class HeartbeatMonitor:
    """The heartbeats of one node ID; times are s of the clock of their frames."""

    def __init__(self, node: int) -> None:
        """``node`` 0 to 63.

        Raises:
            ArgumentError: the node ID is invalid.
        """
        if isinstance(node, bool) or node not in NODES:
            raise ArgumentError(
                f"{node!r} is not a node ID of CAN Simple", remedy="give a number from 0 to 63"
            )
        self.node = node
        self.alone = True  # no second module of this node ID was heard
        self._identifier = can_id(node, COMMAND)
        self._beats = Heartbeats()
        self._stamps: deque[tuple[float, bytes]] = deque(maxlen=_KEPT)
        self._restarts = 0

    def take(self, frame: CanFrame) -> bool:
        """Take a frame; return whether it is a heartbeat of this module."""
        if frame.extended or frame.remote or frame.can_id != self._identifier:
            return False
        seen = self._beats.after(self.node, frame.data)
        if not isinstance(seen, Heartbeats):
            return False
        self._beats = seen
        self._stamps.append((frame.time, bytes(frame.data)))
        self.alone = count_senders(list(self._stamps)) == 1
        return True

    @property
    def last(self) -> Heartbeat | None:
        """The last heartbeat."""
        return self._beats.last

    @property
    def at(self) -> float:
        """Time of the last heartbeat; -inf if there was none."""
        return self._stamps[-1][0] if self._stamps else -math.inf

    @property
    def period(self) -> float:
        """Mean period in s; 0 if unknown."""
        if len(self._stamps) < 2:
            return 0.0
        return (self._stamps[-1][0] - self._stamps[0][0]) / (len(self._stamps) - 1)

    def is_silent(self, now: float) -> bool:
        """Whether the last heartbeat is so old that the module counts as lost."""
        return now - self.at > max(_SILENCE, PERIODS * self.period)

    def settle(self) -> None:
        """Count restarts from now on."""
        self._restarts = self._beats.restarts

    @property
    def restarted(self) -> bool:
        """Whether its life counter has restarted since ``settle``."""
        return self._beats.restarts > self._restarts

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
        last = self.last
        if last is None:
            return []
        parts = [f"{part}: its heartbeat reports a fault" for part in last.faults if part != "axis"]
        return [*faults.words("axis", last.axis_error), *parts]
