"""A wire between a program that samples its trajectory and an axis of a rig that follows it; in virtual time, late as wanted."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from axisbus.core.process.trajectory_feeder import Sampler
from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle
from axisbus.motion import commands as c
from axisbus.motion.moves.remote_trajectory import Streamed
from kit.motion.rig import PERIOD, Rig

NEVER = 1e9


class Wire:
    """Feeds one trajectory; the answer to a request at the time ``t`` of the axis takes ``delay(t)`` seconds."""

    def __init__(
        self,
        rig: Rig,
        trajectory,
        *,
        first: float = 0.5,
        delay: Callable[[float], float] = lambda _: 0.0,
        name: str = "x",
    ) -> None:
        self.rig = rig
        self.name = name
        self.delay = delay
        self._sampler = Sampler(trajectory, PERIOD, name)
        self.stream = Streamed(self._sampler.head(first))
        self._asked: deque[tuple[float, int, int]] = deque()
        wait_until = rig.cycle.wait_until

        def fed_wait(t: float) -> None:
            wait_until(t)
            self._turn(rig.cycle.now())

        rig.cycle.wait_until = fed_wait

    def follow(self) -> Handle:
        """Let the axis follow the stream."""
        return self.rig.axes[self.name]._submit("follow", c.FollowTrajectory(self.stream))

    def _turn(self, now: float) -> None:
        asked = self.stream.wanted(self.stream.reached)
        if asked is not None:
            after = self._asked[-1][0] if self._asked else now
            self._asked.append((max(after, now + self.delay(self.stream.reached)), *asked))
        while self._asked and self._asked[0][0] <= now:
            self._answer(*self._asked.popleft()[1:])

    def _answer(self, first: int, count: int) -> None:
        try:
            positions = self._sampler.take(count)
        except AxisbusError as error:
            self._asked.clear()
            self.stream.fail(error)
        else:
            assert len(positions) == count
            self.stream.feed(first, positions)
