"""Convert points of a workspace, which arrive one by one, to spans of the axes' motion.

Theory of operation
-------------------
The curve through the points is computed in the workspace, so the tool's position between two points is defined there. Its time is
divided until, in the middle of each part, the axes' own curve deviates by no more than one increment of an axis moves the tool. The
motion of the axes at the ends of a part follows only from position, velocity and acceleration of the tool there. It is the same
from both sides, so that neither velocity nor acceleration of an axis jumps. Each part is checked as a span of axes is.

The user's own kinematics are asked for positions close to each other, each time near their previous answer: from the axes' position
at a point to the end of the span.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Protocol

from axisbus.errors import AxisbusError, LimitError
from axisbus.machine.user_kinematics.kinematics import moved_by
from axisbus.motion.group.kinematics import Kinematics
from axisbus.motion.group.segments import Place
from axisbus.motion.point_stream.commands import Span
from axisbus.motion.point_stream.curve_fit import (
    Allowed,
    Between,
    Coefficients,
    CurveFit,
    Motion,
    PointAccepted,
    StreamPoint,
    at,
    coefficients,
)

_FINEST = 256  # parts between two points
_APART, _MOST_APART = 0.1, 0.005  # of the time between two points; seconds
_KEPT = 8  # number of points whose axis motion is stored
Row = tuple[Motion, ...]


class Solving(Protocol):
    """The interface to kinematics for solving: ``UserKinematicsAdapter``, and those of the core as ``UserKinematicsSolver``."""

    def forward(self, joints: Place, /) -> Place:
        """Return the workspace position for the axes' positions."""

    def inverse(self, place: Place, near: Place, /) -> Place:
        """Return the axes' positions for a workspace position, the nearest to ``near``; ValueError, LimitError: out of reach."""

    def allowed(self, joints: Place, place: Place, /) -> float:
        """Return the allowed deviation of the tool near ``joints``, which correspond to ``place``."""

    def require_fit(self, place: Place, joints: Place, /) -> None:
        """Raise an error if ``joints`` do not correspond to ``place``."""


class UserKinematicsSolver:
    """Kinematics of the core: exact, and with one solution for each position."""

    def __init__(self, kinematics: Kinematics, increments: Sequence[float]) -> None:
        """``increments`` of the axes in their units."""
        self._kinematics, self._increments = kinematics, tuple(increments)
        self.forward = kinematics.forward

    def inverse(self, place: Place, _near: Place) -> Place:
        """Return the axes' positions for a workspace position; raises ValueError if it is out of reach."""
        return self._kinematics.inverse(place)

    def allowed(self, joints: Place, place: Place) -> float:
        """Return the distance by which one increment of one axis moves the tool there."""
        return moved_by(self.forward, joints, place, self._increments)

    def require_fit(self, place: Place, joints: Place) -> None:
        """Accept any position: kinematics of the core are exact."""


def of_point(text: str, error: AxisbusError) -> AxisbusError:
    """Return an error of the user's own kinematics, for the point of a stream that ``text`` names."""
    return type(error)(
        f"{text}: {error.message}",
        observed=error.observed,
        remedy=error.remedy.replace("nothing has moved", "this point was rejected"),
    )


