"""Report the tolerances for standstill and following that result from an axis's numbers."""

from __future__ import annotations

import math

from axisbus.cell.model import AxisConfig
from axisbus.cell.parameters import axis_parameters
from axisbus.check.context import Check, CheckContext, Problems, titles
from axisbus.cia402 import objects
from axisbus.motion.parameters import DemandUse, Handshake

_WITHOUT_DEMAND = (
    "in pp an axis that does not follow is detected by the drive's own monitoring, or by the time limit of its move; at "
    "standstill its position is monitored"
)
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


def by_sight(case: CheckContext) -> Problems:
    """Warn if the set-point handshake relies on the axis's observed motion, but the drive lacks the objects to observe it."""
    for drive in case.drives:
        axis = drive.axis
        missing = drive.missing((objects.POSITION_ACTUAL, objects.POSITION_DEMAND))
        if axis.handshake != Handshake.ON_CHANGE.value or not missing:
            continue
        yield case.warning(
            axis.at.of("handshake"),
            f'axis {axis.name}: with handshake = "on-change" a move is believed by what the axis is seen to do, and '
            f"{titles(missing)} {'is' if len(missing) == 1 else 'are'} missing",
            _unseen(missing),
            f"if its bit 12 works, leave handshake out of [axes.{axis.name}]",
        )


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
                f"leave demand out of [axes.{name}], or use an EDS that has 6062h",
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


CHECKS: tuple[Check, ...] = (allowances, by_sight, demands)
