"""Check that the numbers of an axis are consistent."""

from __future__ import annotations

import math
from collections.abc import Iterator

from axisbus.cell.axis_description import LIMITS_IN_DRIVE, Drive, limits_left_out
from axisbus.cell.model import AxisConfig, SourceLocation
from axisbus.cell.parameters import axis_parameters, highest_speed
from axisbus.check.context import Check, CheckContext, Problems, own_title, titles
from axisbus.cia301.datatypes import DataType
from axisbus.cia402 import homing, objects
from axisbus.motion.parameters import DemandUse, Handshake
from axisbus.motion.stop.promises import promises, rows
from axisbus.wording import counted


def _speeds(axis: AxisConfig) -> Iterator[tuple[str, SourceLocation, float]]:
    """The velocities that must not exceed ``max_velocity``."""
    for key, at, value in (
        ("velocity", axis.defaults.at, axis.defaults.velocity),
        ("speed_switch", axis.homing.at, axis.homing.speed_switch),
        ("speed_zero", axis.homing.at, axis.homing.speed_zero),
        ("standstill_velocity", axis.at, axis.standstill_velocity),
    ):
        if value is not None:
            yield key, at, value


def _ramps(axis: AxisConfig) -> Iterator[tuple[str, SourceLocation, float]]:
    """The accelerations that must not exceed ``max_acceleration``; the deceleration of a quick stop may."""
    for key, at, value in (
        ("acceleration", axis.defaults.at, axis.defaults.acceleration),
        ("deceleration", axis.defaults.at, axis.defaults.deceleration),
        ("acceleration", axis.homing.at, axis.homing.acceleration),
    ):
        if value is not None:
            yield key, at, value


def beyond_maximum(case: CheckContext) -> Problems:
    """Check defaults and homing velocities against the axis's own maxima."""
    for axis in case.cell.axes.values():
        for maximum, limit, unit, values in (
            ("max_velocity", axis.max_velocity, "/s", _speeds(axis)),
            ("max_acceleration", axis.max_acceleration, "/s²", _ramps(axis)),
        ):
            for key, at, value in values:
                if limit is not None and value > limit:
                    yield case.error(
                        at.of(key),
                        f"axis {axis.name}: {key} in [{at.name}] is beyond {maximum}",
                        f"{value:g} {axis.unit}{unit} against {limit:g} at line {axis.at.of(maximum)}",
                        f"lower {key}, or raise {maximum}",
                    )


def modulo_with_limits(case: CheckContext) -> Problems:
    """Check that an endless axis has no position limits."""
    for axis in case.cell.axes.values():
        if axis.modulo is not None and axis.position_limits is not None:
            yield case.error(
                axis.at.of("modulo"),
                f"axis {axis.name}: an endless axis (modulo) has no position limits",
                f"position_limits is at line {axis.at.of('position_limits')}",
                "delete one of them",
            )


def virtual_outside(case: CheckContext) -> Problems:
    """Warn of a virtual axis whose start position, 0, is outside its position limits."""
    for axis in case.cell.axes.values():
        limits = axis.position_limits
        if axis.virtual and limits is not None and not limits[0] <= 0.0 <= limits[1]:
            yield case.warning(
                axis.at.of("position_limits"),
                f"virtual axis {axis.name} begins outside its position limits",
                f"it begins at 0, and they are {limits[0]:g} to {limits[1]:g} {axis.unit}",
                f"set its position before its first move, such as set_position({limits[0]:g}), or choose limits that include 0",
            )


def invert(case: CheckContext) -> Problems:
    """Check that the direction is not inverted twice."""
    for drive in case.drives:
        axis, polarity = drive.axis, drive.number(objects.POLARITY)
        if axis.invert == "master" and polarity:
            yield case.error(
                axis.at.of("invert"),
                f"axis {axis.name}: the direction is inverted twice",
                f'invert = "master", and {own_title(drive, objects.POLARITY)} is {polarity:02X}h after boot',
                f'write invert = "drive", or set 607E to 0 in [{axis.at.name}.objects]',
            )
        if axis.invert == "drive" and axis.rated_torque is not None:
            yield case.note(
                axis.at.of("invert"),
                f"axis {axis.name}: it is not certain whether the drive also inverts torques",
                "607Eh inverts position and velocity",
                "try torque_control with a small torque first",
            )


