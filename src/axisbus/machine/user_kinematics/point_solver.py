"""Convert points of a workspace, which arrive one by one, to segments of the axes' motion.

Theory of operation
-------------------
The curve through the points is computed in the workspace, so the tool's position between two points is defined there. Its time is
divided until, in the middle of each part, the axes' own curve deviates by no more than one increment of an axis moves the tool. The
motion of the axes at the ends of a part follows only from position, velocity and acceleration of the tool there. It is the same
from both sides, so that neither velocity nor acceleration of an axis jumps. Each part is checked as a segment of axes is.

The user's own kinematics are asked for positions close to each other, each time near their previous answer: from the axes' position
at a point to the end of the segment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Protocol

from axisbus.errors import AxisbusError, LimitError
from axisbus.machine.user_kinematics.kinematics import tool_step
from axisbus.motion.group.kinematics import Kinematics
from axisbus.motion.group.segments import Coordinates
from axisbus.motion.point_stream.commands import StreamSegment
from axisbus.motion.point_stream.curve_fit import (
    Coefficients,
    CurveFit,
    IncrementalFit,
    Motion,
    SegmentEnds,
    StreamLimits,
    StreamPoint,
    at,
    coefficients,
)

_FINEST = 256  # parts between two points
_APART, _MOST_APART = 0.1, 0.005  # of the time between two points; seconds
_STORED_POINTS = 8  # number of points whose axis motion is stored
Row = tuple[Motion, ...]


class WorkspaceSolver(Protocol):
    """The interface to kinematics for solving: ``UserKinematicsAdapter``, and those of the core as ``UserKinematicsSolver``."""

    def forward(self, joints: Coordinates, /) -> Coordinates:
        """Return the workspace position for the axes' positions."""

    def inverse(self, coordinates: Coordinates, near: Coordinates, /) -> Coordinates:
        """Return the axes' positions for a workspace position, the nearest to ``near``; ValueError, LimitError: out of reach."""

    def allowed(self, joints: Coordinates, coordinates: Coordinates, /) -> float:
        """Return the allowed deviation of the tool near ``joints``, which correspond to ``coordinates``."""

    def require_fit(self, coordinates: Coordinates, joints: Coordinates, /) -> None:
        """Raise an error if ``joints`` do not correspond to ``coordinates``."""


class UserKinematicsSolver:
    """Kinematics of the core: exact, and with one solution for each position."""

    def __init__(self, kinematics: Kinematics, increments: Sequence[float]) -> None:
        """``increments`` of the axes in their units."""
        self._kinematics, self._increments = kinematics, tuple(increments)
        self.forward = kinematics.forward

    def inverse(self, coordinates: Coordinates, _near: Coordinates) -> Coordinates:
        """Return the axes' positions for a workspace position; raises ValueError if it is out of reach."""
        return self._kinematics.inverse(coordinates)

    def allowed(self, joints: Coordinates, coordinates: Coordinates) -> float:
        """Return the distance by which one increment of one axis moves the tool there."""
        return tool_step(self.forward, joints, coordinates, self._increments)

    def require_fit(self, coordinates: Coordinates, joints: Coordinates) -> None:
        """Accept any position: kinematics of the core are exact."""


def point_error(text: str, error: AxisbusError) -> AxisbusError:
    """Return an error of the user's own kinematics, for the point of a stream that ``text`` names."""
    return type(error)(
        f"{text}: {error.message}",
        observed=error.observed,
        remedy=error.remedy.replace("nothing has moved", "this point was rejected"),
    )


