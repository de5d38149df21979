"""Check that the axis of a module uses only the functions of its port, and warn of its dangers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace

from axisbus.cell.axis_description import Drive
from axisbus.cell.can_simple.drive import drive_of
from axisbus.cell.can_simple.module import READERS
from axisbus.cell.can_simple.modules import modules_of, settings_of
from axisbus.cell.cyclic_modes import feed_forward
from axisbus.cell.model import SIMULATED
from axisbus.check import limits, modes, monitoring_windows, ranges
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.check.ids.table import id_of
from axisbus.cia402 import homing, options
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import description
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, LimitError

_OPTIONS = {option.index: option for option in options.ALL}
_NO_WIRE = frozenset({SIMULATED, "virtual"})


def _described(case: CheckContext) -> Mapping[int, Eds]:
    """Return the descriptions (EDS) that the ports make of the modules, for modules with usable tables."""
    found: dict[int, Eds] = {}
    for node_id in modules_of(case.cell):
        module = case.cell.nodes[node_id].module
        if module is not None and module.at.sound(*READERS):
            with suppress(ArgumentError, LimitError):
                found[node_id] = description(settings_of(case.cell, node_id))
    return found


def _drives(case: CheckContext) -> Iterator[Drive]:
    described = _described(case)
    for axis in case.cell.axes.values():
        if axis.at.sound("node", "drive_axis") and axis.node in described:
            yield drive_of(case.cell, axis)


def as_drives(case: CheckContext) -> Problems:
    """Apply the checks of any drive that do not depend on PDOs."""
    inner = CheckContext(case.cell, _described(case))
    for check in (*limits.CHECKS, *modes.CHECKS, *ranges.CHECKS, *monitoring_windows.CHECKS):
        if inner.drives:
            yield from (replace(problem, rule=id_of(check)) for problem in check(inner))


def writes(case: CheckContext) -> Problems:
    """Check that a module can take the values for its drive objects: its reactions and its own ramp are constant."""
    for drive in _drives(case):
        objects = ModulePort(settings_of(case.cell, drive.axis.node)).objects
        for write in drive.written.values():
            if not isinstance(write.value, int) or objects.write(write.index, write.subindex, write.value):
                is_so = objects.constant(write.index, write.subindex)
                yield case.error(
                    write.line,
                    f"{write.source} cannot be set in a module with CAN Simple",
                    f"it has no such object, or an object with a fixed value{_words(write.index, is_so)}",
                    "leave it out, or give the behaviour of the module; docs/gim6010-8.md has its stop sequence",
                )


def _words(index: int, value: int | None) -> str:
    if value is None:
        return ""
    option = _OPTIONS.get(index)
    return f": {value}" if option is None else f": {option.title} is {value}, {option.meaning(value)}"


def no_more(case: CheckContext) -> Problems:
    """Check that a module is not asked for functions that it lacks: inputs, outputs, and feed-forward."""
    for node_id in modules_of(case.cell):
        for point in case.cell.io_of(node_id):
            yield case.error(
                point.at.line,
                f"[io.{point.name}]: node {node_id} uses CAN Simple, and has no inputs and outputs",
                "",
                "leave it out, or give another node",
            )
    for drive in _drives(case):
        if feed_forward(drive.axis, None) is not None:
            yield case.error(
                drive.axis.feed_forward.at.line,
                f"axis {drive.axis.name}: a module with CAN Simple gets no feed-forward",
                "a feed-forward value would continue after the master is dead",
                "leave the table out",
            )


def in_place(case: CheckContext) -> Problems:
    """Check that the axis is homed at its present position: a module has no other homing methods."""
    for drive in _drives(case):
        given = drive.axis.homing
        if given.method is not None and given.method not in homing.IN_PLACE:
            yield case.error(
                given.at.of("method"),
                f"axis {drive.axis.name}: a module with CAN Simple does not have homing method {given.method}",
                "homing only shifts its count at the present position, and nothing is sent for it",
                f"write one of {', '.join(map(str, sorted(homing.IN_PLACE)))}",
            )


def dangers(case: CheckContext) -> Problems:
    """Warn that the motor coasts without power, and that nothing on a module notices a dead master."""
    bus = case.cell.bus
    for drive in _drives(case):
        name, line = drive.axis.name, drive.node.at.line
        yield case.warning(
            line,
            f"axis {name}: without power the motor coasts, and a fault switches the power off",
            "a module has no ramp for either",
            "do not attach a load that can fall or run away; a stop brakes it first",
        )
        own = bus.process != "thread"
        stops = "if the core has its own process, it stops the axis when the program or the core dies"
        yield case.warning(
            line,
            f"axis {name}: no function of its module is known to detect a dead master"
            + (
                ""
                if own or bus.interface in _NO_WIRE
                else ", and nothing stops it when this program is killed"
            ),
            f"a velocity or a torque continues; {stops}, and nothing stops it when the computer or the bus fails",
            "keep its speed and travel harmless, or cut its power by hardware that monitors the master"
            + ("" if own else '; process = "own" in [bus]'),
        )


CHECKS: tuple[Check, ...] = (as_drives, writes, no_more, in_place, dangers)