def torque(case: CheckContext) -> Problems:
    """Check that values in N·m can be converted, and fit."""
    for axis in case.cell.axes.values():
        rated = axis.rated_torque
        for key, at, value in (
            ("max_torque", axis.at, axis.max_torque),
            ("torque_slope", axis.defaults.at, axis.defaults.torque_slope),
        ):
            if value is None or not axis.at.sound("rated_torque"):
                continue
            if rated is None:
                yield case.error(
                    at.of(key),
                    f"axis {axis.name}: {key} in [{at.name}] needs rated_torque",
                    "drives count torque in 0.1 % of their rated torque",
                    f"add rated_torque in N·m to [axes.{axis.name}] (the drive's 6076h has it in mN·m), or delete {key}",
                )
            elif value / rated * 1000 >= _TORQUE_TYPES[key].range[1] + 0.5:
                yield case.error(
                    at.of(key),
                    f"axis {axis.name}: {key} in [{at.name}] is beyond the range of the drive's object",
                    f"{value:g} is {value / rated * 1000:g} in 0.1 % of rated_torque; "
                    f"{_TORQUE_TYPES[key].name} ends at {_TORQUE_TYPES[key].range[1]}",
                    f"lower {key}, or check rated_torque",
                )


_TORQUE_TYPES = {"max_torque": DataType.INTEGER16, "torque_slope": DataType.UNSIGNED32}


def homing_speeds(case: CheckContext) -> Problems:
    """Check that a homing method is one, and has the velocities that it needs, and warn of reserved methods."""
    for axis in case.cell.axes.values():
        given = axis.homing
        if given.method is None:
            continue
        line, at = given.at.of("method"), given.at
        if given.method == homing.NONE:
            yield case.error(
                line,
                f"axis {axis.name}: homing method 0 means that the drive has no homing method",
                "6098h: a drive with this value does not home (CiA 402-2 11.3)",
                "write the method that finds the home position, or delete the key",
            )
        if homing.describe(given.method) == "reserved":
            yield case.warning(
                line,
                f"axis {axis.name}: homing method {given.method} is reserved in CiA 402",
                "6098h: 1 to 14, 17 to 30, 33 to 35 and 37 are defined, negative ones are manufacturer-specific",
                "choose a defined one that the drive has",
            )
        for key in ("speed_switch", "speed_zero"):
            if homing.needs_speeds(given.method) and getattr(given, key) is None and at.sound(key):
                yield case.error(
                    line,
                    f"axis {axis.name}: homing method {given.method} moves, and {key} is missing",
                    f"it looks for: {homing.describe(given.method)}",
                    f"add {key} = ... ({axis.unit}/s) to [{at.name}]",
                )
        if given.speed_switch is not None and (given.speed_zero or 0) > given.speed_switch:
            yield case.warning(
                at.of("speed_zero"),
                f"axis {axis.name}: speed_zero is faster than speed_switch",
                f"{given.speed_zero:g} against {given.speed_switch:g} {axis.unit}/s",
                "the search for the zero is the slow one: exchange them",
            )


def in_drive(case: CheckContext) -> Problems:
    """Check which limits ``limits_in_drive`` can write into the drive, and note from when on they mean the same there."""
    for drive in case.drives:
        axis, writes = drive.axis, list(drive.written.values())
        if not axis.limits_in_drive:
            continue
        if not any((axis.position_limits, axis.max_velocity, axis.max_torque)):
            yield case.warning(
                axis.at.of(LIMITS_IN_DRIVE),
                f"axis {axis.name}: {LIMITS_IN_DRIVE} has no limit to write",
                f"[{axis.at.name}] has neither position_limits nor max_velocity nor max_torque",
                f"add one of them, or delete {LIMITS_IN_DRIVE}",
            )
        for limit in limits_left_out(axis, drive.dictionary, writes):
            yield case.warning(
                axis.at.of(limit.key),
                f"axis {axis.name}: {limit.key} cannot be left in the drive as {own_title(drive, limit.number)}",
                "the drive has no such object"
                if not drive.has(limit.number)
                else _WHY_NOT_SENT[limit.number],
                "only the master monitors it; without the master nothing does. Otherwise write the object in "
                f"[{axis.at.name}.objects]",
            )
        if axis.position_limits is not None:
            yield case.note(
                axis.at.of(LIMITS_IN_DRIVE),
                f"axis {axis.name}: 607Dh is relative to the drive's own zero",
                "it equals position_limits after the axis is homed; set_position is refused, because it would not shift it",
                "check that the drive ignores it while it searches its home",
            )
            yield from _shifted_by_home_offset(case, drive)


