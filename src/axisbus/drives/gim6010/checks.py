"""Check that a module that speaks CAN Simple can share the bus with the other nodes, and can serve its axis."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace

from axisbus.cell.axis_description import Drive
from axisbus.cell.cyclic_modes import feed_forward
from axisbus.cell.model import CANOPEN, SIMULATED, AxisConfig, NodeConfig
from axisbus.cell.problem import CellProblem
from axisbus.check import limits, modes, ranges
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.check.ids.table import id_of
from axisbus.cia301.tables import rows
from axisbus.cia402 import homing, options
from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.can_simple.identifier import NODES, clashes, free_nodes
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import description
from axisbus.drives.gim6010.cell import (
    LINE_MODES,
    MODBUS,
    READERS,
    TORQUE,
    ModuleConfig,
    drive_of,
    is_line,
    line_mode,
    list_of,
    module_of,
    modules_of,
    settings_of,
)
from axisbus.drives.gim6010.modbus.registers import RATES
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, LimitError

_FOREIGN = Firmware(0, 6, 8)  # from here on another protocol was seen, with identifiers of 29 bits
_SHOWN = 3
_ON_LINE = range(1, 64)
_HOMING = "hm"
_TEXTS = {row["key"]: row for row in rows(__package__, "check_texts.tsv")}


def _told(key: str, **values: object) -> tuple[str, str, str]:
    """Return message, observation and remedy of a finding, from ``check_texts.tsv``; ``values`` are those in its braces."""
    message, observed, remedy = (
        _TEXTS[key][each].format(**values) for each in ("message", "observed", "remedy")
    )
    return message, observed, remedy


def _modules(case: CheckContext) -> Iterator[tuple[NodeConfig, ModuleConfig]]:
    for node in case.cell.nodes.values():
        module = module_of(node)
        if module is not None:
            yield node, module


def identifiers(case: CheckContext) -> Problems:
    """Check that no identifier is used by a module and a CANopen node (manual v2.2, 4.1.4)."""
    canopen = [node.node_id for node in case.cell.nodes.values() if node.protocol == CANOPEN]
    if case.cell.bus.master_id:
        canopen.append(case.cell.bus.master_id)
    for node, _ in _modules(case):
        if node.node_id not in NODES:
            yield case.error(node.at.line, *_told("no_node_id", node=node.node_id))
            continue
        found = clashes([node.node_id], canopen)
        if found:
            shown = "; ".join(map(str, found[:_SHOWN])) + ("; ..." if len(found) > _SHOWN else "")
            free = ", ".join(map(str, free_nodes(canopen)[:_SHOWN])) or "none besides these nodes"
            yield case.error(node.at.line, *_told("clash", node=node.node_id, shown=shown, free=free))


def firmware(case: CheckContext) -> Problems:
    for node, _ in _modules(case):
        try:
            version = None if node.firmware is None else Firmware.parse(node.firmware)
        except ArgumentError as error:
            yield case.error(node.at.of("firmware"), error.message, "", error.remedy)
            continue
        if version is not None and version >= _FOREIGN:
            told = _told("foreign", node=node.node_id, version=version)
            yield case.warning(node.at.of("firmware"), *told)


def settings(case: CheckContext) -> Problems:
    """Check that the cell file is complete for the module's port, and complete for torques."""
    for node, module in _modules(case):
        axes = list(case.cell.axes_of(node.node_id))
        if len(axes) > 1 or any(axis.drive_axis != 1 for axis in axes):
            yield case.error(node.at.line, *_told("one_axis", node=node.node_id))
        for axis in axes[:1] if module.at.sound(*READERS) else ():
            yield from _of_axis(case, node, module, axis)


def _of_axis(case: CheckContext, node: NodeConfig, module: ModuleConfig, axis: AxisConfig) -> Problems:
    try:
        relayed = node.protocol == MODBUS
        module.settings(node.node_id, axis, case.cell.bus.scan_period, relayed=relayed)
    except (ArgumentError, LimitError) as error:
        yield _refused(case, node.at.line, node, error)
    given = [key for key in TORQUE if getattr(module, key) is not None]
    if given and (len(given) < len(TORQUE) or axis.rated_torque is None):
        missing = [key for key in TORQUE if key not in given]
        missing += [] if axis.rated_torque is not None else [f"rated_torque in [axes.{axis.name}]"]
        told = _told("no_torques", axis=axis.name, given=", ".join(given), missing=", ".join(missing))
        yield case.warning(node.at.line, *told)


def _refused(
    case: CheckContext, line: int, node: NodeConfig, error: ArgumentError | LimitError
) -> CellProblem:
    text = f"[nodes.{node.node_id}.{node.protocol}]: {error.message}"
    return case.error(line, text, error.observed, error.remedy)


def endpoints(case: CheckContext) -> Problems:
    """Check that the named list of endpoints is valid and belongs to the module's firmware."""
    for node, module in _modules(case):
        try:
            list_of(node, case.cell.folder)
        except ArgumentError as error:
            yield _refused(case, module.at.of("endpoints"), node, error)


def line(case: CheckContext) -> Problems:
    """Check that a serial line has only modules that speak Modbus, and that these have the settings that they need."""
    bus = case.cell.bus
    on_line = is_line(bus)
    if on_line and bus.bitrate is not None and bus.bitrate not in RATES:
        told = _told("bit_rate", rate=bus.bitrate, rates=", ".join(map(str, RATES)))
        yield case.error(bus.at.of("bitrate"), *told)
    for node in case.cell.nodes.values():
        if (node.protocol == MODBUS) != on_line:
            told = _told("protocol", node=node.node_id, protocol=node.protocol, interface=bus.interface)
            yield case.error(node.at.line, *told)
        elif on_line and (module := module_of(node)) is not None:
            yield from _on_line(case, node, module)


