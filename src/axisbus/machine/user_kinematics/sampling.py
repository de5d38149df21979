"""Convert segments of a path in a workspace to the axes' positions along it, with the user's own kinematics.

Theory of operation
-------------------
Along each segment the inverse is called at equal distances and in the middle between, each time near its previous answer. Five
neighbours give slope and curvature of every axis at a sample. If two segments join without a stop, both get the mean of their
values there. Then the polynomials between the samples are checked against the path: at a quarter, the middle and three quarters of
each interval, ``forward`` of the axes' positions must be within the allowed deviation from the path. If not, the segment is sampled
twice as finely. If no resolution is enough, the inverse jumps: to another solution, or where an axis has to turn too fast.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

from axisbus.errors import ArgumentError, AxisbusError, LimitError
from axisbus.machine.user_kinematics.kinematics import UserKinematicsAdapter, listed, prefixed
from axisbus.motion.group.sampled_segment import Row, SampledSegment, sampled_segment_of
from axisbus.motion.group.segments import Coordinates, Corner, GeometricSegment, Straight
from axisbus.motion.point_stream.curve_fit import Motion, at, coefficients, controls, reach
from axisbus.wording import counted

_LINE, _CORNER, _ROUND = 2, 8, 32  # intervals to begin with: of a line, of a corner, of a whole circle
_FINEST = 1024  # intervals of a segment
_MOST = 16_384  # of a path: it is sent to the core at once
_CHECKED = (0.25, 0.5, 0.75)
# Weights for five values at equal distances: slope and curvature at the first, the second, and the middle value (times the
# distance, and its square). At the last two values the weights are those of the first two, reversed.
_SLOPE_WEIGHTS = (
    (-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25),
    (-0.25, -5.0 / 6.0, 1.5, -0.5, 1.0 / 12.0),
    (1.0 / 12.0, -2.0 / 3.0, 0.0, 2.0 / 3.0, -1.0 / 12.0),
)
_CURVATURE_WEIGHTS = (
    (35.0 / 12.0, -26.0 / 3.0, 9.5, -14.0 / 3.0, 11.0 / 12.0),
    (11.0 / 12.0, -5.0 / 3.0, 0.5, 1.0 / 3.0, -1.0 / 12.0),
    (-1.0 / 12.0, 4.0 / 3.0, -2.5, 4.0 / 3.0, -1.0 / 12.0),
)


class _Worst(NamedTuple):
    """The largest deviation of a segment from its path, as a fraction of the allowed deviation there."""

    share: float
    interval: int
    off: float


class Sampling:
    """Converts a path in a workspace to the axes' motion; holds the samples of each segment."""

    def __init__(
        self,
        own: UserKinematicsAdapter,
        segments: Sequence[GeometricSegment],
        stops: Collection[int],
        start: Coordinates,
        text: str,
    ) -> None:
        """``start``: the axes' positions in their units; ``stops``: segments with a stop after them; ``text``: for messages."""
        self._own = own
        self._segments = tuple(segments)
        self._stops = stops
        self._text = text
        self._start = start
        self._counts = [_intervals(segment) for segment in segments]
        self._found: list[list[Row]] = [[] for _ in segments]  # results of the inverse
        self._rows: list[list[Row]] = []  # the same after smoothing at the transitions
        self._to_sample = set(range(len(self._segments)))  # segments to be sampled again

    def sampled_segments(self) -> list[SampledSegment]:
        """Return the segments as paths of the axes.

        Raises:
            LimitError: a position is out of reach, or an axis would leave its position limits or would have to jump.
            ArgumentError: the kinematics failed, or forward and inverse do not belong together.
        """
        try:
            self._refine()
        except AxisbusError as error:
            raise prefixed(self._text, error) from error
        parts = zip(self._segments, self._rows, strict=True)
        return [
            sampled_segment_of(segment.length, rows, segment.curvatures(len(rows) - 1))
            for segment, rows in parts
        ]

    def _refine(self) -> None:
        self._require_begin()
        while self._to_sample:
            self._require_few()
            for number in sorted(self._to_sample):
                self._found[number] = self._sampled(number)
            self._smooth()
            changed = {number + beside for number in self._to_sample for beside in (-1, 0, 1)}
            self._to_sample = {
                number for number in changed & set(range(len(self._segments))) if self._is_rough(number)
            }
        self._require_within_limits()

    def _require_begin(self) -> None:
        """Check that at the beginning of the path the inverse returns the axes' present positions."""
        coordinates = self._segments[0].at(0.0)
        off = self._own.is_same(self._own.inverse(coordinates, self._start), self._start)
        if off:
            raise ArgumentError(
                f"{self._own.name}.inverse returns other positions than the present positions of the axes",
                observed=f"at {listed(coordinates)} {off}",
                remedy="inverse must return the solution that is nearest to near; nothing has moved",
            )

    def _sampled(self, number: int) -> list[Row]:
        """Return the samples of a segment, each near the previous one, beginning at the end of the previous segment."""
        segment, count = self._segments[number], 2 * self._counts[number]
        near = self._start if number == 0 else _axis_positions(self._found[number - 1][-1])
        found = []
        for n in range(count + 1):
            coordinates = segment.at(segment.length * n / count)
            if n or not number or not segment.length:
                near = self._own.inverse(coordinates, near)
            self._own.require_fit(coordinates, near)
            found.append(near)
        return [_motion(found, n, segment.length / count) for n in range(0, count + 1, 2)]

    def _smooth(self) -> None:
        """Make the motion of two segments equal at a transition without a stop."""
        self._rows = [list(rows) for rows in self._found]
        for number in range(len(self._segments) - 1):
            if (
                number in self._stops
                or not self._segments[number].length
                or not self._segments[number + 1].length
            ):
                continue
            before, behind = self._rows[number], self._rows[number + 1]
            before[-1] = behind[0] = tuple(map(_mean, before[-1], behind[0]))

    def _is_rough(self, number: int) -> bool:
        """Whether a segment must be sampled more finely; doubles its intervals then. Raise if that cannot help."""
        worst = self._worst(number)
        if worst.share <= 1.0:
            return False
        self._counts[number] *= 2
        if self._counts[number] > _FINEST:
            raise self._jump_error(number, worst)
        return True

    def _require_few(self) -> None:
        """Raise LimitError if so many samples are needed that they would delay the core's cycles."""
        if sum(self._counts) > _MOST:
            raise LimitError(
                f"the path needs more than {_MOST} samples",
                observed=f"it has {counted(len(self._segments), 'line or corner', 'lines and corners')}",
                remedy="give it in parts, each waiting for the previous part (buffer=True), or give accuracy = ...; nothing "
                "has moved",
            )

    def _worst(self, number: int) -> _Worst:
        segment, rows = self._segments[number], self._rows[number]
        step = segment.length / (len(rows) - 1)
        worst = _Worst(0.0, 0, 0.0)
        for n in range(len(rows) - 1 if step else 0):
            curves = [coefficients(a, b, step) for a, b in zip(rows[n], rows[n + 1], strict=True)]
            for part in _CHECKED:
                joints = tuple(at(curve, part * step) for curve in curves)
                found = self._own.forward(joints)
                off = math.dist(found, segment.at((n + part) * step))
                share = off / (self._own.allowed(joints, found) or math.inf)
                worst = max(worst, _Worst(share, n, off))
        return worst

    def _jump_error(self, number: int, worst: _Worst) -> LimitError:
        segment, rows, n = self._segments[number], self._rows[number], worst.interval
        step = segment.length / (len(rows) - 1)
        before, behind = _axis_positions(rows[n]), _axis_positions(rows[n + 1])
        name, a, b = max(
            zip(self._own.axes, before, behind, strict=True), key=lambda one: abs(one[2] - one[1])
        )
        return LimitError(
            f"near {listed(segment.at(n * step))} {name} must jump",
            observed=f"from {a:.6g} to {b:.6g} within {step:.3g} of the path: with {len(rows)} samples of this segment, the "
            f"tool would still be {worst.off:.3g} off",
            remedy=f"{self._own.name}.inverse must return the solution that is nearest to near; or choose a path farther "
            "from positions with stretched or folded arms, or give accuracy = ...; nothing has moved",
        )

    def _require_within_limits(self) -> None:
        limits = self._own.limits(self._start)
        for segment, rows in zip(self._segments, self._rows, strict=True):
            step = segment.length / (len(rows) - 1)
            for n in range(len(rows) - 1):
                self._require_interval(limits, segment.at(n * step), rows[n], rows[n + 1], step)

    @staticmethod
    def _require_interval(
        limits: Sequence[tuple[str, str, tuple[float, float] | None]],
        coordinates: Coordinates,
        begin: Row,
        end: Row,
        step: float,
    ) -> None:
        """Raise LimitError if an axis leaves its position limits between two samples."""
        for (name, unit, allowed), a, b in zip(limits, begin, end, strict=True):
            line = controls(a, b, step) if step else (a.position, b.position)
            if allowed is None or allowed[0] <= min(line) <= max(line) <= allowed[1]:
                continue
            low, high = reach(line)
            if not allowed[0] <= low <= high <= allowed[1]:
                beyond = low if low < allowed[0] else high
                raise LimitError(
                    f"the path leaves the position limits of {name} near {listed(coordinates)}",
                    observed=f"{name} must be at {beyond:.6g} {unit}; the allowed range is {allowed[0]:g} to {allowed[1]:g}",
                    remedy=f"choose another path, or change position_limits in [axes.{name}] of cell.toml; nothing has moved",
                )