def _shifted_by_home_offset(case: CheckContext, drive: Drive) -> Problems:
    """Warn of limits in the drive that the home offset may shift (CiA 402-2, 607Dh: it is relative to home, not to zero)."""
    axis = drive.axis
    offset = drive.number(objects.HOME_OFFSET)
    if offset:
        yield case.warning(
            axis.at.of(LIMITS_IN_DRIVE),
            f"axis {axis.name}: the home offset may shift the position limits in the drive",
            f"{own_title(drive, objects.HOME_OFFSET)} is {counted(offset, 'increment')}; a drive that follows CiA 402-2 subtracts "
            "it from 607Dh: it then stops the axis before one limit, and lets it pass the other",
            f"set the home offset to 0 (offset in [axes.{axis.name}.homing]) and give the limits relative to home, or delete "
            f"{LIMITS_IN_DRIVE}; keep both only if the drive's manual says that 607Ch does not change 607Dh",
        )


def promised(case: CheckContext) -> Problems:
    """Report in which mode each limit is kept, and how; a warning if it is not kept."""
    for drive in case.drives:
        axis = drive.axis
        if not axis.at.sound("unit", "scale", "velocity_scale", "acceleration_scale"):
            continue
        found = promises(axis_parameters(case.cell, axis.name, drive.eds))
        for limit in dict.fromkeys(each.limit for each in found):
            of_limit = [each for each in found if each.limit == limit]
            open_ = [each for each in of_limit if each.remedy]
            report = case.warning if open_ else case.note
            yield report(
                axis.at.of(limit),
                f"axis {axis.name}: {limit} "
                + ("is not kept in every mode" if open_ else "is kept as follows"),
                "; ".join(text for _, text in rows(of_limit)),
                "; ".join(dict.fromkeys(each.remedy for each in open_)),
            )


_WHY_NOT_SENT = {
    objects.SOFTWARE_POSITION_LIMIT: "it has only a part of it",
    objects.MAX_PROFILE_VELOCITY: "it is less than one increment of the drive's velocity",
    objects.MAX_MOTOR_SPEED: "the increments per revolution of the motor are not known: 608Fh and scale do not agree",
    objects.MAX_TORQUE: "it is less than 0.1 % of rated_torque, or that is missing",
}


CHECKS: tuple[Check, ...] = (
    beyond_maximum, modulo_with_limits, virtual_outside, invert, torque, homing_speeds, in_drive, promised,
)  # fmt: skip


# -- Report the tolerances for standstill and following that result from an axis's numbers -----------------------------


_WITHOUT_DEMAND = (
    "in pp an axis that does not follow is detected by the drive's own monitoring, or by the time limit of its move; at "
    "standstill its position is monitored"
)
# Increments per second at the highest speed. Positions are compared for at most 0.3 s, in which noise hides a change of less than 3
# increments. So with fewer increments more than a sixth of the highest speed may look like standstill.
_COARSE = 60.0
_STAYS = (
    "position limits, standstill, set-points streamed by the master and the drive's own following error (6065h, 6066h) are "
    "still monitored"
)


def allowances(case: CheckContext) -> Problems:
    """Note each axis's standstill window and allowed lag, if ``standstill_window`` or ``following_error`` is left out."""
    for drive in case.drives:
        axis = drive.axis
        if not axis.at.sound("scale", "velocity_scale", "acceleration_scale"):
            continue
        if axis.standstill_window is not None and axis.following_error not in (None, math.inf):
            continue
        parameters = axis_parameters(case.cell, axis.name, case.eds[axis.node])
        window = parameters.pull_window / abs(parameters.units.position.factor)
        yield case.note(
            axis.at.line,
            f"axis {axis.name} is at standstill within {window:.4g} {axis.unit} of the demand of its drive, and may lag "
            f"{_lag(axis)} in a motion",
            f"{_why(axis)}; beyond both it is stopped (jammed, slipping, moving without a command)",
        )


def _lag(axis: AxisConfig) -> str:
    if axis.following_error not in (None, math.inf):
        return f"{axis.following_error:g} {axis.unit}"
    return "the distance of 0.25 s"