def _on_line(case: CheckContext, node: NodeConfig, module: ModuleConfig) -> Problems:
    name = f"[nodes.{node.node_id}.{MODBUS}]"
    if node.node_id not in _ON_LINE:
        yield case.error(node.at.line, *_told("no_device", node=node.node_id))
    if module.endpoints is None:
        yield case.error(node.at.line, *_told("no_list", name=name))
    if module.filter_bandwidth is not None:
        yield case.error(module.at.of("filter_bandwidth"), *_told("no_filter", name=name))
    for axis in case.cell.axes_of(node.node_id):
        yield from _modes_on_line(case, name, module, axis)
        if axis.stop.quick_stop is not None and axis.stop.quick_stop.endswith("-hold"):
            yield case.error(axis.at.line, *_told("no_hold", axis=axis.name))


def _modes_on_line(case: CheckContext, name: str, module: ModuleConfig, axis: AxisConfig) -> Problems:
    """Check that the axis has one mode beside homing, and that torque settings and torque mode come together."""
    others = set(axis.modes or ("pp",)) - {_HOMING}
    if len(others) != 1 or not others <= LINE_MODES.keys():
        told = _told("one_mode", axis=axis.name, modes=", ".join(axis.modes or ()) or "none")
        yield case.error(axis.at.of("modes"), *told)
    given = [key for key in TORQUE[1:] if getattr(module, key) is not None]
    has_torque = line_mode(axis.modes) is LINE_MODES["tq"]
    if given and not has_torque:
        told = _told("torque_without_mode", name=name, given=given[0], axis=axis.name)
        yield case.error(module.at.of(given[0]), *told)
    missing = [key for key in TORQUE if getattr(module, key) is None]
    missing += [] if axis.rated_torque is not None else [f"rated_torque in [axes.{axis.name}]"]
    if has_torque and missing:
        told = _told("mode_without_torque", axis=axis.name, name=name, missing=", ".join(missing))
        yield case.error(axis.at.of("modes"), *told)
    if has_torque and axis.max_velocity is None:
        yield case.error(axis.at.of("modes"), *_told("no_max_velocity", axis=axis.name))


# -- Check that the axis of a module uses only the functions of its port, and warn of its dangers ----------------------


_OPTIONS = {option.index: option for option in options.ALL}
_NO_WIRE = frozenset({SIMULATED, "virtual"})


def _described(case: CheckContext) -> Mapping[int, Eds]:
    """Return the descriptions (EDS) that the ports make of the modules, for modules with usable tables."""
    found: dict[int, Eds] = {}
    for node_id in modules_of(case.cell):
        module = module_of(case.cell.nodes[node_id])
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
    for check in (*limits.CHECKS, *modes.CHECKS, *ranges.CHECKS, *limits.WINDOW_CHECKS):
        if inner.drives:
            yield from (replace(problem, rule=id_of(check)) for problem in check(inner))


def writes(case: CheckContext) -> Problems:
    """Check that a module can take the values for its drive objects: its reactions and its own ramp are constant."""
    for drive in _drives(case):
        objects = ModulePort(settings_of(case.cell, drive.axis.node)).objects
        for write in drive.written.values():
            if not isinstance(write.value, int) or objects.write(write.index, write.subindex, write.value):
                is_so = objects.constant(write.index, write.subindex)
                told = _told("constant", source=write.source, value=_words(write.index, is_so))
                yield case.error(write.line, *told)


def _words(index: int, value: int | None) -> str:
    if value is None:
        return ""
    option = _OPTIONS.get(index)
    return f": {value}" if option is None else f": {option.title} is {value}, {option.meaning(value)}"


def no_more(case: CheckContext) -> Problems:
    """Check that a module is not asked for functions that it lacks: inputs, outputs, and feed-forward."""
    for node_id in modules_of(case.cell):
        for point in case.cell.io_of(node_id):
            yield case.error(point.at.line, *_told("no_io", name=point.name, node=node_id))
    for drive in _drives(case):
        if feed_forward(drive.axis, None) is not None:
            told = _told("no_feed_forward", axis=drive.axis.name)
            yield case.error(drive.axis.feed_forward.at.line, *told)


def in_place(case: CheckContext) -> Problems:
    """Check that the axis is homed at its present position: a module has no other homing methods."""
    for drive in _drives(case):
        given = drive.axis.homing
        if given.method is not None and given.method not in homing.IN_PLACE:
            methods = ", ".join(map(str, sorted(homing.IN_PLACE)))
            told = _told("homing", axis=drive.axis.name, method=given.method, methods=methods)
            yield case.error(given.at.of("method"), *told)


def dangers(case: CheckContext) -> Problems:
    """Warn that the motor coasts without power, and that nothing on a module detects the loss of the master."""
    bus = case.cell.bus
    can = sys.platform == "linux"
    own = can and bus.process != "thread"
    killed = "" if own or bus.interface in _NO_WIRE else ", and nothing stops it when this program is killed"
    process = "" if own or not can else '; process = "own" in [bus]'
    for drive in _drives(case):
        name, line = drive.axis.name, drive.node.at.line
        yield case.warning(line, *_told("coasts", axis=name))
        yield case.warning(line, *_told("dead_master", axis=name, killed=killed, process=process))


CHECKS: tuple[Check, ...] = (
    *(identifiers, firmware, settings, endpoints, line),
    *(as_drives, writes, no_more, in_place, dangers),
)