def _intervals(segment: GeometricSegment) -> int:
    """Return the initial number of intervals of a segment."""
    if isinstance(segment, Straight):
        return _LINE
    return (
        _CORNER if isinstance(segment, Corner) else max(_LINE, math.ceil(_ROUND * segment.angle / math.tau))
    )


def _motion(samples: Sequence[Coordinates], n: int, apart: float) -> Row:
    """Return the axes' motion at one of ``samples``, at least five, which are ``apart`` from each other on the path."""
    last = len(samples) - 1
    if not apart:
        return tuple(Motion(value, 0.0, 0.0) for value in samples[n])
    behind = n if n < 2 else (last - n if last - n < 2 else 2)
    turned = n > last - 2  # reversed, from the end
    first = last - 4 if turned else max(n - 2, 0)
    near = samples[first : first + 5][::-1] if turned else samples[first : first + 5]
    sign = -1.0 if turned else 1.0
    return tuple(
        Motion(
            samples[n][axis],
            sign
            * sum(w * coordinates[axis] for w, coordinates in zip(_SLOPE_WEIGHTS[behind], near, strict=True))
            / apart,
            sum(
                w * coordinates[axis] for w, coordinates in zip(_CURVATURE_WEIGHTS[behind], near, strict=True)
            )
            / apart**2,
        )
        for axis in range(len(samples[n]))
    )


def _axis_positions(row: Row) -> Coordinates:
    return tuple(motion.position for motion in row)


def _mean(a: Motion, b: Motion) -> Motion:
    return Motion(*(0.5 * (p + q) for p, q in zip(a, b, strict=True)))
