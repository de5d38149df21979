"""Entries that commands must set although they are read-only in the EDS: the required values, and the commands that fail."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

from axisbus.cell.axis_description import Drive
from axisbus.cell.quantities import units_of
from axisbus.cia402 import objects as o
from axisbus.cia402.modes import ModeOfOperation
from axisbus.units import Scale

_M = ModeOfOperation
_CYCLIC = (_M.INTERPOLATED_POSITION, _M.CYCLIC_SYNC_POSITION, _M.CYCLIC_SYNC_VELOCITY, _M.CYCLIC_SYNC_TORQUE)
_PERIOD = (o.INTERPOLATION_TIME_PERIOD, 1)
_EXPONENT = (o.INTERPOLATION_TIME_PERIOD, 2)
_MOVES = "move_absolute, move_relative and move_additive"
_CYCLIC_COMMANDS = "lines, trajectories, couplings, cyclic_velocity and cyclic_torque"

Read = Callable[[int, int], int | None]


@dataclass(frozen=True, slots=True)
class EntryContradiction:
    """A read-only entry with another value; ``line`` of the cell file asks for the required value."""

    line: int
    message: str
    observed: str
    remedy: str


@dataclass(frozen=True, slots=True)
class _Setting:
    mode: ModeOfOperation
    at: tuple[int, int]
    wanted: int
    line: int
    source: str
    fails: str


def contradictions(
    drive: Drive, scan_period: float, modes: Collection[ModeOfOperation], read: Read
) -> Iterator[EntryContradiction]:
    """Yield the read-only entries with which commands will fail; ``read`` returns the value of an entry (None: unknown).

    ``modes``: the modes in which the axis is used; ``scan_period`` in seconds. Pure, except for ``read``.
    """
    fixed = drive.read_only
    for each in _settings(drive):
        found = read(*each.at) if each.at in fixed and each.mode in modes else None
        if found is not None and found != each.wanted:
            yield EntryContradiction(
                each.line,
                f"axis {drive.axis.name}: {each.fails} will be refused, because {_name(each.at)} cannot be written",
                f"{_access(drive, each.at)}, and it is {found}; {each.source} needs {each.wanted}",
                f"command the behaviour that {found} means, set it with the manufacturer's tool, or correct its access in the EDS",
            )
    if modes and not set(modes).isdisjoint(_CYCLIC):
        yield from _period(drive, scan_period, read)


def _settings(drive: Drive) -> Iterator[_Setting]:
    axis, units = drive.axis, units_of(drive.axis)
    homing = axis.homing
    if homing.method is not None:
        line = homing.at.of("method")
        yield _Setting(
            _M.HOMING, (o.HOMING_METHOD, 0), homing.method, line, f"method in [{homing.at.name}]", "home"
        )
    speeds: tuple[tuple[str, float | None, Scale, tuple[int, int]], ...] = (
        ("speed_switch", homing.speed_switch, units.velocity, (o.HOMING_SPEEDS, 1)),
        ("speed_zero", homing.speed_zero, units.velocity, (o.HOMING_SPEEDS, 2)),
        ("acceleration", homing.acceleration, units.acceleration, (o.HOMING_ACCELERATION, 0)),
    )
    for key, value, scale, at in speeds:
        if value is not None:
            raw = abs(scale.to_increments(value))
            yield _Setting(_M.HOMING, at, raw, homing.at.of(key), f"{key} in [{homing.at.name}]", "home")
    velocity, given = axis.defaults.velocity, axis.defaults.at
    if velocity is not None:
        raw = abs(units.velocity.to_increments(velocity))
        source = f"velocity in [{given.name}]"
        fails = f"{_MOVES} without another velocity"
        yield _Setting(_M.PROFILE_POSITION, (o.PROFILE_VELOCITY, 0), raw, given.of("velocity"), source, fails)
    source = "a move that ends at standstill"
    yield _Setting(_M.PROFILE_POSITION, (o.END_VELOCITY, 0), 0, axis.at.line, source, _MOVES)


def _period(drive: Drive, scan_period: float, read: Read) -> Iterator[EntryContradiction]:
    fixed = [at for at in (_PERIOD, _EXPONENT) if at in drive.read_only]
    if not fixed:
        return
    value, exponent = (read(*at) if at in fixed else None for at in (_PERIOD, _EXPONENT))
    if not _misfit(scan_period, value, exponent):
        return
    seen = " and ".join(f"{_name(at)} is {read(*at)}" for at in fixed)
    yield EntryContradiction(
        drive.axis.at.line,
        f"axis {drive.axis.name}: {_CYCLIC_COMMANDS} will be refused, because the interpolation time cannot be the scan period",
        f"{seen}, and cannot be written by {drive.eds.source}; the scan period is {scan_period * 1000:g} ms",
        "choose a scan_period in [bus] that this drive has as its interpolation time, or correct the access in the EDS",
    )


def _misfit(scan_period: float, value: int | None, exponent: int | None) -> bool:
    """Whether no 60C2h with these fixed entries (None: writable, or unknown) equals the scan period."""
    if exponent is None:
        return (
            False
            if value is None
            else not _is_period(scan_period, value, round(math.log10(scan_period / max(value, 1))))
        )
    whole = round(scan_period / 10.0**exponent) if value is None else value
    return not 1 <= whole <= 255 or not _is_period(scan_period, whole, exponent)


def _is_period(scan_period: float, value: int, exponent: int) -> bool:
    return math.isclose(value * 10.0**exponent, scan_period, rel_tol=1e-9)


def _name(at: tuple[int, int]) -> str:
    return f"{at[0]:04X}h:{at[1]:02X}" if at[1] else f"{at[0]:04X}h"


def _access(drive: Drive, at: tuple[int, int]) -> str:
    variable = drive.variable(*at)
    return (
        f"{drive.eds.source}:{variable.line}: its access is {variable.access}" if variable is not None else ""
    )
