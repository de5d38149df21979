"""Check the references between the parts of a cell: nodes, axes, groups."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable
from difflib import get_close_matches

from axisbus.cell.model import INCREMENTS, GroupConfig
from axisbus.cell.other_protocols import has_own_interface
from axisbus.cell.parameters import homing_required, modes
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import AdapterError
from axisbus.units import INT32_HALF
from axisbus.wording import counted


def master_id(case: CheckContext) -> Problems:
    """Check that no node has the master's node-ID."""
    bus = case.cell.bus
    if bus.at.sound("master_id") and bus.master_id in case.cell.nodes:
        line = case.cell.nodes[bus.master_id].at.line
        yield case.error(
            bus.at.of("master_id") if bus.at.gives("master_id") else line,
            f"master_id {bus.master_id} is the node ID of [nodes.{bus.master_id}] at line {line}",
            "the master's own heartbeat needs a node ID that no device has"
            + ("" if bus.at.gives("master_id") else "; without master_id it is 127"),
            f"write master_id = {_free(case)} in [bus]",
        )


def lost_nodes(case: CheckContext) -> Problems:
    """Warn of an ``on_lost`` of a node that has no effect, because other settings take precedence."""
    bus = case.cell.bus
    for node in case.cell.nodes.values():
        if not node.at.gives("on_lost") or not node.at.sound("on_lost"):
            continue
        by_axes = any(case.cell.axes_of(node.node_id))
        if by_axes or (bus.on_lost_node == "report" and node.on_lost == "stop"):
            yield case.warning(
                node.at.of("on_lost"),
                f"on_lost of [nodes.{node.node_id}] has no effect",
                "the node has axes"
                if by_axes
                else 'with on_lost_node = "report" in [bus] all axes continue after the loss of any node',
                "leave it out; on_lost_node in [bus] sets which axes stop after the loss of a node",
            )


# Interfaces that need no look-up in python-can, whose import takes a while.
_KNOWN = frozenset({"sim", "socketcan", "virtual", "pcan", "kvaser", "slcan", "gs_usb", "ixxat", "vector"})


def interface(case: CheckContext) -> Problems:
    """Check that python-can knows the interface, and that the required channel is given."""
    bus = case.cell.bus
    if not bus.at.sound("interface", "channel"):
        return
    if bus.interface not in _KNOWN and not has_own_interface(case.cell):
        from axisbus.bus.link.adapter import check_interface  # imported only here: see above

        try:
            check_interface(bus.interface)
        except AdapterError as error:
            yield case.error(bus.at.of("interface"), error.message, error.observed, error.remedy)
    if bus.interface == "socketcan" and bus.channel is None:
        yield case.error(
            bus.at.of("interface"),
            "socketcan needs to know which interface of the computer to use",
            "channel is missing in [bus]",
            'channel = "can0"',
        )


def process(case: CheckContext) -> Problems:
    """Check that the core can run in a process of its own, if the cell file asks for it."""
    bus = case.cell.bus
    if bus.process != "own" or not bus.at.sound("process", "interface"):
        return
    if sys.platform != "linux":
        why = f"it needs pidfd and memfd of Linux, which this platform ({sys.platform}) does not have"
    elif bus.interface == "virtual":
        why = "a bus of python-can's virtual interface exists in one process only"
    else:
        return
    yield case.error(
        bus.at.of("process"),
        "the core cannot run in a process of its own here",
        why,
        'write process = "thread", or leave it out',
    )


def axes_have_nodes(case: CheckContext) -> Problems:
    """Check that the node of each axis exists."""
    for axis in case.cell.driven.values():
        if axis.at.sound("node") and axis.node not in case.cell.nodes:
            known = ", ".join(str(node) for node in case.cell.nodes) or "none"
            yield case.error(
                axis.at.of("node"),
                f"axis {axis.name} is on node {axis.node}, which the cell does not have",
                f"nodes of the cell: {known}",
                f"add [nodes.{axis.node}] with its eds, or correct node",
            )


def nodes_have_axes(case: CheckContext) -> Problems:
    """Note nodes that no axis uses: correct for I/O, a mistake for a drive."""
    for node in case.cell.nodes.values():
        if not any(case.cell.axes_of(node.node_id)) and not any(case.cell.io_of(node.node_id)):
            yield case.note(
                node.at.line,
                f"node {node.node_id} has no axis",
                "it is booted and monitored, and never moved",
                f"for a drive add [axes.NAME] with node = {node.node_id}, for an I/O module [io.NAME]",
            )


def one_axis_each(case: CheckContext) -> Problems:
    """Check that no two axes are the same axis of the same device."""
    owners: dict[tuple[int, int], str] = {}
    for axis in case.cell.driven.values():
        if not axis.at.sound("node", "drive_axis"):
            continue
        other = owners.setdefault((axis.node, axis.drive_axis), axis.name)
        if other != axis.name:
            yield case.error(
                axis.at.of("drive_axis") if axis.at.gives("drive_axis") else axis.at.of("node"),
                f"axes {other} and {axis.name} are the same: axis {axis.drive_axis} of node {axis.node}",
                remedy=f"give {axis.name} another node, or drive_axis = {axis.drive_axis + 1} on a drive of several axes",
            )


def groups_have_axes(case: CheckContext) -> Problems:
    """Check that the axes of each group exist, each once."""
    for group in case.cell.groups.values():
        yield from _group(case, group)


def _group(case: CheckContext, group: GroupConfig) -> Problems:
    line = group.at.of("axes")
    for name in group.axes:
        if name not in case.cell.axes:
            near = get_close_matches(name, case.cell.axes, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            yield case.error(
                line,
                f"group {group.name} has the axis {name!r}, which the cell does not have",
                f"axes of the cell: {', '.join(case.cell.axes) or 'none'}",
                f"{hint}add [axes.{name}], or correct the name",
            )
    for name in _repeated(group.axes):
        yield case.error(
            line, f"group {group.name} has the axis {name!r} more than once", remedy="name it once"
        )


def axes_outside_groups(case: CheckContext) -> Problems:
    """Note axes in no group, because their faults stop the whole cell."""
    if not case.cell.groups:
        return
    for axis in case.cell.axes.values():
        if not any(case.cell.groups_of(axis.name)):
            yield case.note(
                axis.at.line,
                f"axis {axis.name} is in no group",
                "its faults stop the whole cell, while a fault in a group stops that group",
                f"add it to a group, or give it its own: [groups.{axis.name}_alone] axes = [{axis.name!r}]".replace(
                    "'", '"'
                ),
            )


def _repeated(names: Iterable[str]) -> list[str]:
    return [name for name, count in Counter(names).items() if count > 1]


def _free(case: CheckContext) -> int:
    return next(number for number in range(127, 0, -1) if number not in case.cell.nodes or number == 1)


CHECKS: tuple[Check, ...] = (
    master_id,
    lost_nodes,
    interface,
    process,
    axes_have_nodes,
    nodes_have_axes,
    one_axis_each,
    groups_have_axes,
    axes_outside_groups,
)


# -- Report missing keys, and the consequences for the user ------------------------------------------------------------


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


MISSING_KEY_CHECKS: tuple[Check, ...] = (defaults, rated_torque, homing, scales, increments, resolution)
