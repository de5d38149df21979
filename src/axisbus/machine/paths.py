"""From what a user asks of a group to a way: points in the axes' units, checked, as pieces with their speeds."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from axisbus.errors import ArgumentError, LimitError
from axisbus.machine.axis import Axis
from axisbus.motion.group.commands import MovePath
from axisbus.motion.group.path import arc_about, arc_through, polyline, require_end
from axisbus.motion.group.pieces import Arc, Piece, Place
from axisbus.motion.group.way import Cycle, way_of
from axisbus.motion.numbers import number, told
from axisbus.wording import counted

MOST = 1000  # points of one path: they cross to the core at once, within a millisecond of its time


def one_each(axes: Collection[str], text: str, values: Sequence[float]) -> Sequence[float]:
    """Return ``values``, of which there must be one for each axis (ArgumentError); ``text`` is how the message begins."""
    if len(values) != len(axes):
        raise ArgumentError(
            f"{text} {counted(len(values), 'position')} for {counted(len(axes), 'axis', 'axes')}",
            remedy=f"give one for each of {', '.join(axes)}, in this order",
        )
    return values


class PathRequest:
    """One call, such as ``xy.move_path(...)``, on its way to a ``MovePath``. ``text`` names it in messages."""

    def __init__(
        self,
        axes: Mapping[str, Axis],
        text: str,
        call: str,
        velocity: float,
        acceleration: float,
        jerk: float | None,
        *,
        after: Place | None = None,
        buffer: bool = False,
    ) -> None:
        """``velocity``, ``acceleration`` and ``jerk`` (of an arc) are checked already; ``call`` is the name of the method.

        ``after``: where what it waits for ends; None: it begins where the axes stand. ``buffer``: see ``MovePath``.

        Raises:
            ArgumentError: an axis is endless.
            StaleError: where an axis stands is not known.
        """
        self._axes = axes
        self._text, self._call = text, call
        self._velocity, self._acceleration, self._jerk = velocity, acceleration, jerk
        for name, axis in axes.items():
            if axis.modulo is not None:
                raise ArgumentError(
                    f"{text}: {name} is endless, so its places do not make a path",
                    observed=f"its modulo is {axis.modulo:g} {axis.unit}",
                    remedy="leave it out of the group, or lead it by a trajectory of its own",
                )
        self._start: Place = after or tuple(axis.led_to for axis in axes.values())
        self._buffer = buffer

    def along(self, points: Sequence[Sequence[float]], blend: float) -> MovePath:
        """Return the path through ``points``; corners are cut by at most ``blend``.

        Raises:
            LimitError, ArgumentError: a point is none, there are none or too many, or ``blend`` is no distance.
        """
        wide = number(blend)
        if wide is None or wide < 0.0:
            raise ArgumentError(
                f"{self._text}: blend {told(blend)} is no distance",
                remedy="give the distance within which corners are cut, or 0 to stop at each",
            )
        if not 0 < len(points) <= MOST:
            raise ArgumentError(
                f"{self._text}: a path has 1 to {MOST} points, this one has {len(points)}",
                remedy="give its points in turn, as positions of the axes in the group's order",
            )
        places = [self.point(f"point {place + 1}", point) for place, point in enumerate(points)]
        pieces, stops = polyline([self._start, *places], wide)
        return self._path(pieces, stops)

    def through(self, via: Sequence[float], end: Sequence[float]) -> MovePath:
        """Return the arc by ``via`` to ``end``.

        Raises:
            LimitError, ArgumentError: a point is none, or they make no circle.
        """
        by, to = self.point("via", via), self.point("end", end)
        return self._arc(lambda: arc_through(self._start, by, to))

    def about(self, centre: Sequence[float], end: Sequence[float], *, clockwise: bool) -> MovePath:
        """Return the arc about ``centre`` to ``end``.

        Raises:
            LimitError, ArgumentError: a point is none, they make no circle, or the axes are not two.
        """
        if len(self._axes) != 2:
            raise ArgumentError(
                f"{self._text}: a circle about a centre is one of two axes, these are {len(self._axes)}",
                remedy="make a group of two, or give a point that the circle goes through: via = ...",
            )
        middle = tuple(self._number("centre", value) for value in self._each("centre", centre))
        to = self.point("end", end)
        return self._arc(lambda: arc_about(self._start, middle, to, clockwise=clockwise))

    def point(self, what: str, values: Sequence[float]) -> Place:
        """Return the place that ``values`` are, each checked as an absolute move is."""
        return tuple(
            axis.absolute_position(self._call, value)
            for axis, value in zip(self._axes.values(), self._each(what, values), strict=True)
        )

    def _each(self, what: str, values: Sequence[float]) -> Sequence[float]:
        return one_each(self._axes, f"{self._text}: {what} has", values)

    def _number(self, what: str, value: float) -> float:
        found = number(value)
        if found is None:
            raise ArgumentError(f"{self._text}: {what} {told(value)} is no finite number")
        return found

    def _arc(self, make: Callable[[], Arc]) -> MovePath:
        try:
            arc = make()
        except ValueError as error:
            raise ArgumentError(
                f"{self._text}: {error}", remedy="look at the points, and where the axes stand"
            ) from None
        for (name, axis), low, high in zip(self._axes.items(), *arc.box, strict=True):
            allowed = axis.limits.position
            if allowed is not None and not allowed[0] <= low <= high <= allowed[1]:
                raise LimitError(
                    f"{self._text}: the circle leaves the position limits of {name}",
                    observed=f"it goes from {low:g} to {high:g} {axis.unit}; allowed are {allowed[0]:g} to {allowed[1]:g}",
                    remedy=f"choose another circle, or change position_limits in [axes.{name}] of cell.toml",
                )
        return self._path([arc], set())

    def _path(self, pieces: Sequence[Piece], stops: set[int]) -> MovePath:
        limits = [axis.limits for axis in self._axes.values()]
        period = next(iter(self._axes.values())).scan_period
        cycle = Cycle(self._velocity, period)
        way = way_of(pieces, limits, self._acceleration, stops, cycle)
        require_end(way, self._velocity, self._text)
        return MovePath(tuple(self._axes), way, self._velocity, self._jerk, self._buffer)
