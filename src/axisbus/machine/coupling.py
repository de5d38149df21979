"""Make the command that couples a slave to its master from the arguments of a call, and check them."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from axisbus.errors import ArgumentError, LimitError
from axisbus.machine.request import AxisCall, flag_of
from axisbus.motion.coupling.definition import (
    CamLaw,
    Entry,
    Gear,
    MasterValue,
    SyncAtPositions,
    SyncAtSpeed,
    SyncFromPresent,
)
from axisbus.motion.group.commands import Couple
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.spline import SplineSegment, parts_of, span_of

if TYPE_CHECKING:
    from axisbus.machine.axis import Axis


class Coupling:
    """Makes a ``Couple`` from one call, such as ``y.gear_in(x, 2.0)``; ``text`` names the call in messages."""

    def __init__(self, slave: Axis, master: object, text: str, request: AxisCall, by: str) -> None:
        """Check the axes.

        Raises:
            ArgumentError: ``master`` is not another axis of the same machine, ``master_value_source`` is neither "command" nor
                "actual", the slave must be homed and is not, or its deceleration is unknown.
        """
        self._slave, self._request = slave, request
        self._text, self._call = request.text, text
        self._master = slave._require_master(master, text)
        if not isinstance(by, str) or by not in {kind.value for kind in MasterValue}:
            raise ArgumentError(
                f"{self._text}: master_value_source {short_repr(by)} is not known",
                remedy='give "command" (the commanded position of the master) or "actual" (its actual position)',
            )
        self._by = MasterValue(by)
        slave._require_homed(text)
        request.coupled()

    def gear(
        self,
        ratio: float,
        acceleration: float | None,
        at: Sequence[float] | None,
        over: float | None,
    ) -> Couple:
        """Return the command of a gear; see ``Axis.gear_in``."""
        law = Gear(self._not_zero("ratio", ratio))
        if at is None:
            if over is not None:
                raise ArgumentError(
                    f"{self._text}: master_start_distance requires sync_positions",
                    remedy="give sync_positions = (position of the master, position of the slave) as well, or leave it out",
                )
            return self._couple(law, SyncAtSpeed(self._request.acceleration(acceleration)))
        return self._couple(law, self._meeting(at, over))

    def cam(
        self, cam: object, over: float, *, relative: bool, phase: float, master_scale: float, scale: float
    ) -> Couple:
        """Return the command of a cam; see ``Axis.cam_in``."""
        if not isinstance(cam, Cam):
            raise ArgumentError(
                f"{self._text}: {short_repr(cam)} is not a cam",
                remedy="make one: Cam([(master, slave), ...])",
            )
        self._master._require_homed(self._call)
        distance = self._request.finite("master_start_distance", over, self._master.unit)
        scaling = self._not_zero("master_scaling", master_scale)
        if distance < 0.0 or scaling < 0.0:
            raise ArgumentError(
                f"{self._text}: master_start_distance and master_scaling must not be negative"
            )
        begins_here = flag_of(self._text, "relative", relative)
        law = cam._transfer_function(
            self._request.finite("master_offset", phase, self._master.unit),
            scaling,
            self._not_zero("slave_scaling", scale),
        )
        if not begins_here:
            self._require_within_limits(cam, law, scale)
        return self._couple(law, SyncFromPresent(distance, begins_here))

    def _couple(self, law: Gear | CamLaw, entry: Entry) -> Couple:
        return Couple(self._master.name, self._slave.name, law, entry, self._by)

    def _meeting(self, at: Sequence[float], over: float | None) -> SyncAtPositions:
        if over is None:
            raise ArgumentError(
                f"{self._text}: master_start_distance is missing",
                remedy="give the distance of the master before that position within which the slave synchronises",
            )
        if len(at) != 2:
            raise ArgumentError(
                f"{self._text}: sync_positions must hold two positions, of the master and of the slave"
            )
        master = self._master._checked_position(self._call, at[0])
        slave = self._slave._checked_position(self._call, at[1])
        return SyncAtPositions(
            master, slave, self._request.positive("master_start_distance", over, self._master.unit)
        )

    def _require_within_limits(self, cam: Cam, law: CamLaw, scale: float) -> None:
        """Check a cam against the slave's limits. A cam whose turns add up is not checked here: the motion itself is."""
        limits = self._slave.limits.position
        if limits is None or law.lift:
            return
        low, high = sorted(position * scale for position in cam.span)
        if limits[0] <= low and high <= limits[1]:
            return
        raise LimitError(
            f"{self._text}: the cam leaves the position limits of {self._slave.name}",
            observed=f"its slave positions are from {low:g} to {high:g} {self._slave.unit}; the allowed range is {limits[0]:g} to "
            f"{limits[1]:g}",
            remedy="scale it, begin it at the present position of the axis (relative = True), or change position_limits in "
            f"[axes.{self._slave.name}] of cell.toml",
        )

    def _not_zero(self, what: str, value: float) -> float:
        found = self._request.finite(what, value, "units of one axis for one of the other")
        if found == 0.0:
            raise ArgumentError(f"{self._text}: {what} 0 couples nothing", remedy=f"give another {what}")
        return found


# -- A cam: the slave's position for each position of its master, as a smooth curve through points ---------------------


