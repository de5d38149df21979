"""Check the references between the parts of a cell: nodes, axes, groups."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable
from difflib import get_close_matches

from axisbus.cell.model import GroupConfig
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.errors import AdapterError


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
_KNOWN = frozenset(
    {"sim", "modbus", "socketcan", "virtual", "pcan", "kvaser", "slcan", "gs_usb", "ixxat", "vector"}
)


def interface(case: CheckContext) -> Problems:
    """Check that python-can knows the interface, and that the required channel is given."""
    bus = case.cell.bus
    if not bus.at.sound("interface", "channel"):
        return
    if bus.interface not in _KNOWN:
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
