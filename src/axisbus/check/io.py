"""Check the tables of named inputs and outputs: object, bit, safe state, PDO, and the module's behaviour without the master."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from axisbus.bus.pdo.mapping import MapEntry
from axisbus.cell import io_signals as io_points
from axisbus.cell import pdo_tables
from axisbus.cell.model import IoConfig, NodeConfig
from axisbus.cell.pdo_plan import io_plan, used_by_axes
from axisbus.cell.writes import known_writes
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia401.objects import DRIVE_OUTPUTS, ERROR_OBJECTS, OUTPUTS
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.axes import PROFILE_AREA, first_axis
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import ArgumentError

_OF_NUMBERS = ("scale", "offset", "unit")
_COMMUNICATION = range(0x2000)
_SHARED = "PDOs of an axis are not shared with outputs: their order belongs to its controlword"
_FIXED = "the map in [nodes.N.pdo] is not changed, and inputs are not requested by remote frames (rtr)"


def have_nodes(case: CheckContext) -> Problems:
    """Check that the node of each input and output exists."""
    for config in case.cell.io.values():
        if config.at.sound("node") and config.node not in case.cell.nodes:
            known = ", ".join(map(str, case.cell.nodes)) or "none"
            yield case.error(
                config.at.of("node"),
                f"[io.{config.name}] is on node {config.node}, which the cell does not have",
                f"nodes of the cell: {known}",
                f"add [nodes.{config.node}] with its eds, or correct node",
            )


def objects(case: CheckContext) -> Problems:
    """Check the object, the bit, and the required keys of an output."""
    for config, node, dictionary in _all(case):
        entry = io_points.entry_of(config, dictionary)
        if entry is None:
            yield from _no_object(case, config, node, dictionary)
        elif not (entry.receive or entry.transmit):
            yield case.error(
                config.at.of("object"),
                f"[io.{config.name}]: {_name(entry)} cannot be mapped into a PDO",
                f"{node.file} does not allow it to be mapped (PDOMapping, AccessType)",
                "inputs and outputs are transmitted only by PDO: name an object that can be mapped",
            )
        else:
            yield from _bit(case, config, entry)
            yield from _safe(case, config, entry)
            yield from _of_axes(case, config, entry)


def encoders(case: CheckContext) -> Problems:
    """Check that the input of each encoder is a number, not a bit or an output."""
    for axis in case.cell.axes.values():
        if axis.encoder is None:
            continue
        config = case.cell.io.get(axis.encoder)
        what, remedy = _no_count(case, config)
        if what:
            observed = f"inputs and outputs of the cell: {', '.join(case.cell.io) or 'none'}"
            yield case.error(
                axis.at.of("encoder"),
                f"axis {axis.name}: encoder = {axis.encoder!r} {what}",
                observed,
                remedy,
            )


def _no_count(case: CheckContext, config: IoConfig | None) -> tuple[str, str]:
    """Return why an input cannot be an encoder, and the remedy; empty texts if it can."""
    if config is None:
        return (
            "names no [io] of the cell",
            "add it: [io.NAME] with node and object, the position value of the encoder",
        )
    if config.bit is not None:
        return "is one bit", "name an input that is a number: the position value of the encoder"
    if any(point.name == config.name and point.output for _, _, point in _points(case)):
        return "is an output", "name an input: the position value of the encoder"
    return "", ""


def overlapping(case: CheckContext) -> Problems:
    """Check that no two outputs use the same bits."""
    points = [point for _, _, point in _points(case) if point.output]
    for one, other in combinations(points, 2):
        if (one.node, one.address) == (other.node, other.address) and one.mask & other.mask:
            yield case.error(
                case.cell.io[other.name].at.line,
                f"[io.{one.name}] and [io.{other.name}] are the same output: {other.object_text} of node {other.node}",
                remedy="give one of them another bit, or leave one out",
            )


def travel(case: CheckContext) -> Problems:
    """Check that each object fits into a PDO that no axis uses."""
    for node, eds, dictionary in case.nodes:
        if not any(case.cell.io_of(node.node_id)):
            continue
        device = pdo_tables.device_pdos(node, eds)
        used = used_by_axes(case.cell, node, dictionary, device)
        for text in io_plan(case.cell, node, dictionary, device, used).impossible:
            config = next(each for each in case.cell.io_of(node.node_id) if _is_of(each, text, dictionary))
            yield case.error(
                config.at.of("object"),
                f"[io.{config.name}]: {text}",
                _SHARED if any(case.cell.axes_of(node.node_id)) else _FIXED,
                "free a PDO of the node, allow boot to change its mapping (remap), or map the object in a separate "
                "[nodes.N.pdo] table",
            )


def shared_pdos(case: CheckContext) -> Problems:
    """Warn of outputs that the module does not set to their safe state when the master fails suddenly."""
    for config, node, point in _points(case):
        if not point.output or not case.cell.bus.at.sound("heartbeat"):
            continue
        why = _why_shared(case, node, point)
        if why:
            yield case.warning(
                config.at.line,
                f"[io.{config.name}]: if the bus or this computer fails, the module itself does not set it to its safe state",
                why,
                "an output that must not stay on needs hardware that switches it off",
            )


def shared_numbers(case: CheckContext) -> Problems:
    """Warn of a safe number that modules of different makers interpret differently (6444h has 32 bits for outputs of 16)."""
    for config, node, point in _points(case):
        row, eds = ERROR_OBJECTS.get(point.index), case.eds[node.node_id]
        if not point.output or point.safe == 0 or row is None or row.by_bit:
            continue
        value = eds.get(row.value, point.subindex)
        given = {write.address for write in known_writes(node.objects, Dictionary(eds, node.node_id))}
        if value is None or value.data_type.bits == point.width or (row.value, point.subindex) in given:
            continue
        name = f"{row.value:04X}h:{point.subindex:02X}"
        yield case.warning(
            config.at.of("safe"),
            f"[io.{config.name}]: manufacturers differ in the effect of {name} in a module without a master",
            f"boot writes {point.safe}; it is wider than the output ({point.object_text}), and some modules use its upper half",
            f"write the value from its manual as '{row.value:04X}:{point.subindex:02X}' in [nodes.{node.node_id}.objects], "
            "which boot then leaves unchanged; or choose a safe state of 0 digits",
        )


def _why_shared(case: CheckContext, node: NodeConfig, point: IoPoint) -> str:
    if case.cell.bus.heartbeat is None:
        return "without heartbeat in [bus] no module detects the loss of its master"
    row, eds = ERROR_OBJECTS.get(point.index), case.eds[node.node_id]
    if row is None:
        return f"for {point.object_text} there is no object that defines its value in an error"
    lacks = [index for index in (row.mode, row.value) if eds.get(index, point.subindex) is None]
    if lacks:
        return f"{node.file} has no {', '.join(f'{index:04X}h:{point.subindex:02X}' for index in lacks)}"
    return ""


def _all(case: CheckContext) -> Iterator[tuple[IoConfig, NodeConfig, Dictionary]]:
    dictionaries = {node.node_id: (node, dictionary) for node, _, dictionary in case.nodes}
    for config in case.cell.io.values():
        if config.at.sound("node", "object") and config.node in dictionaries:
            yield config, *dictionaries[config.node]


def _points(case: CheckContext) -> Iterator[tuple[IoConfig, NodeConfig, IoPoint]]:
    for config, node, dictionary in _all(case):
        point = io_points.point_of(config, dictionary)
        if point is not None:
            yield config, node, point


def _no_object(case: CheckContext, config: IoConfig, node: NodeConfig, dictionary: Dictionary) -> Problems:
    message = f"[io.{config.name}]: {config.object!r} is not an input or output of node {node.node_id}"
    try:
        entry = dictionary.resolve(config.object)
    except ArgumentError as error:
        yield case.error(config.at.of("object"), message, error.message, error.remedy)
        return
    where = f"{entry.index:04X}h:{entry.subindex:02X}"
    has = dictionary.has(entry.index, entry.subindex)
    observed = f"{where} is not an integer" if has else f"{node.file} has no {where}"
    remedy = f"write sub-indices like this: {entry.index:04X}h:01" if not entry.subindex else "correct object"
    yield case.error(config.at.of("object"), message, observed, remedy)


def _bit(case: CheckContext, config: IoConfig, entry: MapEntry) -> Problems:
    if config.bit is None or not config.at.sound("bit"):
        return
    if config.bit >= entry.bits:
        yield case.error(
            config.at.of("bit"),
            f"[io.{config.name}]: {_name(entry)} has no bit {config.bit}",
            f"it has {entry.bits}, counted from 0",
            f"write bit = 0 to {entry.bits - 1}",
        )
    for key in _OF_NUMBERS:
        if config.at.gives(key):
            yield case.error(
                config.at.of(key),
                f"[io.{config.name}]: {key} is for numbers, and this is one bit",
                remedy=f"leave {key} or bit out",
            )


def _safe(case: CheckContext, config: IoConfig, entry: MapEntry) -> Problems:
    if not config.at.sound("safe", "bit", "scale", "offset") or (config.bit or 0) >= entry.bits:
        return
    if not entry.receive:
        if config.at.gives("safe"):
            yield case.error(
                config.at.of("safe"),
                f"[io.{config.name}]: {_name(entry)} is an input, which has no safe state",
                remedy="leave safe out, or name an output",
            )
        return
    if config.safe is None:
        yield case.error(
            config.at.line,
            f"[io.{config.name}] does not give its safe state",
            f"{_name(entry)} is an output; its state when node, program or master are lost is never guessed",
            "add safe = 0, or the value that is safe on your machine",
        )
        return
    try:
        io_points.safe_of(config, io_points.unsafe_point(config, entry))
    except ArgumentError as error:
        yield case.error(
            config.at.of("safe"), f"[io.{config.name}]: safe: {error.message}", error.observed, error.remedy
        )


def _of_axes(case: CheckContext, config: IoConfig, entry: MapEntry) -> Problems:
    """Check that an output is not a communication parameter, and not an object that its axis needs."""
    if not entry.receive:
        return
    why = ""
    if entry.index in _COMMUNICATION:
        why = "it belongs to the communication of the node"
    elif any(case.cell.axes_of(config.node)) and entry.index in PROFILE_AREA:
        digital = (first_axis(entry.index), entry.subindex) == (DRIVE_OUTPUTS, OUTPUTS)
        why = "" if digital else "the node is a drive, and this belongs to its axis"
    if why:
        yield case.error(
            config.at.of("object"),
            f"[io.{config.name}]: {_name(entry)} is not an output",
            why,
            "of a drive that is 60FEh:01, of a module 6200h, 6300h, 6320h or 6410h to 6412h; or an object of the manufacturer",
        )


def _name(entry: MapEntry) -> str:
    return f"{entry.index:04X}h:{entry.subindex:02X}"


def _is_of(config: IoConfig, text: str, dictionary: Dictionary) -> bool:
    entry = io_points.entry_of(config, dictionary)
    return entry is not None and text.startswith(_name(entry))


CHECKS: tuple[Check, ...] = (have_nodes, objects, encoders, overlapping, travel, shared_pdos, shared_numbers)