MOST = 1000  # points of one cam


class Cam:
    """A curve through ``points``: rows of master position (rising) and slave position in their units, also of numpy.

    Its slope and its curvature are continuous. A cam that is not ``periodic`` begins and ends at rest, and the slave is at
    standstill before and after it. A periodic cam repeats. If the slave positions of the first and the last point differ, each turn
    moves the slave by the difference.
    """

    def __init__(self, points: Iterable[Sequence[float]], *, periodic: bool = False) -> None:
        """Compute the curve.

        Raises:
            ArgumentError: fewer than two points or more than 1000, an invalid point, master positions that do not rise, or
                numbers so large or so close together that no curve can be computed.
        """
        self.periodic = periodic
        masters, slaves = _columns(points)
        self.master_span = masters[0], masters[-1]
        self._marks = tuple(master - masters[0] for master in masters)
        try:
            self._parts = tuple(parts_of(self._marks, slaves, periodic=periodic))
            self._lift = slaves[-1] - slaves[0]
            self.span = span_of(self._parts)
        except (OverflowError, ZeroDivisionError):
            self.span = (-math.inf, math.inf)
        if not all(map(math.isfinite, self.span)):
            raise ArgumentError(
                "the curve of a cam cannot be computed",
                observed=f"its points are from {masters[0]:g} to {masters[-1]:g} of the master and from {min(slaves):g} to "
                f"{max(slaves):g} of the slave",
                remedy="give points with other distances: these are too far apart, or too near to each other",
            )
        self._law = self._transfer_function()

    @classmethod
    def read(cls, file: str | Path, *, periodic: bool = False) -> Cam:
        """Read the points from a CSV file with two columns; a heading in the first line is skipped.

        Raises:
            ArgumentError: the file cannot be read, or contains no such points; the error names the line.
        """
        try:
            with Path(file).open(encoding="utf-8-sig", newline="") as text:
                rows = [(line, row) for line, row in enumerate(csv.reader(text), 1) if any(row)]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise ArgumentError(f"{file}: cannot be read as a cam", observed=str(error)) from None
        points = [_point(f"{file}, line {line}", row) for line, row in rows[_is_heading(rows) :]]
        try:
            return cls(points, periodic=periodic)
        except ArgumentError as error:
            raise ArgumentError(
                f"{file}: {error.message}", observed=error.observed, remedy=error.remedy
            ) from None

    def __repr__(self) -> str:
        kind = "periodic, " if self.periodic else ""
        return f"<Cam {kind}from {self.master_span[0]:g} to {self.master_span[1]:g} of the master>"

    @property
    def lift(self) -> float:
        """Slave position at the end of the cam minus that at its beginning, in the slave's unit."""
        return self._lift

    def at(self, master: float) -> float:
        """Return the slave position for a master position."""
        return self._law.at(master).position

    def _transfer_function(self, phase: float = 0.0, master_scale: float = 1.0, scale: float = 1.0) -> CamLaw:
        """Return the cam for two axes, ``phase`` master units ahead and scaled. No factor is 0; ``master_scale`` is above 0."""
        m, s = master_scale, scale
        parts = tuple(
            SplineSegment(
                p.position * s, p.speed * s / m, p.bend * s / m**2, p.twist * s / m**3, p.length * m
            )
            for p in self._parts
        )
        period = (self.master_span[1] - self.master_span[0]) * m
        marks = tuple(mark * m for mark in self._marks[:-1])
        lift = self._lift * s if self.periodic else None
        return CamLaw(self.master_span[0] * m - phase, marks, parts, period, lift)


def _columns(points: Iterable[Sequence[float]]) -> tuple[list[float], list[float]]:
    try:
        rows = [(a, b) for a, b in cast("Any", points)]
    except (TypeError, ValueError):
        raise ArgumentError(
            f"{short_repr(points)} are not points of a cam",
            remedy="give rows of the master's and the slave's position",
        ) from None
    if not 2 <= len(rows) <= MOST:
        raise ArgumentError(f"a cam has 2 to {MOST} points, this one has {len(rows)}")
    known = [[_number(value) for value in column] for column in zip(*rows, strict=True)]
    for count, (a, b) in enumerate(pairwise(known[0]), 2):
        if a >= b:
            raise ArgumentError(
                "the master positions of a cam must increase from point to point",
                observed=f"point {count}: {b:g} after {a:g}",
            )
    return known[0], known[1]


def _number(value: object) -> float:
    found = number(value)
    if found is None:
        raise ArgumentError("the points of a cam need finite numbers", observed=short_repr(value))
    return found


def _point(where: str, row: Sequence[str]) -> tuple[float, float]:
    if len(row) == 2:
        try:
            return float(row[0]), float(row[1])
        except ValueError:
            pass
    raise ArgumentError(
        f"{where}: not a point of a cam",
        observed=", ".join(row),
        remedy="write two numbers in each line: the master's position and the slave's",
    )


def _is_heading(rows: Sequence[tuple[int, Sequence[str]]]) -> bool:
    """Whether the first line is a heading."""
    try:
        return bool(rows) and not [float(value) for value in rows[0][1]]
    except ValueError:
        return True
