"""Whether a module that speaks CAN Simple can stand beside the nodes of a cell, and serve its axis."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cell.can_simple.lists import list_of
from axisbus.cell.can_simple.module import CAN_SIMPLE, READERS, TORQUE, ModuleConfig
from axisbus.cell.model import AxisConfig, NodeConfig
from axisbus.check.case import Case, Check, Found
from axisbus.drives.gim6010.can_simple.coexistence import clashes, free_nodes
from axisbus.drives.gim6010.can_simple.fitted import Firmware
from axisbus.drives.gim6010.can_simple.identifier import NODES
from axisbus.errors import ArgumentError, LimitError

_FOREIGN = Firmware(0, 6, 8)  # from here on another protocol was seen, of 29 bits
_SHOWN = 3


def _modules(case: Case) -> Iterator[tuple[NodeConfig, ModuleConfig]]:
    for node in case.cell.nodes.values():
        if node.module is not None:
            yield node, node.module


def identifiers(case: Case) -> Found:
    """Check that no identifier has two owners (manual v2.2, 4.1.4)."""
    canopen = [node.node_id for node in case.cell.nodes.values() if node.protocol != CAN_SIMPLE]
    if case.cell.bus.master_id:
        canopen.append(case.cell.bus.master_id)
    for node, _ in _modules(case):
        if node.node_id not in NODES:
            yield case.error(
                node.at.line, f"node {node.node_id} is no node ID of CAN Simple", "", "they go from 0 to 63"
            )
            continue
        found = clashes([node.node_id], canopen)
        if found:
            shown = "; ".join(map(str, found[:_SHOWN])) + ("; ..." if len(found) > _SHOWN else "")
            free = ", ".join(map(str, free_nodes(canopen)[:_SHOWN])) or "none beside these nodes"
            yield case.error(
                node.at.line,
                f"[nodes.{node.node_id}] cannot stand beside the CANopen nodes of the cell: identifiers have two owners",
                shown,
                f"give it another node ID (free: {free}), or the CANopen nodes higher ones",
            )


def firmware(case: Case) -> Found:
    """Check that its firmware is one that speaks CAN Simple."""
    for node, _ in _modules(case):
        try:
            version = None if node.firmware is None else Firmware.parse(node.firmware)
        except ArgumentError as error:
            yield case.error(node.at.of("firmware"), error.message, "", error.remedy)
            continue
        if version is not None and version >= _FOREIGN:
            yield case.warning(
                node.at.of("firmware"),
                f"[nodes.{node.node_id}] may not speak CAN Simple",
                f"with firmware {version} modules were seen that speak a protocol with identifiers of 29 bits",
                "look which frames it sends: axisbus trace",
            )


def settings(case: Case) -> Found:
    """Check that its port can be made of what the cell file says, and that torques have all that they need."""
    for node, module in _modules(case):
        axes = list(case.cell.axes_of(node.node_id))
        if len(axes) > 1 or any(axis.drive_axis != 1 for axis in axes):
            yield case.error(
                node.at.line, f"[nodes.{node.node_id}] is a module with one axis", "", "leave the others out"
            )
        for axis in axes[:1] if module.at.sound(*READERS) else ():
            yield from _of_axis(case, node, module, axis)


def _of_axis(case: Case, node: NodeConfig, module: ModuleConfig, axis: AxisConfig) -> Found:
    try:
        module.settings(node.node_id, axis.rated_torque, case.cell.bus.scan_period, axis.stop.quick_stop)
    except (ArgumentError, LimitError) as error:
        yield case.error(
            node.at.line, f"[nodes.{node.node_id}.can_simple]: {error.message}", error.observed, error.remedy
        )
    given = [key for key in TORQUE if getattr(module, key) is not None]
    if given and (len(given) < len(TORQUE) or axis.rated_torque is None):
        missing = [key for key in TORQUE if key not in given]
        missing += [] if axis.rated_torque is not None else [f"rated_torque in [axes.{axis.name}]"]
        yield case.warning(
            node.at.line,
            f"axis {axis.name} has no torques",
            f"{', '.join(given)} without {', '.join(missing)}",
            "give all of them, or none",
        )


def endpoints(case: Case) -> Found:
    """Check that the list of endpoints that it names is one, and for its firmware."""
    for node, module in _modules(case):
        try:
            list_of(node, case.cell.folder)
        except ArgumentError as error:
            yield case.error(
                module.at.of("endpoints"),
                f"[nodes.{node.node_id}.can_simple]: {error.message}",
                error.observed,
                error.remedy,
            )


CHECKS: tuple[Check, ...] = (identifiers, firmware, settings, endpoints)
