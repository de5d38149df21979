"""Listen to the heartbeats of one module and ask it questions; notice other nodes with the same node ID."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Protocol, TypeVar, cast

from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.clock import Clock
from axisbus.drives.gim6010.bus.run import Sends, send
from axisbus.drives.gim6010.can_simple.heartbeat import COMMAND, Heartbeats
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.discovery.questions import ProbeFrame
from axisbus.drives.gim6010.factory_protocols import is_beat

T = TypeVar("T")

_TICK = 0.002  # s between two checks for new frames
_ANSWER = 0.1  # s allowed for an answer
_KEPT = 1000  # frames stored until they are evaluated


class BootChannel(Sends, Protocol):
    """The channel to the module: a ``bus.link.channel.Channel``."""

    @property
    def clock(self) -> Clock:
        """The clock of the frames' stamps."""

    @property
    def name(self) -> str:
        """The channel's name, for messages."""

    def overheard(self, ear: Callable[[CanFrame], None]) -> AbstractContextManager[None]:
        """Call ``ear`` for every received frame within the ``with`` block."""

    def check(self) -> None:
        """Raise AdapterError if the channel has failed."""

    def health(self) -> str:
        """Describe the channel's fault in words; empty if it has none."""


@dataclass(slots=True)
class NodeListener:
    """The frames received from one node ID; holds state.

    ``canopen`` counts the heartbeats of a CANopen node of this ID, ``extended`` counts the heartbeats of the 29-bit protocol.
    """

    channel: BootChannel
    node: int
    answer: float = _ANSWER  # s allowed for one answer
    beats: Heartbeats = field(default_factory=Heartbeats)
    stamps: list[tuple[float, bytes]] = field(default_factory=list)
    canopen: int = 0
    extended: int = 0
    _heard: deque[CanFrame] = field(default_factory=lambda: deque(maxlen=_KEPT))

    def hear(self, frame: CanFrame) -> None:
        """Store a frame. Runs in the receive thread."""
        self._heard.append(frame)

    def wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Listen for ``seconds``, or until ``until`` returns true; return the last result of ``until``. Blocks.

        Raises AdapterError if the channel has failed.
        """
        end = self.channel.clock.now() + seconds
        while not until() and self.channel.clock.now() < end:
            self._take_all()
            self.channel.clock.sleep(_TICK)
        self.channel.check()
        return until()

    @property
    def quickest(self) -> float:
        """The shortest time (s) between two heartbeats, as a busy computer delays some; infinite before the second heartbeat."""
        times = [stamp for stamp, _ in self.stamps]
        return min((after - before for before, after in pairwise(times)), default=math.inf)

    def ask(self, asking: Generator[ProbeFrame, CanFrame | None, T]) -> T:
        """Ask all questions of ``asking``, one after the other, and return its result; blocks for at most 0.1 s per question."""
        try:
            question = next(asking)
            while True:
                question = asking.send(self._answer(question))
        except StopIteration as end:
            return cast("T", end.value)

    def _answer(self, question: ProbeFrame) -> CanFrame | None:
        self._take_all()
        send(self.channel, question.frame)
        end = self.channel.clock.now() + self.answer
        while self.channel.clock.now() < end:
            for frame in self._take_all():
                if question.answered_by(frame):
                    return frame
            self.channel.clock.sleep(_TICK)
        return None

    def _take_all(self) -> list[CanFrame]:
        frames = [self._heard.popleft() for _ in range(len(self._heard))]
        for frame in frames:
            self._take(frame)
        return frames

    def _take(self, frame: CanFrame) -> None:
        self.extended += is_beat(frame)
        if frame.extended or frame.remote or frame.error:
            return
        self.canopen += frame.can_id == cob.HEARTBEAT + self.node and len(frame.data) == 1
        if frame.can_id == can_id(self.node, COMMAND):
            seen = self.beats.after(self.node, frame.data)
            if isinstance(seen, Heartbeats):
                self.beats = seen
                self.stamps.append((frame.time, frame.data))