class PlaceJoining(PointAccepted[tuple[Span, ...]]):
    """Makes spans from points of a workspace; stores the axes' motion at the last points."""

    def __init__(
        self, solving: Solving, axes: Mapping[str, Allowed], start: Callable[[], Place], text: str
    ) -> None:
        """``start`` returns the axes' positions before the first point; ``text``: the beginning of messages."""
        super().__init__()
        self._solving = solving
        self._start = start
        self._spans = CurveFit(axes, text)
        self._text = text
        self._known: dict[Row, Row] = {}

    def take(self, point: StreamPoint) -> tuple[Span, ...] | None:
        """As ``PointAccepted.take``; nothing of a refused point is stored."""
        before = dict(self._known)
        try:
            return super().take(point)
        except BaseException:
            self._known = before
            raise

    def _made(self, between: Between) -> tuple[Span, ...]:
        self._spans.count = self.count  # for messages
        try:
            rows = self._divided(between)
        except AxisbusError as error:
            raise of_point(f"{self._text}: point {self.count + 1}", error) from error
        except ValueError as error:
            raise self._refused(str(error)) from None
        self._keep(between.to, rows[-1])
        return tuple(self._spans.checked(part) for part in _parts(between, rows))

    def _divided(self, between: Between) -> list[Row]:
        """Return the axes' motion at the ends of as many parts as needed; raise ValueError if no number is enough."""
        curves = [coefficients(a, b, between.seconds) for a, b in zip(between.from_, between.to, strict=True)]
        count = 1
        while count <= _FINEST:
            rows = self._rows(between, curves, count)
            if self._is_near(curves, rows, between.seconds / count):
                return rows
            count *= 2
        raise ValueError(f"an axis must jump between {between.begin.t:.3f} s and {between.end.t:.3f} s")

    def _rows(self, between: Between, curves: Sequence[Coefficients], count: int) -> list[Row]:
        """Return the axes' motion at the ends of ``count`` parts."""
        seconds = between.seconds
        apart = min(_APART * seconds, _MOST_APART)
        inner = [tuple(_motion(curve, seconds * n / count) for curve in curves) for n in range(1, count)]
        rows = [self._begin(between.from_, apart)]
        for motion in (*inner, between.to):
            rows.append(self._axes_at(motion, apart, _places(rows[-1])))
        return rows

    def _begin(self, tool: Row, apart: float) -> Row:
        """Return the axes' motion at a point: the same as at the end of the previous span."""
        if tool not in self._known:  # only the first point
            self._keep(tool, self._axes_at(tool, apart, self._start()))
        return self._known[tool]

    def _keep(self, tool: Row, axes: Row) -> None:
        self._known.pop(tool, None)
        while len(self._known) >= _KEPT:
            del self._known[next(iter(self._known))]
        self._known[tool] = axes

    def _axes_at(self, tool: Row, apart: float, near: Place) -> Row:
        """Return the axes' motion for a motion of the tool, by differences: positions ``apart`` seconds before and after."""
        here = self._joints(tool, 0.0, near)
        self._solving.require_fit(_places(tool), here)
        before, behind = (self._joints(tool, sign * apart, here) for sign in (-1.0, 1.0))
        first, last = self._joints(tool, -2.0 * apart, before), self._joints(tool, 2.0 * apart, behind)
        places = (first, before, here, behind, last)
        return tuple(_differences(values, apart) for values in zip(*places, strict=True))

    def _joints(self, tool: Row, t: float, near: Place) -> Place:
        place = tuple(one.place + t * (one.speed + 0.5 * t * one.rate) for one in tool)
        return self._solving.inverse(place, near)

    def _is_near(self, curves: Sequence[Coefficients], rows: Sequence[Row], seconds: float) -> bool:
        """Whether the axes' own curves keep the tool at its position, in the middle of each part."""
        for n, (begin, end) in enumerate(pairwise(rows)):
            joints = tuple(
                at(coefficients(a, b, seconds), 0.5 * seconds) for a, b in zip(begin, end, strict=True)
            )
            found = self._solving.forward(joints)
            wanted = tuple(at(curve, (n + 0.5) * seconds) for curve in curves)
            if math.dist(found, wanted) > self._solving.allowed(joints, found):
                return False
        return True

    def _refused(self, why: str) -> LimitError:
        return LimitError(
            f"{self._text}: point {self.count + 1} is out of the reach of the machine",
            observed=why,
            remedy="give points within reach, farther from where arms are stretched out or folded; this point was rejected",
        )


def _parts(between: Between, rows: Sequence[Row]) -> list[Between]:
    """Return the parts of a span, as spans of the axes."""
    count = len(rows) - 1
    begin, seconds = between.begin.t, between.seconds
    points = [StreamPoint(begin + seconds * n / count, _places(row)) for n, row in enumerate(rows)]
    return [Between(points[n], points[n + 1], rows[n], rows[n + 1]) for n in range(count)]


def _places(row: Row) -> Place:
    return tuple(one.place for one in row)


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
