"""Check that the two axes of ``[gantries.NAME]`` can carry one beam: their kind, their common settings, and their drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from axisbus.cell.model import AxisConfig, GantryConfig
from axisbus.check.context import Check, CheckContext, Problems, title
from axisbus.check.modes import no_csp
from axisbus.cia402 import objects
from axisbus.cia402.touch_probe import POSITIONS, Edge

_CYCLES = 2.0  # cycles by which the feedback of the two drives may differ in age
_SYNCHRONOUS = range(241)

Pair = tuple[GantryConfig, AxisConfig, AxisConfig]


def _pairs(case: CheckContext) -> Iterator[Pair]:
    """Yield the pairs whose two axes exist."""
    for gantry in case.cell.gantries.values():
        if (
            gantry.at.sound("axes")
            and len(set(gantry.axes)) == 2
            and set(gantry.axes) <= case.cell.axes.keys()
        ):
            first, second = (case.cell.axes[name] for name in gantry.axes)
            yield gantry, first, second


def _driven(case: CheckContext) -> Iterator[Pair]:
    """Yield the pairs whose two axes have a drive."""
    return (pair for pair in _pairs(case) if not (pair[1].virtual or pair[2].virtual))


def axes_are_there(case: CheckContext) -> Problems:
    """Check that each pair has two axes of the cell, and that no axis is in two pairs."""
    owners: dict[str, str] = {}
    for gantry in case.cell.gantries.values():
        line = gantry.at.of("axes")
        for name in gantry.axes:
            if name not in case.cell.axes:
                known = ", ".join(case.cell.axes) or "none"
                message = f"gantry {gantry.name} has the axis {name!r}, which the cell does not have"
                yield case.error(
                    line, message, f"axes of the cell: {known}", f"add [axes.{name}], or correct the name"
                )
            other = owners.setdefault(name, gantry.name)
            if other != gantry.name:
                message = f"axis {name} is in two pairs: [gantries.{other}] and [gantries.{gantry.name}]"
                yield case.error(line, message, remedy="an axis carries one beam: remove it from one of them")
        if len(gantry.axes) == 2 and len(set(gantry.axes)) == 1:
            message = f"gantry {gantry.name} has the axis {gantry.axes[0]!r} twice"
            yield case.error(line, message, remedy="name the two axes that carry the beam")


def can_move_load(case: CheckContext) -> Problems:
    """Check that both axes have a drive, are not endless, and have one unit."""
    for gantry, *axes in _pairs(case):
        line = gantry.at.of("axes")
        for axis in axes:
            if axis.virtual:
                kind = "virtual" if axis.encoder is None else "an encoder"
                message = f"axis {axis.name} of gantry {gantry.name} is {kind}: it has no drive that could carry a beam"
                yield case.error(line, message, remedy="name two axes that have a drive")
            if axis.modulo is not None:
                message = f"axis {axis.name} of gantry {gantry.name} is endless (modulo)"
                observed = "positions that restart at each turn do not give the skew of the beam"
                yield case.error(line, message, observed, f"leave modulo out of [axes.{axis.name}]")
        first, second = axes
        if first.unit != second.unit and first.at.sound("unit") and second.at.sound("unit"):
            message = f"the axes of gantry {gantry.name} have different units"
            observed = f"{first.name} has {first.unit}, {second.name} has {second.unit}"
            yield case.error(
                line, message, observed, "give both the same unit: max_skew and all moves are in it"
            )


# Settings that should be equal for both: the key, the consequence of a difference, the value.
_EQUAL_SETTINGS: tuple[tuple[str, str, Callable[[AxisConfig], Any]], ...] = (
    ("scale", "is that so, by two different gears? Else every move bends the beam", lambda axis: axis.scale),
    (
        "deceleration",
        "a quick stop brakes each with its own deceleration, and bends the beam",
        lambda axis: axis.stop.deceleration,
    ),
    (
        "quick_stop",
        "a quick stop brakes each with its own ramp, and bends the beam",
        lambda axis: axis.stop.quick_stop,
    ),
    ("fault", "their drives react differently to a fault", lambda axis: axis.stop.fault),
    ("holds_load", "one may coast while the other is held", lambda axis: axis.holds_load),
)
_SMALLER: tuple[tuple[str, Callable[[AxisConfig], Any]], ...] = (
    ("position_limits", lambda axis: axis.position_limits),
    ("max_velocity", lambda axis: axis.max_velocity),
    ("max_acceleration", lambda axis: axis.max_acceleration),
)


def equal_settings(case: CheckContext) -> Problems:
    """Warn of settings that make the axes of a pair behave differently; note limits that differ: the smaller one applies."""
    for gantry, first, second in _driven(case):
        for key, why, value in _EQUAL_SETTINGS:
            a, b = value(first), value(second)
            if a != b:
                message = f"the axes of gantry {gantry.name} have different values of {key}"
                observed = f"{first.name} has {_value_text(a)}, {second.name} has {_value_text(b)}: {why}"
                yield case.warning(gantry.at.of("axes"), message, observed, "give both the same")
        for key, value in _SMALLER:
            a, b = value(first), value(second)
            if a != b:
                message = f"the axes of gantry {gantry.name} have different {key}"
                observed = (
                    f"{first.name} has {_value_text(a)}, {second.name} has {_value_text(b)}: the lower limit of each applies to "
                    "the beam"
                )
                yield case.note(gantry.at.of("axes"), message, observed)


def _value_text(value: Any) -> str:
    return "none" if value is None else str(value)


def in_groups(case: CheckContext) -> Problems:
    """Warn of groups with only one axis of a pair: the group's motions are refused, and its stop stops both axes."""
    for gantry, first, second in _driven(case):
        for group in case.cell.groups.values():
            if (first.name in group.axes) != (second.name in group.axes):
                yield case.warning(
                    group.at.of("axes"),
                    f"group {group.name} contains one axis of gantry {gantry.name}, and not the other",
                    "its motions are refused: the axes of the pair may only move together",
                    "name both axes, so that a failure in the group stops both, or name neither",
                )


