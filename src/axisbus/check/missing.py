"""Report missing keys, and the consequences for the user."""

from __future__ import annotations

from axisbus.cell.model import INCREMENTS
from axisbus.cell.parameters import homing_required, modes
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia402.modes import ModeOfOperation
from axisbus.units import INT32_HALF
from axisbus.wording import counted

_M = ModeOfOperation


def defaults(case: CheckContext) -> Problems:
    """Warn of missing defaults, without which commands need arguments."""
    for axis in case.cell.axes.values():
        if axis.encoder is not None:
            continue  # no command moves it
        given = axis.defaults
        missing = [
            key for key in ("velocity", "acceleration") if getattr(given, key) is None and given.at.sound(key)
        ]
        if missing:
            commands = "moves" if "velocity" in missing else "moves, move_velocity and jog"
            yield case.warning(
                given.at.line,
                f"axis {axis.name} has no default {' and '.join(missing)}",
                f"every call of {commands} must give {'them' if len(missing) > 1 else 'it'}"
                + (
                    "; move_velocity and jog must give acceleration"
                    if missing == ["velocity", "acceleration"]
                    else ""
                ),
                f"add {', '.join(f'{key} = ...' for key in missing)} to [axes.{axis.name}.defaults]",
            )


def rated_torque(case: CheckContext) -> Problems:
    """Note axes whose only obstacle to torque control is a missing ``rated_torque``."""
    for drive in case.drives:
        axis = drive.axis
        if _M.PROFILE_TORQUE in modes(drive) and axis.rated_torque is None and axis.at.sound("rated_torque"):
            yield case.note(
                axis.at.line,
                f"axis {axis.name}: torque_control needs rated_torque, which is missing",
                "the drive has profile torque mode; without it, torques are read in parts of the rated one",
                f"add rated_torque in N·m to [axes.{axis.name}]",
            )


def homing(case: CheckContext) -> Problems:
    """Warn of an axis that must be homed but has no homing method."""
    for axis in case.cell.axes.values():
        if (
            homing_required(axis)
            and not any(axis.name in gantry.axes for gantry in case.cell.gantries.values())  # homed as a pair
            and axis.homing.method is None
            and axis.homing.at.sound("method", "required")
        ):
            why = (
                "required = true"
                if axis.homing.required
                else "position_limits are set, so moves wait for homing"
            )
            yield case.warning(
                axis.homing.at.line,
                f"axis {axis.name} must be homed before absolute moves, and has no homing method",
                why,
                f"add method = ... to [axes.{axis.name}.homing], give it in home(method), or for an absolute encoder "
                "write required = false",
            )


def scales(case: CheckContext) -> Problems:
    """Warn of a default acceleration scale beside a velocity scale that differs; an error if the axis has position limits."""
    for axis in case.cell.axes.values():
        if axis.velocity_scale is None or axis.acceleration_scale is not None:
            continue
        if axis.velocity_scale != (axis.scale or 1) and axis.at.sound("scale", "acceleration_scale"):
            report = case.warning if axis.position_limits is None else case.error
            yield report(
                axis.at.of("velocity_scale"),
                f"axis {axis.name}: velocity has its own scale, acceleration uses that of position",
                f"velocity_scale is {float(axis.velocity_scale):g}, acceleration is converted by "
                f"{float(axis.scale or 1):g} increments per {axis.unit}",
                "drives with another velocity unit mostly have another acceleration unit too, and braking before "
                "position_limits uses it: write acceleration_scale",
            )


def increments(case: CheckContext) -> Problems:
    """Note axes in increments whose deadlines cannot be derived."""
    for axis in case.cell.driven.values():
        if axis.unit == INCREMENTS and axis.velocity_scale is None and axis.at.sound("unit"):
            yield case.note(
                axis.at.of("unit"),
                f"axis {axis.name}: without velocity_scale a move is monitored by progress instead of a time limit",
                "how the drive's velocity increments relate to position increments is not known",
                "write velocity_scale: the drive's velocity increments for 1 position increment/s",
            )


def resolution(case: CheckContext) -> Problems:
    """Note the resolution of a virtual axis without ``scale``."""
    for axis in case.cell.axes.values():
        if not axis.virtual or axis.unit == INCREMENTS or axis.at.gives("scale") or not axis.at.sound("unit"):
            continue
        per_unit = float(axis.scale or 1)
        yield case.note(
            axis.at.line,
            f"virtual axis {axis.name} counts {counted(round(per_unit), 'increment')} per {axis.unit}, because scale is left out",
            f"one move may be up to {INT32_HALF / per_unit:.6g} {axis.unit}, and as many in a second",
            f"scale = ... in [{axis.at.name}] makes it finer, or allows longer moves",
        )


CHECKS: tuple[Check, ...] = (defaults, rated_torque, homing, scales, increments, resolution)