def _why(axis: AxisConfig) -> str:
    if axis.standstill_window is not None:
        return (
            "following_error is not set; the drive's own 6065h is used in position modes, if boot reads one"
        )
    if axis.position_window is not None:
        return "standstill_window is not set: ten times position_window"
    if axis.max_velocity is not None:
        return (
            "standstill_window is not set: the distance of 10 ms at max_velocity, or ten times the drive's 6067h if boot "
            "reads one"
        )
    return (
        "neither standstill_window nor position_window nor max_velocity is set: the distance of 10 ms at the default "
        "velocity"
    )


def coarse_positions(case: CheckContext) -> Problems:
    """Warn of an axis whose positions have too few increments to show a slow motion."""
    for drive in case.drives:
        axis = drive.axis
        if not axis.at.sound("unit", "scale", "velocity_scale", "max_velocity"):
            continue
        parameters = axis_parameters(case.cell, axis.name, case.eds[axis.node])
        speed, unit = highest_speed(axis, parameters.units), abs(parameters.units.position.factor)
        if not parameters.units.ratio_known or not 0.0 < speed < _COARSE:
            continue
        unseen = (parameters.standstill_tolerance + 1.0) / parameters.timing.standstill_time / unit
        line = axis.defaults.at.of("velocity") if axis.max_velocity is None else axis.at.of("max_velocity")
        yield case.warning(
            line,
            f"axis {axis.name}: its positions cannot show a slow motion",
            f"at {speed / unit:g} {axis.unit}/s its position changes by {speed:g} increments per second, and up to {unseen:.3g} "
            f"{axis.unit}/s look like standstill",
            "use an encoder with more increments, or mount it before the gear; check scale. Otherwise expect that a stop of this "
            "axis is reported while it still moves slowly",
        )


def by_sight(case: CheckContext) -> Problems:
    """Warn if the set-point handshake relies on the axis's observed motion, but the drive lacks the objects to observe it."""
    for drive in case.drives:
        axis = drive.axis
        missing = drive.missing((objects.POSITION_ACTUAL, objects.POSITION_DEMAND))
        if axis.handshake != Handshake.ON_CHANGE.value or not missing:
            continue
        yield case.warning(
            axis.at.of("handshake"),
            f'axis {axis.name}: with handshake = "on-change" the master judges a move by the observed motion of the axis, and '
            f"{titles(missing)} {'is' if len(missing) == 1 else 'are'} missing",
            _unseen(missing),
            f"if its bit 12 works, {_instead(axis, 'handshake', 'acknowledge')}",
        )


def _instead(axis: AxisConfig, key: str, default: str) -> str:
    """Return how to get the default of a key that the cell file gives, or the make of the drive."""
    if axis.at.gives(key):
        return f"leave {key} out of [axes.{axis.name}]"
    return f'write {key} = "{default}" in [axes.{axis.name}]; now its make sets {key}'


def _unseen(missing: tuple[int, ...]) -> str:
    if objects.POSITION_ACTUAL in missing:
        return (
            "without 6064h only bit 10 is available: a move that replaces another in motion cannot be distinguished from "
            "it, and fails"
        )
    return "without 6062h it is not known whether a halted drive still pulls to its old target: only 607Ah can be read back"


def demands(case: CheckContext) -> Problems:
    """Report each axis whose 6062h is not used, entirely or in motion, or whose drive lacks it although ``demand`` is "use"."""
    for drive in case.drives:
        axis, name = drive.axis, drive.axis.name
        missing = bool(drive.missing((objects.POSITION_DEMAND,)))
        if axis.demand == DemandUse.USE.value and missing:
            yield case.warning(
                axis.at.of("demand"),
                f'axis {name}: demand = "use", and its drive has no 6062h (position demand value)',
                "the demand is then known only in the modes in which the master sends the targets",
                f"{_instead(axis, 'demand', 'auto')}, or use an EDS that has 6062h",
            )
        if axis.demand == DemandUse.IGNORE.value:
            yield case.note(
                axis.at.of("demand"),
                f'axis {name}: 6062h is not used (demand = "ignore")',
                f"{_WITHOUT_DEMAND}; {_STAYS}",
            )
        elif axis.following_error == math.inf:
            yield case.note(
                axis.at.of("following_error"),
                f'axis {name}: in motion it is not compared with 6062h (following_error = "off")',
                _STAYS,
            )


WINDOW_CHECKS: tuple[Check, ...] = (allowances, coarse_positions, by_sight, demands)
