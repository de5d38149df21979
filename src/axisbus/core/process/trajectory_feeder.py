"""Samples trajectories for the core, ahead of their use: the user's code runs in the program.

Theory of operation
-------------------
The first samples go with the command (``Sampler.head``), and are computed in the thread that gives it. Later the core sends
requests, and one thread answers for all trajectories of a machine: each in turn, for a short time, so that a slow one delays the
others no longer than that. A trajectory's samples are sent in order, each once. An exception of its code ends it, with the error
that ``CheckedTrajectory`` makes of it. If a core gets no answer, it brakes the axis along the samples that it has.
"""

from __future__ import annotations

import threading
import time
import weakref
from collections import deque
from collections.abc import Callable

from axisbus.errors import ArgumentError, AxisbusError
from axisbus.ipc import messages as m
from axisbus.motion.commands import FollowTrajectory
from axisbus.motion.moves.remote_trajectory import Streamed, StreamHead, following
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.path_limit_check import Ramped
from axisbus.motion.position_limits import LookaheadTrajectory
from axisbus.motion.trajectory import CheckedTrajectory, Trajectory
from axisbus.session import AnyCommand, Target

_TIME_SLICE = 0.01  # seconds for one trajectory before the next one's turn
_PATIENCE = 1.0  # seconds for the thread to end

Send = Callable[[int, int, tuple[float, ...]], None]
SendFailure = Callable[[int, AxisbusError], None]


class Sampler:
    """Computes the samples of one trajectory, in order; holds the number of the next (``next``) and its time."""

    def __init__(self, trajectory: Trajectory, step: float, name: str) -> None:
        """``step`` in seconds; ``name``: the axis.

        Raises:
            ArgumentError: the trajectory has no duration.
        """
        self._trajectory = CheckedTrajectory(trajectory, name)
        self._given = trajectory  # the original, for the facts known in advance
        self._name = name
        self._step = step
        self._time = 0.0
        self.next = 0
        self.over = False

    def head(self, seconds: float) -> StreamHead:
        """Return the head of the trajectory, with the samples of its first ``seconds``: once, before any other.

        Raises:
            ArgumentError: the trajectory gives no position, or one of its facts is no number.
        """
        assert not self.next
        known, span, speed, highest_acceleration = self._given, None, None, None
        if isinstance(known, LookaheadTrajectory):
            low, high = known.span
            span, speed = (
                (self._checked_number(low, "span"), self._checked_number(high, "span")),
                self._checked_number(known.top_speed, "top_speed"),
            )
        if isinstance(known, Ramped):
            highest_acceleration = self._checked_number(known.top_acceleration, "top_acceleration")
        positions = self.take(int(max(seconds, 0.0) / self._step) + 1)
        return StreamHead(self._trajectory.duration, self._step, positions, span, speed, highest_acceleration)

    def take(self, count: int, may_continue: Callable[[], bool] = lambda: True) -> tuple[float, ...]:
        """Return the next samples: at most ``count``, up to the end, and while ``may_continue()`` is true; at least one.

        Raises:
            ArgumentError: the trajectory gives no position.
        """
        positions: list[float] = []
        while len(positions) < count and not self.over and (not positions or may_continue()):
            positions.append(self._trajectory.position(self._time))
            self._continue()
        return tuple(positions)

    def _continue(self) -> None:
        duration = self._trajectory.duration
        self.over = self._time >= duration
        self._time = following(self._time, self._step, duration)
        self.next += 1

    def _checked_number(self, value: object, what: str) -> float:
        found = number(value)
        if found is None:
            raise ArgumentError(
                f"{self._name}: the trajectory returned no {what}",
                observed=f"it returned {short_repr(value)}",
                remedy=f"correct its {what}, or leave it out",
            )
        return found


class _FedTrajectory:
    """One trajectory: its samples, and the number up to which they were requested."""

    def __init__(self, sampler: Sampler) -> None:
        self.sampler = sampler
        self.requested = sampler.next

    @property
    def has_requests(self) -> bool:
        return self.sampler.next < self.requested and not self.sampler.over


