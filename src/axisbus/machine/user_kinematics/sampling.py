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
from axisbus.machine.user_kinematics.kinematics import UserKinematicsAdapter, listed, said
from axisbus.motion.group.sampled_segment import Row, SampledSegment, tabled
from axisbus.motion.group.segments import Corner, Piece, Place, Straight
from axisbus.motion.point_stream.curve_fit import Motion, at, coefficients, controls, reach
from axisbus.wording import counted

_LINE, _CORNER, _ROUND = 2, 8, 32  # intervals to begin with: of a line, of a corner, of a whole circle
_FINEST = 1024  # intervals of a segment
_MOST = 16_384  # of a path: it is sent to the core at once
_CHECKED = (0.25, 0.5, 0.75)
# Weights for five values at equal distances: slope and curvature at the first, the second, and the middle value (times the
# distance, and its square). At the last two values the weights are those of the first two, reversed.
_SLOPES = (
    (-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25),
    (-0.25, -5.0 / 6.0, 1.5, -0.5, 1.0 / 12.0),
    (1.0 / 12.0, -2.0 / 3.0, 0.0, 2.0 / 3.0, -1.0 / 12.0),
)
_BENDS = (
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
        pieces: Sequence[Piece],
        stops: Collection[int],
        start: Place,
        text: str,
    ) -> None:
        """``start``: the axes' positions in their units; ``stops``: segments with a stop after them; ``text``: for messages."""
        self._own = own
        self._pieces = tuple(pieces)
        self._stops = stops
        self._text = text
        self._start = start
        self._counts = [_intervals(piece) for piece in pieces]
        self._found: list[list[Row]] = [[] for _ in pieces]  # results of the inverse
        self._rows: list[list[Row]] = []  # the same after smoothing at the transitions
        self._old = set(range(len(self._pieces)))  # segments to be sampled again

    def tables(self) -> list[SampledSegment]:
        """Return the segments as paths of the axes.

        Raises:
            LimitError: a position is out of reach, or an axis would leave its position limits or would have to jump.
            ArgumentError: the kinematics failed, or forward and inverse do not belong together.
        """
        try:
            self._refine()
        except AxisbusError as error:
            raise said(self._text, error) from error
        parts = zip(self._pieces, self._rows, strict=True)
        return [tabled(piece.length, rows, piece.curvatures(len(rows) - 1)) for piece, rows in parts]

    def _refine(self) -> None:
        self._require_begin()
        while self._old:
            self._require_few()
            for number in sorted(self._old):
                self._found[number] = self._sampled(number)
            self._smooth()
            changed = {number + beside for number in self._old for beside in (-1, 0, 1)}
            self._old = {
                number for number in changed & set(range(len(self._pieces))) if self._is_rough(number)
            }
        self._require_room()

    def _require_begin(self) -> None:
        """Check that at the beginning of the path the inverse returns the axes' present positions."""
        place = self._pieces[0].at(0.0)
        off = self._own.is_same(self._own.inverse(place, self._start), self._start)
        if off:
            raise ArgumentError(
                f"{self._own.name}.inverse returns other positions than the present positions of the axes",
                observed=f"at {listed(place)} {off}",
                remedy="inverse must return the solution that is nearest to near; nothing has moved",
            )

    def _sampled(self, number: int) -> list[Row]:
        """Return the samples of a segment, each near the previous one, beginning at the end of the previous segment."""
        piece, count = self._pieces[number], 2 * self._counts[number]
        near = self._start if number == 0 else _places(self._found[number - 1][-1])
        found = []
        for n in range(count + 1):
            place = piece.at(piece.length * n / count)
            if n or not number or not piece.length:
                near = self._own.inverse(place, near)
            self._own.require_fit(place, near)
            found.append(near)
        return [_motion(found, n, piece.length / count) for n in range(0, count + 1, 2)]

    def _smooth(self) -> None:
        """Make the motion of two segments equal at a transition without a stop."""
        self._rows = [list(rows) for rows in self._found]
        for number in range(len(self._pieces) - 1):
            if (
                number in self._stops
                or not self._pieces[number].length
                or not self._pieces[number + 1].length
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
            raise self._leap(number, worst)
        return True

    def _require_few(self) -> None:
        """Raise LimitError if so many samples are needed that they would delay the core's cycles."""
        if sum(self._counts) > _MOST:
            raise LimitError(
                f"the path needs more than {_MOST} samples",
                observed=f"it has {counted(len(self._pieces), 'line or corner', 'lines and corners')}",
                remedy="give it in parts, each waiting for the previous part (buffer=True), or give accuracy = ...; nothing "
                "has moved",
            )

    def _worst(self, number: int) -> _Worst:
        piece, rows = self._pieces[number], self._rows[number]
        step = piece.length / (len(rows) - 1)
        worst = _Worst(0.0, 0, 0.0)
        for n in range(len(rows) - 1 if step else 0):
            curves = [coefficients(a, b, step) for a, b in zip(rows[n], rows[n + 1], strict=True)]
            for part in _CHECKED:
                joints = tuple(at(curve, part * step) for curve in curves)
                found = self._own.forward(joints)
                off = math.dist(found, piece.at((n + part) * step))
                share = off / (self._own.allowed(joints, found) or math.inf)
                worst = max(worst, _Worst(share, n, off))
        return worst

    def _leap(self, number: int, worst: _Worst) -> LimitError:
        piece, rows, n = self._pieces[number], self._rows[number], worst.interval
        step = piece.length / (len(rows) - 1)
        before, behind = _places(rows[n]), _places(rows[n + 1])
        name, a, b = max(
            zip(self._own.axes, before, behind, strict=True), key=lambda one: abs(one[2] - one[1])
        )
        return LimitError(
            f"near {listed(piece.at(n * step))} {name} must jump",
            observed=f"from {a:.6g} to {b:.6g} within {step:.3g} of the path: with {len(rows)} samples of this segment, the "
            f"tool would still be {worst.off:.3g} off",
            remedy=f"{self._own.name}.inverse must return the solution that is nearest to near; or choose a path farther "
            "from positions with stretched or folded arms, or give accuracy = ...; nothing has moved",
        )

    def _require_room(self) -> None:
        limits = self._own.limits(self._start)
        for piece, rows in zip(self._pieces, self._rows, strict=True):
            step = piece.length / (len(rows) - 1)
            for n in range(len(rows) - 1):
                self._require_interval(limits, piece.at(n * step), rows[n], rows[n + 1], step)

    @staticmethod
    def _require_interval(
        limits: Sequence[tuple[str, str, tuple[float, float] | None]],
        place: Place,
        begin: Row,
        end: Row,
        step: float,
    ) -> None:
        """Raise LimitError if an axis leaves its position limits between two samples."""
        for (name, unit, allowed), a, b in zip(limits, begin, end, strict=True):
            line = controls(a, b, step) if step else (a.place, b.place)
            if allowed is None or allowed[0] <= min(line) <= max(line) <= allowed[1]:
                continue
            low, high = reach(line)
            if not allowed[0] <= low <= high <= allowed[1]:
                beyond = low if low < allowed[0] else high
                raise LimitError(
                    f"the path leaves the position limits of {name} near {listed(place)}",
                    observed=f"{name} must be at {beyond:.6g} {unit}; the allowed range is {allowed[0]:g} to {allowed[1]:g}",
                    remedy=f"choose another path, or change position_limits in [axes.{name}] of cell.toml; nothing has moved",
                )


def _intervals(piece: Piece) -> int:
    """Return the initial number of intervals of a segment."""
    if isinstance(piece, Straight):
        return _LINE
    return _CORNER if isinstance(piece, Corner) else max(_LINE, math.ceil(_ROUND * piece.angle / math.tau))


def _motion(places: Sequence[Place], n: int, apart: float) -> Row:
    """Return the axes' motion at one of ``places``, at least five, which are ``apart`` from each other on the path."""
    last = len(places) - 1
    if not apart:
        return tuple(Motion(value, 0.0, 0.0) for value in places[n])
    behind = n if n < 2 else (last - n if last - n < 2 else 2)
    turned = n > last - 2  # reversed, from the end
    first = last - 4 if turned else max(n - 2, 0)
    near = places[first : first + 5][::-1] if turned else places[first : first + 5]
    sign = -1.0 if turned else 1.0
    return tuple(
        Motion(
            places[n][axis],
            sign * sum(w * place[axis] for w, place in zip(_SLOPES[behind], near, strict=True)) / apart,
            sum(w * place[axis] for w, place in zip(_BENDS[behind], near, strict=True)) / apart**2,
        )
        for axis in range(len(places[n]))
    )


def _places(row: Row) -> Place:
    return tuple(motion.place for motion in row)


def _mean(a: Motion, b: Motion) -> Motion:
    return Motion(*(0.5 * (p + q) for p, q in zip(a, b, strict=True)))
