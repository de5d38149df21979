"""The trajectories that a core follows for its program: it makes trajectories from their heads, and requests samples in time."""

from __future__ import annotations

import weakref
from collections.abc import Callable

from axisbus.core.process.trajectory_feeder import Feeder, Sampler
from axisbus.errors import ArgumentError
from axisbus.ipc import messages as m
from axisbus.motion.commands import FollowTrajectory
from axisbus.motion.moves.remote_trajectory import Streamed, StreamHead
from axisbus.session import AnyCommand, Target

_HEAD = 2.0  # seconds of a trajectory that are sent with its command


class Streams:
    """In the core: the active trajectories by their numbers, while they are followed."""

    def __init__(self, send: Callable[[m.Message], None]) -> None:
        self._send = send
        self._found: dict[int, weakref.ref[Streamed]] = {}

    def take(self, submit: m.Submit) -> AnyCommand:
        """Return the command, with the trajectory that its head begins; raises ArgumentError for an invalid head."""
        command = submit.command
        if not isinstance(command, FollowTrajectory):
            return command
        assert isinstance(command.trajectory, StreamHead)
        stream = Streamed(command.trajectory)
        self._found[submit.stream] = weakref.ref(stream)
        return FollowTrajectory(stream)

    def feed(self, samples: m.TrajectorySamples) -> None:
        """Add samples to their trajectory; if they do not fit, it ends."""
        stream = self._stream(samples.stream)
        if stream is None:
            return
        try:
            stream.feed(samples.first, samples.positions)
        except ArgumentError as error:
            stream.fail(error)

    def fail(self, told: m.NoSamples) -> None:
        """End a trajectory whose code has failed."""
        stream = self._stream(told.stream)
        if stream is not None:
            stream.fail(told.error)

    def look(self) -> None:
        """Request the samples needed next, and drop trajectories that are no longer followed; called every few milliseconds."""
        for number in list(self._found):
            stream = self._stream(number)
            if stream is None:
                del self._found[number]
                self._send(m.StreamOver(number))
                continue
            while (wanted := stream.wanted(stream.reached)) is not None:
                self._send(m.WantSamples(number, *wanted))

    def _stream(self, number: int) -> Streamed | None:
        found = self._found.get(number)
        return None if found is None else found()


class Trajectories:
    """In the program: the trajectories that its core follows; holds the last number."""

    def __init__(self, send: Callable[[m.Message], None], period: float) -> None:
        """``period``: of the scan, in seconds."""
        self._period = period
        self._last = 0
        self.feeder = Feeder(
            lambda number, first, positions: send(m.TrajectorySamples(number, first, positions)),
            lambda number, error: send(m.NoSamples(number, error)),
        )

    def submit(self, number: int, target: Target, command: AnyCommand, name: str) -> m.Submit:
        """Return the message of a command, with the head of its trajectory; the further samples are sent on request.

        Raises:
            ArgumentError: the trajectory gives no position.
        """
        if not isinstance(command, FollowTrajectory):
            return m.Submit(number, target, command, name)
        sampler = Sampler(command.trajectory, self._period, str(target))
        head = sampler.head(_HEAD)
        self._last += 1
        self.feeder.add(self._last, sampler)
        return m.Submit(number, target, FollowTrajectory(head), name, self._last)  # type: ignore[arg-type]  # crosses in its place