def in_step(case: CheckContext) -> Problems:
    """Check that both axes can be commanded in each cycle; warn if their feedback comes at different rates or too seldom."""
    period = case.cell.bus.scan_period
    drives = case.drive_of
    for gantry, *axes in _driven(case):
        line = gantry.at.of("axes")
        if not case.cell.bus.sync:
            message = f"gantry {gantry.name} cannot be moved: the bus has no SYNC"
            yield case.error(line, message, "both follow one set-point in csp", "set sync = true in [bus]")
        for axis in axes:
            drive = drives.get(axis.name)
            why = "" if drive is None else no_csp(drive)
            if why:
                message = f"gantry {gantry.name} cannot be moved: axis {axis.name} cannot run csp"
                yield case.error(
                    line, message, why, "both follow one set-point in csp: use a drive that has csp"
                )
        paces = [_paces(case, axis) for axis in axes]
        if paces[0] != paces[1]:
            message = f"the drives of gantry {gantry.name} send their TPDOs at different rates"
            observed = f"transmission of synchronous TPDOs: {paces[0] or 'as planned'} and {paces[1] or 'as planned'}"
            yield case.warning(line, message, observed, "give both the same transmission in [nodes.N.pdo]")
        fastest = min((axis.max_velocity for axis in axes if axis.max_velocity is not None), default=None)
        if (
            fastest is not None
            and gantry.at.sound("max_skew")
            and gantry.max_skew < _CYCLES * period * fastest
        ):
            distance = _CYCLES * period * fastest
            message = f"max_skew of gantry {gantry.name} is less than its axes move in two cycles"
            observed = (
                f"{distance:g} at max_velocity: feedback of one drive that is two cycles late would stop both"
            )
            yield case.warning(
                gantry.at.of("max_skew"), message, observed, "allow more, or make the scan faster"
            )


def _paces(case: CheckContext, axis: AxisConfig) -> list[int]:
    node = case.cell.nodes.get(axis.node)
    found = [pdo.transmission for pdo in (node.pdos if node else ()) if not pdo.receive]
    return sorted(each for each in found if each is not None and each in _SYNCHRONOUS)


def homing(case: CheckContext) -> Problems:
    """Check that the drives of a pair that is homed by switches have touch probes, and that the homing velocity is allowed."""
    drives = case.drive_of
    for gantry, *axes in _driven(case):
        plan = gantry.homing
        if plan is None:
            if not any(axis.at.sound("homing") and axis.homing.required is False for axis in axes):
                message = f"gantry {gantry.name} has no homing"
                remedy = f"add [gantries.{gantry.name}.homing], or use set_position(...)"
                yield case.note(gantry.at.line, message, "[gantries.NAME.homing] is missing", remedy)
            continue
        switched = axes if plan.switches == "each" else axes[:1]
        for axis in switched:
            drive = drives.get(axis.name)
            if drive is None or not plan.at.sound("input", "edge"):
                continue
            needed = (
                objects.TOUCH_PROBE_FUNCTION,
                objects.TOUCH_PROBE_STATUS,
                POSITIONS[plan.input, Edge(plan.edge)],
            )
            missing = drive.missing(needed)
            if missing:
                message = f"gantry {gantry.name} cannot be homed: the drive of {axis.name} has no touch probe"
                observed = f"its EDS lacks {', '.join(title(index) for index in missing)}"
                yield case.error(
                    plan.at.line, message, observed, "use absolute encoders, or set_position(...)"
                )
        for axis in axes:
            if (
                axis.max_velocity is not None
                and plan.at.sound("velocity")
                and plan.velocity > axis.max_velocity
            ):
                message = f"gantry {gantry.name} is homed faster than axis {axis.name} allows"
                observed = f"max_velocity is {axis.max_velocity:g}"
                yield case.error(plan.at.of("velocity"), message, observed, "home more slowly")


CHECKS: tuple[Check, ...] = (axes_are_there, can_move_load, equal_settings, in_groups, in_step, homing)