class Feeder:
    """Answers the core's requests for active trajectories; holds them, and a thread (started with the first request).

    All methods may be called in any thread, and none calls a program's code.
    """

    def __init__(
        self, send: Send, send_failure: SendFailure, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """``send(number, first, positions)`` and ``send_failure(number, error)`` are called in the thread.

        If one of them raises, this trajectory gets no more samples: the connection to its core is gone, and the core brakes the
        axis.
        """
        self._send = send
        self._send_failure = send_failure
        self._clock = clock
        self._changed = threading.Condition()
        self._trajectories: dict[int, _FedTrajectory] = {}
        self._queue: deque[int] = deque()
        self._closed = False
        self._thread: threading.Thread | None = None

    def add(self, number: int, sampler: Sampler) -> None:
        """Add a trajectory, by the ``number`` of its command, before the command is given; its head is sent with the command."""
        with self._changed:
            if not sampler.over and not self._closed:
                self._trajectories[number] = _FedTrajectory(sampler)

    def request(self, number: int, first: int, count: int) -> None:
        """Request the samples up to number ``first + count - 1``; ignored for an unknown trajectory. Does not block."""
        with self._changed:
            trajectory = self._trajectories.get(number)
            if trajectory is None:
                return
            trajectory.requested = max(trajectory.requested, first + count)
            if trajectory.has_requests and number not in self._queue:
                self._queue.append(number)
                self._start()
                self._changed.notify()

    def drop(self, number: int) -> None:
        """Drop a trajectory, because its command has ended. An unknown number is ignored."""
        with self._changed:
            self._trajectories.pop(number, None)

    def close(self) -> None:
        """Drop all, and end the thread. Blocks up to 1 s if a trajectory's code does not return."""
        with self._changed:
            self._closed = True
            self._trajectories.clear()
            self._queue.clear()
            self._changed.notify_all()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(_PATIENCE)

    def disown(self) -> None:
        """Do nothing any more, in a forked child: neither the thread nor the holder of the lock runs there."""
        self._changed = threading.Condition()
        self._closed = True
        self._thread = None
        self._trajectories, self._queue = {}, deque()

    # -- the thread --------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        if self._thread is None and not self._closed:
            self._thread = threading.Thread(target=self._run, name="axisbus trajectories", daemon=True)
            self._thread.start()

    def _run(self) -> None:
        while (queued := self._next()) is not None:
            number, trajectory = queued
            try:
                self._serve(number, trajectory)
            except Exception:  # noqa: BLE001  # the error cannot be sent: the core brakes the axis and reports why
                self.drop(number)

    def _next(self) -> tuple[int, _FedTrajectory] | None:
        """Wait for the next turn; None when there will be none."""
        with self._changed:
            while not self._closed:
                while self._queue:
                    number = self._queue.popleft()
                    trajectory = self._trajectories.get(number)
                    if trajectory is not None and trajectory.has_requests:
                        return number, trajectory
                self._changed.wait()
        return None

    def _serve(self, number: int, trajectory: _FedTrajectory) -> None:
        first, end = trajectory.sampler.next, self._clock() + _TIME_SLICE
        try:
            positions = trajectory.sampler.take(trajectory.requested - first, lambda: self._clock() < end)
        except AxisbusError as error:
            if self._is_active(number, trajectory):
                self.drop(number)
                self._send_failure(number, error)
            return
        if self._is_active(number, trajectory):
            self._send(number, first, positions)
            self._continue(number, trajectory)

    def _is_active(self, number: int, trajectory: _FedTrajectory) -> bool:
        """Whether it has not been dropped meanwhile."""
        return self._trajectories.get(number) is trajectory

    def _continue(self, number: int, trajectory: _FedTrajectory) -> None:
        """Give a trajectory with further requests its next turn, after the others; drop one that is over."""
        with self._changed:
            if trajectory.sampler.over:
                self._trajectories.pop(number, None)
            elif trajectory.has_requests and number not in self._queue:
                self._queue.append(number)


# -- The trajectories that a core follows: ``Streams`` in the core, ``Trajectories`` in the program ------------------------

_HEAD_SECONDS = 2.0  # seconds of a trajectory that are sent with its command


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

    def poll(self) -> None:
        """Request the samples needed next, and drop trajectories that are no longer followed; called every few milliseconds."""
        for key in list(self._found):
            stream = self._stream(key)
            if stream is None:
                del self._found[key]
                self._send(m.StreamOver(key))
                continue
            while (wanted := stream.wanted(stream.reached)) is not None:
                self._send(m.WantSamples(key, *wanted))

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
        head = sampler.head(_HEAD_SECONDS)
        self._last += 1
        self.feeder.add(self._last, sampler)
        return m.Submit(number, target, FollowTrajectory(head), name, self._last)  # type: ignore[arg-type]  # crosses in its place
