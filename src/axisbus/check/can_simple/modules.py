"""Check that a module that speaks CAN Simple can share the bus with the other nodes, and can serve its axis."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cell.can_simple.module import CANOPEN, MODBUS, READERS, TORQUE, ModuleConfig
from axisbus.cell.can_simple.modules import is_line, list_of
from axisbus.cell.model import AxisConfig, NodeConfig
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.drives.gim6010.can_simple.coexistence import clashes, free_nodes
from axisbus.drives.gim6010.can_simple.identifier import NODES
from axisbus.drives.gim6010.can_simple.verified_endpoints import Firmware
from axisbus.drives.gim6010.modbus.registers import RATES
from axisbus.errors import ArgumentError, LimitError

_FOREIGN = Firmware(0, 6, 8)  # from here on another protocol was seen, with identifiers of 29 bits
_SHOWN = 3
_ON_LINE = range(1, 64)
_NOT_ON_LINE = (*TORQUE[1:], "filter_bandwidth")


def _modules(case: CheckContext) -> Iterator[tuple[NodeConfig, ModuleConfig]]:
    for node in case.cell.nodes.values():
        if node.module is not None:
            yield node, node.module


def identifiers(case: CheckContext) -> Problems:
    """Check that no identifier is used by a module and a CANopen node (manual v2.2, 4.1.4)."""
    canopen = [node.node_id for node in case.cell.nodes.values() if node.protocol == CANOPEN]
    if case.cell.bus.master_id:
        canopen.append(case.cell.bus.master_id)
    for node, _ in _modules(case):
        if node.node_id not in NODES:
            yield case.error(
                node.at.line,
                f"node {node.node_id} is not a node ID of CAN Simple",
                "",
                "they are from 0 to 63",
            )
            continue
        found = clashes([node.node_id], canopen)
        if found:
            shown = "; ".join(map(str, found[:_SHOWN])) + ("; ..." if len(found) > _SHOWN else "")
            free = ", ".join(map(str, free_nodes(canopen)[:_SHOWN])) or "none besides these nodes"
            yield case.error(
                node.at.line,
                f"[nodes.{node.node_id}] conflicts with the CANopen nodes of the cell: identifiers have two owners",
                shown,
                f"give it another node ID (free: {free}), or the CANopen nodes higher ones",
            )


def firmware(case: CheckContext) -> Problems:
    """Check that the module's firmware speaks CAN Simple."""
    for node, _ in _modules(case):
        try:
            version = None if node.firmware is None else Firmware.parse(node.firmware)
        except ArgumentError as error:
            yield case.error(node.at.of("firmware"), error.message, "", error.remedy)
            continue
        if version is not None and version >= _FOREIGN:
            yield case.warning(
                node.at.of("firmware"),
                f"[nodes.{node.node_id}] possibly does not use CAN Simple",
                f"some modules with firmware {version} use a protocol with identifiers of 29 bits",
                "check which frames it sends: axisbus trace",
            )


def settings(case: CheckContext) -> Problems:
    """Check that the cell file is complete for the module's port, and complete for torques."""
    for node, module in _modules(case):
        axes = list(case.cell.axes_of(node.node_id))
        if len(axes) > 1 or any(axis.drive_axis != 1 for axis in axes):
            yield case.error(
                node.at.line, f"[nodes.{node.node_id}] is a module with one axis", "", "leave the others out"
            )
        for axis in axes[:1] if module.at.sound(*READERS) else ():
            yield from _of_axis(case, node, module, axis)


def _of_axis(case: CheckContext, node: NodeConfig, module: ModuleConfig, axis: AxisConfig) -> Problems:
    try:
        module.settings(
            node.node_id,
            axis.rated_torque,
            case.cell.bus.scan_period,
            axis.stop.quick_stop,
            relayed=node.protocol == MODBUS,
        )
    except (ArgumentError, LimitError) as error:
        yield case.error(
            node.at.line,
            f"[nodes.{node.node_id}.{node.protocol}]: {error.message}",
            error.observed,
            error.remedy,
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


def endpoints(case: CheckContext) -> Problems:
    """Check that the named list of endpoints is valid and belongs to the module's firmware."""
    for node, module in _modules(case):
        try:
            list_of(node, case.cell.folder)
        except ArgumentError as error:
            yield case.error(
                module.at.of("endpoints"),
                f"[nodes.{node.node_id}.{node.protocol}]: {error.message}",
                error.observed,
                error.remedy,
            )


def line(case: CheckContext) -> Problems:
    """Check that a serial line has only modules that speak Modbus, and that these have the settings that they need."""
    bus = case.cell.bus
    on_line = is_line(bus)
    if on_line and bus.bitrate is not None and bus.bitrate not in RATES:
        yield case.error(
            bus.at.of("bitrate"),
            f"{bus.bitrate} bit/s is not a bit rate of a module on RS485",
            "",
            f"there are {', '.join(map(str, RATES))}",
        )
    for node in case.cell.nodes.values():
        if (node.protocol == MODBUS) != on_line:
            yield case.error(
                node.at.line,
                f'[nodes.{node.node_id}] has the protocol {node.protocol}, and [bus] has interface = "{bus.interface}"',
                "",
                'interface = "modbus" is a serial line, whose nodes have protocol = "modbus", and only these',
            )
        elif on_line and node.module is not None:
            yield from _on_line(case, node, node.module)


def _on_line(case: CheckContext, node: NodeConfig, module: ModuleConfig) -> Problems:
    name = f"[nodes.{node.node_id}.{MODBUS}]"
    if node.node_id not in _ON_LINE:
        yield case.error(
            node.at.line,
            f"node {node.node_id} is not a node ID of a module on RS485",
            "",
            "they are from 1 to 63: 0 is the broadcast address, which no module answers",
        )
    if module.endpoints is None:
        yield case.error(
            node.at.line,
            f"{name} names no list of endpoints",
            "no register contains the position of an idle rotor",
            'endpoints = "endpoints_0.5.13.json", the manufacturer\'s list for its firmware',
        )
    for key in _NOT_ON_LINE:
        if getattr(module, key) is not None:
            yield case.error(
                module.at.of(key),
                f"{name} has {key}, which does not exist on RS485",
                "its modes are set only in idle: an axis has profile position and homing",
                f"leave {key} out; torques and velocities: axisbus gim6010 modbus",
            )
    for axis in case.cell.axes_of(node.node_id):
        if axis.stop.quick_stop is not None and axis.stop.quick_stop.endswith("-hold"):
            yield case.error(
                axis.at.line,
                f"axis {axis.name} is configured to hold after a quick stop, and on RS485 it cannot",
                "a quick stop brakes by velocity 0; a module changes back to positions only in idle",
                'leave quick_stop out of its [stop], or write quick_stop = "ramp"',
            )


CHECKS: tuple[Check, ...] = (identifiers, firmware, settings, endpoints, line)
