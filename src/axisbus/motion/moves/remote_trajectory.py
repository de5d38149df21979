"""A trajectory that arrives in samples, ahead of its use, from a program other than the scan's.

Theory of operation
-------------------
The user's code runs in the user's program. From it arrive a head (``StreamHead``), and then the requested samples (``wanted``), one
for each executed cycle. The times of the samples are computed as ``PathClock`` computes the times of the cycles, so that the
targets are those of the trajectory itself. A braking axis needs positions between the samples; they are interpolated (``Curve``).

An axis does not begin before enough of the path is known. Then, in each cycle, the known part must suffice to continue for one more
period and to come to rest within it: braking from a speed v with a deceleration a takes at most v/a of the path's time (see
``lookahead``, which looks as far ahead plus one period). If the known part does not suffice, or the program has failed, the axis
brakes along the known part and comes to rest on its path.

``feed`` and ``fail`` are called by one other thread than the scan's. Each of them replaces one immutable value, and the scan reads
this value once in each call. So no lock is needed, and no thread waits.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from axisbus.errors import ArgumentError, AxisbusError, CommandError
from axisbus.motion.numbers import number, short_repr

_BUSY = 2.0  # seconds that a program may be busy with something else
_HEADSTART = 1.0  # seconds, beyond the braking time, that are known before the axis begins
_MARGIN = 6  # periods: one passes, braking and the look-ahead end in the next, the rest is spare
_STORED_BEHIND = 16  # samples that are stored behind the axis
_CHUNK = 0.25  # seconds in a chunk
_SMALLEST, _LARGEST = 16, 256  # samples in a chunk


_REMEDY = (
    "make position(t) faster, and find out why the program's other threads do not run (a long call into a library, a "
    "debugger, a busy computer)"
)


@dataclass(frozen=True, slots=True)
class StreamHead:
    """The properties of a trajectory before it begins, with its first samples (``positions``, from time 0 on).

    ``duration`` and ``step`` (the scan's period) in seconds. ``span`` with ``top_speed``, and ``top_acceleration``, are None if the
    trajectory itself does not provide them (``lookahead.LookaheadTrajectory``, ``path_limit_check.Ramped``).
    """

    duration: float
    step: float
    positions: tuple[float, ...]
    span: tuple[float, float] | None = None
    top_speed: float | None = None
    top_acceleration: float | None = None


class Streamed:
    """A trajectory made of a head and of samples; stores the samples from a little before ``reached`` (seconds) on.

    It has the attributes ``span``, ``top_speed`` and ``top_acceleration`` only if its head has them.
    """

    span: tuple[float, float]
    top_speed: float
    top_acceleration: float

    def __init__(self, head: StreamHead) -> None:
        """Take the head.

        Raises:
            ArgumentError: it contains a value that is not a number, no sample, or more samples than the trajectory has.
        """
        _require_numbers((head.duration, head.step, *head.positions))
        if head.step <= 0 or not head.positions:
            raise ArgumentError("the head of a trajectory needs a sample and a positive step")
        self.duration = head.duration
        self.reached = 0.0
        self._deceleration: float | None = None
        self._failure: AxisbusError | None = None
        self._waits_since: float | None = None
        self._may_begin = False
        self._set_known_properties(head)
        self._curve = Curve(head.step, 0, (0.0,), head.positions[:1], head.span)
        self._fastest = 0.0
        self._highest_rate = 1.0  # the highest rate of its time so far: an override
        self._asked = len(head.positions)
        self.feed(1, head.positions[1:])
        self._asked_until = self._curve.times[-1]

    # -- the trajectory ----------------------------------------------------------------------------------------------

    @property
    def known_until(self) -> float:
        """The time in seconds up to which the path is known, and no further sample changes it."""
        return _known(self._curve, self.duration)

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds; before the start and after the end, the end positions.

        Raises:
            CommandError: the position is not known yet, or no longer stored.
        """
        curve, t = self._curve, max(t, 0.0)
        until = _known(curve, self.duration)
        if t >= self.duration <= until:
            return curve.positions[-1]
        since = curve.times[BEHIND if curve.first else 0]
        if not since <= t <= until:
            raise CommandError(
                f"position at {t:.3f} s is not known",
                observed=f"it is known from {since:.3f} to {until:.3f} s",
            )
        return curve.at(t)

    # -- its program, in another thread --------------------------------------------------------------------------------

    def feed(self, first: int, positions: Sequence[float]) -> None:
        """Add the samples from number ``first`` on.

        Raises:
            ArgumentError: they do not continue the known samples, are more than requested, or are not numbers; none is taken.
        """
        curve, asked = self._curve, self._asked
        if first != curve.after or first + len(positions) > asked:
            raise ArgumentError(
                "samples of a trajectory came that were not requested",
                observed=f"numbers {first} to {first + len(positions) - 1}; expected were {curve.after} to {asked - 1}",
            )
        _require_numbers(positions)
        times = self._times_after(curve.times[-1], len(positions))
        if len(times) < len(positions):
            raise ArgumentError("a trajectory has more samples than its duration allows")
        pairs = pairwise((curve.positions[-1], *positions))
        self._fastest = max(self._fastest, max((abs(b - a) for a, b in pairs), default=0.0) / self._step)
        self._curve = curve.joined(times, positions).without(self.reached, _STORED_BEHIND)

    def fail(self, error: AxisbusError) -> None:
        """End the trajectory with ``error``: no more samples will arrive. The first error counts."""
        self._failure = self._failure or error

    # -- requests to its program -----------------------------------------------------------------------------------------

    def wanted(self, t: float) -> tuple[int, int] | None:
        """Return the samples to request now, with the axis at ``t``: the first number, and the count; None if none are needed.

        The returned samples count as requested.
        """
        if self._failure is not None or self._asked_until >= self.duration:
            return None
        if self._asked_until > t + _BUSY + self._needed_ahead:
            return None
        left, chunk = (self.duration - self._asked_until) / self._step, self._chunk
        times = self._times_after(self._asked_until, chunk if left > 1.5 * chunk else 2 * chunk)
        asked = self._asked, len(times)
        self._asked, self._asked_until = self._asked + len(times), times[-1]
        return asked

    # -- the axis, in the scan -------------------------------------------------------------------------------------------

    def brakes_with(self, deceleration: float | None, period: float) -> None:
        """Set the axis's deceleration along a path (unit/s², None: it cannot brake), and the scan's period in seconds.

        Raises:
            ArgumentError: there is not one sample for each cycle.
        """
        if period != self._step:
            raise ArgumentError(
                "the samples of a trajectory do not match the scan",
                observed=f"their step is {self._step:g} s, the scan's period {period:g} s",
            )
        self._deceleration = deceleration

    def ready(self, now: float, name: str) -> bool:
        """Return whether enough is known for the axis ``name`` to begin, at ``now`` (s, monotonic); once True, it stays True.

        Raises:
            AxisbusError: its program has failed, or did not send enough in time.
        """
        if self._failure is not None:
            raise self._failure
        self._waits_since = now if self._waits_since is None else self._waits_since
        enough = self.known_until >= min(self.duration, self._needed_ahead + _HEADSTART)
        self._may_begin = self._may_begin or enough
        if not self._may_begin and now - self._waits_since > _BUSY:
            raise self._late(name, "it has not begun", "nothing has moved")
        return self._may_begin

    def shortage(self, t: float, name: str, rate: float = 1.0) -> AxisbusError | None:
        """Return why the axis ``name``, at ``t``, must brake now to come to rest within the known path; None if it may continue.

        ``rate``: the rate of time along the path.
        """
        self.reached = t
        self._highest_rate = highest_rate = max(self._highest_rate, rate)
        if self._failure is not None:
            return self._failure
        until = self.known_until
        if until >= self.duration:
            return None
        margin = _MARGIN * self._step * highest_rate
        speed = abs(self.position(t + self._step) - self.position(t)) / self._step
        if until >= t + margin + self._braking(speed) * highest_rate * highest_rate:
            return None
        how = "braked along it" if self._deceleration else "stopped"
        return self._late(name, f"the axis is at {t:.3f} s of it", f"the axis was {how}")

    # -- helpers ---------------------------------------------------------------------------------------------------------

    @property
    def _step(self) -> float:
        return self._curve.step

    @property
    def _chunk(self) -> int:
        return min(max(round(_CHUNK / self._step), _SMALLEST), _LARGEST)

    @property
    def _needed_ahead(self) -> float:
        """The time of the path in seconds that must be known ahead of the axis at its highest speed."""
        return self._highest_rate * (_MARGIN * self._step + self._highest_rate * self._braking(self._fastest))

    def _braking(self, speed: float) -> float:
        return speed / self._deceleration if self._deceleration else 0.0

    def _times_after(self, t: float, count: int) -> list[float]:
        """Return the times of at most ``count`` samples after that of ``t``; none after the end."""
        times: list[float] = []
        while len(times) < count and t < self.duration:
            t = following(t, self._step, self.duration)
            times.append(t)
        return times

    def _set_known_properties(self, head: StreamHead) -> None:
        """Set an attribute only if the head has it: checks for ``LookaheadTrajectory`` and ``Ramped`` test the attributes."""
        if head.span is not None and head.top_speed is not None:
            _require_numbers((*head.span, head.top_speed))
            self.span, self.top_speed = head.span, head.top_speed
        if head.top_acceleration is not None:
            _require_numbers((head.top_acceleration,))
            self.top_acceleration = head.top_acceleration

    def _late(self, name: str, where: str, how: str) -> CommandError:
        curve = self._curve
        known = f"known of it are {curve.times[0]:.3f} to {self.known_until:.3f} s of {self.duration:.3f} s"
        return CommandError(
            f"{name}: the program did not send its trajectory in time",
            observed=f"{where}, {known}",
            remedy=f"{_REMEDY}; {how}",
        )


def _known(curve: Curve, duration: float) -> float:
    """Return the time up to which a curve is final: all of it, or as far as it does not depend on the next sample."""
    if curve.times[-1] >= duration:
        return duration
    return curve.times[max(len(curve.times) - 1 - AHEAD, 0)]


def _require_numbers(values: Sequence[object]) -> None:
    for value in values:
        if number(value) is None:
            raise ArgumentError("a trajectory needs finite numbers", observed=f"it gave {short_repr(value)}")


# -- A smooth curve through the samples of a path ----------------------------------------------------------------------
#
# Theory of operation
# At the time of a sample the curve is exactly that sample. Between two samples it is the cubic with the speeds at both ends. The
# speed at a sample is that of the parabola through it and its neighbours: straight lines and constant accelerations are reproduced
# exactly, and the speed never jumps. The path rests at its beginning, at its end, and in two or more intervals without motion in a
# row. There the speed is 0, and the curve does not overshoot the position of rest.


BEHIND = AHEAD = 2  # samples before and after an interval that determine the curve within it
_SAME = 1e-6  # share of a step within which two times count as equal, because of rounding


def following(t: float, step: float, duration: float) -> float:
    """Return the time of the sample after ``t``: steps are added one by one, as in the scan; the last one is ``duration``."""
    return t + step if t + step < duration else duration


@dataclass(frozen=True, slots=True)
class Curve:
    """Samples ``step`` seconds apart (the last interval may be shorter); the first one has the number ``first``.

    ``times`` in seconds, as many as ``positions``, at least one. ``span``: the lowest and the highest position of the path if they
    are known: the curve between samples does not exceed them.
    """

    step: float
    first: int
    times: tuple[float, ...]
    positions: tuple[float, ...]
    span: tuple[float, float] | None = None

    @property
    def after(self) -> int:
        """The number of the sample after the last."""
        return self.first + len(self.times)

    def joined(self, times: Sequence[float], positions: Sequence[float]) -> Curve:
        """Return the curve with more samples at its end."""
        return Curve(self.step, self.first, (*self.times, *times), (*self.positions, *positions), self.span)

    def without(self, t: float, behind: int) -> Curve:
        """Return the curve without the samples that are more than ``behind`` samples before ``t``."""
        passed = bisect_right(self.times, t) - 1 - behind
        if passed <= 0:
            return self
        return Curve(self.step, self.first + passed, self.times[passed:], self.positions[passed:], self.span)

    def at(self, t: float) -> float:
        """Return the position at ``t``, which must lie between the first and the last time."""
        index = bisect_right(self.times, t) - 1
        begin, here = self.times[index], self.positions[index]
        if t == begin:
            return here
        width, distance = self.times[index + 1] - begin, self.positions[index + 1] - here
        share, enter, leave = (t - begin) / width, self._speed(index), self._speed(index + 1)
        left = 1.0 - share
        bend = left * (enter * width - distance) - share * (leave * width - distance)
        passed = share * (distance + left * bend)
        if not enter or not leave:  # at rest at one end
            passed = min(max(passed, min(distance, 0.0)), max(distance, 0.0))
        if self.span is None:
            return here + passed
        return min(max(here + passed, self.span[0]), self.span[1])

    def _speed(self, index: int) -> float:
        """Return the signed speed at a sample."""
        before, after = self._slope(index - 1), self._slope(index)
        if not before and not self._slope(index - 2):
            return 0.0
        if not after and not self._slope(index + 1):
            return 0.0
        earlier, later = self._time(index) - self._time(index - 1), self._time(index + 1) - self._time(index)
        return (later * before + earlier * after) / (earlier + later)

    def _slope(self, index: int) -> float:
        """Return the mean speed between a sample and the next one; 0 beyond the ends, where a path rests."""
        within = 0 <= index < len(self.times) - 1
        width = self.times[index + 1] - self.times[index] if within else 0.0
        if width <= _SAME * self.step:
            return 0.0
        return (self.positions[index + 1] - self.positions[index]) / width

    def _time(self, index: int) -> float:
        return self.times[min(max(index, 0), len(self.times) - 1)]
