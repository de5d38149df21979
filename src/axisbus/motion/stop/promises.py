"""Which limits of an axis are enforced in which mode, and how: one description for ``check``, ``boot``, programs and tests.

It describes the behaviour of ``limits`` (the look-ahead of the position limits), of ``overspeed``, and of the acceptance of
commands, for the known properties of the axis. If a limit cannot be enforced, it is not promised, and the reason is given.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation, short
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.limits import stop_of, unknown_braking
from axisbus.motion.stop_deceleration import CommandedMotion

_M = ModeOfOperation
_MOVED = (
    _M.PROFILE_POSITION,
    _M.PROFILE_VELOCITY,
    _M.PROFILE_TORQUE,
    _M.HOMING,
    _M.CYCLIC_SYNC_POSITION,
    _M.CYCLIC_SYNC_VELOCITY,
    _M.CYCLIC_SYNC_TORQUE,
)
_BY_TORQUE = (_M.PROFILE_TORQUE, _M.CYCLIC_SYNC_TORQUE)
POSITION, VELOCITY = "position_limits", "max_velocity"


class LimitEnforcement(Enum):
    """How a limit is enforced."""

    AHEAD = "braked ahead"
    AT = "targets are checked; the axis is stopped at the limit"
    WATCHED = "commands are checked, and the speed is monitored by positions"
    CHECKED = "commands are checked, and the speed is not monitored"
    REFUSED = "the motion is refused"
    NOT = "not kept"


class Promise(NamedTuple):
    """How one limit (a key of the cell file) is enforced in one mode (its short name).

    ``why`` and ``remedy`` are given if the limit is not fully enforced.
    """

    limit: str
    mode: str
    kept: LimitEnforcement
    why: str = ""
    remedy: str = ""


def promises(parameters: AxisParameters) -> tuple[Promise, ...]:
    """Return the promises for each limit in the cell file, for each mode in which the axis is moved."""
    modes = [mode for mode in _MOVED if mode in parameters.modes]
    found: list[Promise] = []
    if parameters.limits.position is not None:
        found += [Promise(POSITION, short(mode), *_position(parameters, mode)) for mode in modes]
    if parameters.limits.velocity is not None:
        found += [Promise(VELOCITY, short(mode), *_velocity(parameters, mode)) for mode in modes]
    return tuple(found)


def rows(found: Sequence[Promise]) -> Iterator[tuple[str, str]]:
    """Yield the promises as text for the user: the limit, and its modes with the kind of enforcement.

    There is one row for each kind and reason.
    """
    grouped: dict[tuple[str, LimitEnforcement, str], list[str]] = {}
    for each in found:
        grouped.setdefault((each.limit, each.kept, each.why), []).append(each.mode)
    for (limit, kept, why), modes in grouped.items():
        yield limit, f"{', '.join(modes)}: {kept.value}" + (f": {why}" if why else "")


class _Enforcement(NamedTuple):
    kept: LimitEnforcement
    why: str = ""
    remedy: str = ""


def _position(parameters: AxisParameters, mode: ModeOfOperation) -> _Enforcement:
    if mode is _M.HOMING:
        return _Enforcement(LimitEnforcement.NOT, "the drive searches freely; the limits apply after homing")
    if not parameters.has(objects.POSITION_ACTUAL):
        kept = LimitEnforcement.AT if mode is _M.PROFILE_POSITION else LimitEnforcement.REFUSED
        return _Enforcement(kept, "the drive has no position actual value (6064h)")
    if mode is _M.CYCLIC_SYNC_POSITION:
        return _by_path(parameters)
    commanded = _commanded_motion(parameters, mode)
    if stop_of(parameters, commanded)[1] is not None:
        return _Enforcement(LimitEnforcement.AHEAD)
    kept = LimitEnforcement.AT if mode is _M.PROFILE_POSITION else LimitEnforcement.REFUSED
    return _Enforcement(kept, *unknown_braking(parameters, commanded))


def _by_path(parameters: AxisParameters) -> _Enforcement:
    if parameters.path_deceleration is not None:
        return _Enforcement(LimitEnforcement.AHEAD)
    return _Enforcement(
        LimitEnforcement.AT,
        "no deceleration is given",
        f"set deceleration in [axes.{parameters.name}.defaults] of cell.toml",
    )


def _commanded_motion(parameters: AxisParameters, mode: ModeOfOperation) -> CommandedMotion:
    """Return the motion of an axis in a mode, for a command that gives all its parameters."""
    if mode in _BY_TORQUE:
        return CommandedMotion(by_torque=True)
    units = parameters.units
    if mode is _M.CYCLIC_SYNC_VELOCITY:
        return CommandedMotion(down=1.0 if units.ratio_known else None, by_core=True)
    is_fixed = objects.PROFILE_DECELERATION in dict(parameters.fixed_ramps)
    given = 1.0 if units.ratio_known and not is_fixed else None
    return CommandedMotion(down=parameters.slow_ramp or given, by_target=mode is _M.PROFILE_POSITION)


def _velocity(parameters: AxisParameters, mode: ModeOfOperation) -> _Enforcement:
    if not parameters.has(objects.POSITION_ACTUAL):
        return _Enforcement(LimitEnforcement.CHECKED, "the drive has no position actual value (6064h)")
    if parameters.units.ratio_known or mode is _M.CYCLIC_SYNC_POSITION:
        return _Enforcement(LimitEnforcement.WATCHED)
    return _Enforcement(
        LimitEnforcement.CHECKED,
        "the unit of its velocities is not known",
        f"give velocity_scale in [axes.{parameters.name}] of cell.toml",
    )