class WorkspaceCurveFit(IncrementalFit[tuple[StreamSegment, ...]]):
    """Makes segments from points of a workspace; stores the axes' motion at the last points."""

    def __init__(
        self,
        solver: WorkspaceSolver,
        axes: Mapping[str, StreamLimits],
        start: Callable[[], Coordinates],
        text: str,
    ) -> None:
        """``start`` returns the axes' positions before the first point; ``text``: the beginning of messages."""
        super().__init__()
        self._solver = solver
        self._start = start
        self._spans = CurveFit(axes, text)
        self._text = text
        self._known: dict[Row, Row] = {}

    def take(self, point: StreamPoint) -> tuple[StreamSegment, ...] | None:
        """As ``IncrementalFit.take``; nothing of a refused point is stored."""
        before = dict(self._known)
        try:
            return super().take(point)
        except BaseException:
            self._known = before
            raise

    def _fitted(self, segment: SegmentEnds) -> tuple[StreamSegment, ...]:
        self._spans.count = self.count  # for messages
        try:
            rows = self._divided(segment)
        except AxisbusError as error:
            raise point_error(f"{self._text}: point {self.count + 1}", error) from error
        except ValueError as error:
            raise self._refused(str(error)) from None
        self._store(segment.to, rows[-1])
        return tuple(self._spans.checked(part) for part in _parts(segment, rows))

    def _divided(self, segment: SegmentEnds) -> list[Row]:
        """Return the axes' motion at the ends of as many parts as needed; raise ValueError if no number is enough."""
        curves = [coefficients(a, b, segment.seconds) for a, b in zip(segment.from_, segment.to, strict=True)]
        count = 1
        while count <= _FINEST:
            rows = self._rows(segment, curves, count)
            if self._is_near(curves, rows, segment.seconds / count):
                return rows
            count *= 2
        raise ValueError(f"an axis must jump between {segment.begin.t:.3f} s and {segment.end.t:.3f} s")

    def _rows(self, segment: SegmentEnds, curves: Sequence[Coefficients], count: int) -> list[Row]:
        """Return the axes' motion at the ends of ``count`` parts."""
        seconds = segment.seconds
        apart = min(_APART * seconds, _MOST_APART)
        inner = [tuple(_motion(curve, seconds * n / count) for curve in curves) for n in range(1, count)]
        rows = [self._begin(segment.from_, apart)]
        for motion in (*inner, segment.to):
            rows.append(self._axes_at(motion, apart, _axis_positions(rows[-1])))
        return rows

    def _begin(self, tool: Row, apart: float) -> Row:
        """Return the axes' motion at a point: the same as at the end of the previous segment."""
        if tool not in self._known:  # only the first point
            self._store(tool, self._axes_at(tool, apart, self._start()))
        return self._known[tool]

    def _store(self, tool: Row, axes: Row) -> None:
        self._known.pop(tool, None)
        while len(self._known) >= _STORED_POINTS:
            del self._known[next(iter(self._known))]
        self._known[tool] = axes

    def _axes_at(self, tool: Row, apart: float, near: Coordinates) -> Row:
        """Return the axes' motion for a motion of the tool, by differences: positions ``apart`` seconds before and after."""
        here = self._joints(tool, 0.0, near)
        self._solver.require_fit(_axis_positions(tool), here)
        before, behind = (self._joints(tool, sign * apart, here) for sign in (-1.0, 1.0))
        first, last = self._joints(tool, -2.0 * apart, before), self._joints(tool, 2.0 * apart, behind)
        coordinates_list = (first, before, here, behind, last)
        return tuple(_differences(values, apart) for values in zip(*coordinates_list, strict=True))

    def _joints(self, tool: Row, t: float, near: Coordinates) -> Coordinates:
        coordinates = tuple(one.position + t * (one.speed + 0.5 * t * one.rate) for one in tool)
        return self._solver.inverse(coordinates, near)

    def _is_near(self, curves: Sequence[Coefficients], rows: Sequence[Row], seconds: float) -> bool:
        """Whether the axes' own curves keep the tool at its position, in the middle of each part."""
        for n, (begin, end) in enumerate(pairwise(rows)):
            joints = tuple(
                at(coefficients(a, b, seconds), 0.5 * seconds) for a, b in zip(begin, end, strict=True)
            )
            found = self._solver.forward(joints)
            wanted = tuple(at(curve, (n + 0.5) * seconds) for curve in curves)
            if math.dist(found, wanted) > self._solver.allowed(joints, found):
                return False
        return True

    def _refused(self, why: str) -> LimitError:
        return LimitError(
            f"{self._text}: point {self.count + 1} is out of the reach of the machine",
            observed=why,
            remedy="give points within reach, farther from where arms are stretched out or folded; this point was rejected",
        )


def _parts(segment: SegmentEnds, rows: Sequence[Row]) -> list[SegmentEnds]:
    """Return the parts of a segment, as segments of the axes."""
    count = len(rows) - 1
    begin, seconds = segment.begin.t, segment.seconds
    points = [StreamPoint(begin + seconds * n / count, _axis_positions(row)) for n, row in enumerate(rows)]
    return [SegmentEnds(points[n], points[n + 1], rows[n], rows[n + 1]) for n in range(count)]


def _axis_positions(row: Row) -> Coordinates:
    return tuple(one.position for one in row)


def _motion(curve: Coefficients, t: float) -> Motion:
    _, b, c, d, e, f = curve
    return Motion(
        at(curve, t),
        b + t * (2.0 * c + t * (3.0 * d + t * (4.0 * e + t * 5.0 * f))),
        2.0 * c + t * (6.0 * d + t * (12.0 * e + t * 20.0 * f)),
    )


def _differences(values: Sequence[float], apart: float) -> Motion:
    """Return position, velocity and acceleration in the middle of five values."""
    a, b, here, d, e = values
    speed = (8.0 * (d - b) - (e - a)) / (12.0 * apart)
    return Motion(here, speed, (16.0 * (b + d) - a - e - 30.0 * here) / (12.0 * apart**2))
