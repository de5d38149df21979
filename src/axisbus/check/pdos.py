"""Check the configured PDOs: their objects, sizes, directions, and transmission."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cell import pdo_tables
from axisbus.cell.model import NodeConfig, PdoConfig
from axisbus.cell.problem import CellProblem
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import objects as o
from axisbus.cia301.pdo import MAX_BITS, RTR_TYPES, MappedObject, is_synchronous
from axisbus.cia402.axes import own_index
from axisbus.cia402.objects import CONTROLWORD
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import RPDO_ACCESS, TPDO_ACCESS, Eds
from axisbus.errors import ArgumentError
from axisbus.wording import counted

_RESERVED = range(241, 252)

# Key of a PDO table -> sub-index of its communication parameter.
_ENTRIES = {
    "cob_id": o.PDO_COB_ID,
    "transmission": o.PDO_TRANSMISSION_TYPE,
    "inhibit_time": o.PDO_INHIBIT_TIME,
    "event_timer": o.PDO_EVENT_TIMER,
    "sync_start": o.PDO_SYNC_START,
}


def _tables(case: CheckContext) -> Iterator[tuple[NodeConfig, Eds, Dictionary, PdoConfig]]:
    """Yield the PDO tables whose PDO is in the EDS."""
    for node, eds, dictionary in case.nodes:
        for config in node.pdos:
            if pdo_tables.communication_index(config.receive, config.number) in eds:
                yield node, eds, dictionary, config


def exists(case: CheckContext) -> Problems:
    """Check that the drive has the PDO."""
    for node, eds, _ in case.nodes:
        for config in node.pdos:
            index = pdo_tables.communication_index(config.receive, config.number)
            if index not in eds:
                there = [
                    each.name for each in pdo_tables.node_pdos(node, eds) if each.receive is config.receive
                ]
                yield case.error(
                    config.at.line,
                    f"node {node.node_id} has no {config.name}",
                    f"{eds.source} does not have {index:04X}h; it has {', '.join(there) or 'none of this direction'}",
                    "use an existing one",
                )


def entries(case: CheckContext) -> Problems:
    """Check that the communication parameters that a table sets exist and are writable."""
    for node, eds, _, config in _tables(case):
        index = pdo_tables.communication_index(config.receive, config.number)
        for key, subindex in _ENTRIES.items():
            if not config.at.gives(key):
                continue
            variable = eds.get(index, subindex)
            if variable is None or not variable.writable:
                lacks = "does not have" if variable is None else "does not allow writing"
                yield case.error(
                    config.at.of(key),
                    f"node {node.node_id}: {config.name} does not accept {key}",
                    f"{eds.source} {lacks} {index:04X}h:{subindex:02X}",
                    f"delete {key}",
                )


def mapping(case: CheckContext) -> Problems:
    """Check each object of a map: it exists, may be mapped in this direction, and has the given size."""
    for node, eds, dictionary, config in _tables(case):
        yield from _fixed(case, node, eds, config)
        for key in config.map or ():
            yield from _element(case, node, eds, dictionary, config, key)


def _fixed(case: CheckContext, node: NodeConfig, eds: Eds, config: PdoConfig) -> Problems:
    if config.map is None:
        return
    line, index = config.at.of("map"), pdo_tables.mapping_index(config.receive, config.number)
    if not node.remappable:
        yield case.error(
            line,
            f"node {node.node_id}: {config.name} has a map, but the node must not be remapped",
            f'remap = "never" in [nodes.{node.node_id}]',
            "delete one of them",
        )
    count = eds.get(index, 0)
    if count is None or not count.writable:
        yield case.error(
            line,
            f"node {node.node_id}: the mapping of {config.name} is fixed",
            f"{eds.source} does not allow {index:04X}h:00 to be written",
            'delete map, and write remap = "never" in the node\'s table',
        )


def _element(
    case: CheckContext, node: NodeConfig, eds: Eds, dictionary: Dictionary, config: PdoConfig, key: str
) -> Problems:
    line = config.at.of("map")
    where = f"node {node.node_id}: {config.name}"
    try:
        mapped, size = pdo_tables.map_entry(key, dictionary)
    except ArgumentError as error:
        yield case.error(line, f"{where}: {error.message}", error.observed, error.remedy)
        return
    if mapped.is_dummy:
        yield from _dummy(case, line, where, eds, mapped)
        return
    problem = _not_mappable(case, line, where, eds, dictionary, config, mapped)
    if problem is not None:
        yield problem
    elif size is not None and size != mapped.bits:
        yield case.error(
            line,
            f"{where}: {dictionary.entry(mapped.index, mapped.subindex)} has {counted(mapped.bits, 'bit')}, not {size}",
            f"written is {key!r}",
            "leave /bits out: the size follows from the object",
        )


def _dummy(case: CheckContext, line: int, where: str, eds: Eds, mapped: MappedObject) -> Problems:
    if mapped.index not in eds.dummies:
        yield case.error(
            line,
            f"{where}: the drive does not accept the dummy {mapped.index:04X}h",
            f"[DummyUsage] of {eds.source} does not allow it",
            "fill the space with an object, or leave it out",
        )


def _not_mappable(
    case: CheckContext,
    line: int,
    where: str,
    eds: Eds,
    dictionary: Dictionary,
    config: PdoConfig,
    mapped: MappedObject,
) -> CellProblem | None:
    entry = dictionary.entry(mapped.index, mapped.subindex)
    variable = eds.get(mapped.index, mapped.subindex)
    directions = RPDO_ACCESS if config.receive else TPDO_ACCESS
    if variable is None:
        return case.error(
            line, f"{where}: the drive has no {entry}", f"{eds.source} does not have it", "map another object"
        )
    if not variable.pdo_mapping or not mapped.bits:
        why = "PDOMapping is not 1" if mapped.bits else f"{variable.data_type.name} has no fixed size"
        return case.error(
            line,
            f"{where}: {entry} cannot be transmitted in a PDO",
            f"{eds.source}:{variable.line}: {why}",
            "leave it out: it is read and written by SDO",
        )
    if variable.access not in directions:
        direction = "the drive only sends it" if config.receive else "the drive only receives it"
        return case.error(
            line,
            f"{where}: {entry} has the other direction",
            f"{eds.source}:{variable.line}: access {variable.access}, so {direction}",
            f"map it into {'a TPDO' if config.receive else 'an RPDO'}",
        )
    return None


def size(case: CheckContext) -> Problems:
    """Check that a map fits into a CAN frame, and holds each object once."""
    for node, _, dictionary, config in _tables(case):
        mapped = [entry for entry, _ in _known(config, dictionary)]
        bits = sum(entry.bits for entry in mapped)
        where, line = f"node {node.node_id}: {config.name}", config.at.of("map")
        if bits > MAX_BITS:
            yield case.error(
                line,
                f"{where} maps {counted(bits, 'bit')}",
                " + ".join(f"{entry.bits} ({entry.index:04X}h)" for entry in mapped),
                "a CAN frame holds 64 bits: split the map over two PDOs",
            )
        real = [entry for entry in mapped if not entry.is_dummy]
        for entry in sorted(set(real)):
            if real.count(entry) > 1:
                text = dictionary.entry(entry.index, entry.subindex)
                yield case.warning(line, f"{where} maps {text} more than once", remedy="name it once")


def controlword_last(case: CheckContext) -> Problems:
    """Note a map with entries after the controlword: a drive that takes entry by entry acts before it has the rest."""
    for node, _, dictionary, config in _tables(case):
        controlwords = {own_index(CONTROLWORD, axis.drive_axis) for axis in case.cell.axes_of(node.node_id)}
        mapped = [entry for entry, _ in _known(config, dictionary) if not entry.is_dummy]
        after_controlword = [entry for entry in mapped[:-1] if entry.index in controlwords]
        if config.receive and after_controlword:
            yield case.note(
                config.at.of("map"),
                f"node {node.node_id}: {config.name} does not map the controlword last",
                f"{dictionary.entry(after_controlword[0].index, 0)} is mapped before "
                f"{dictionary.entry(mapped[-1].index, mapped[-1].subindex)}; many drives process the entries one by one, so "
                "the edge of a set-point is sent a cycle after its target",
                "write the controlword last, unless the drive needs this order",
            )


def _known(config: PdoConfig, dictionary: Dictionary) -> Iterator[tuple[MappedObject, int | None]]:
    for key in config.map or ():
        try:
            yield pdo_tables.map_entry(key, dictionary)
        except ArgumentError:
            continue  # reported by ``mapping``


def transmission(case: CheckContext) -> Problems:
    """Check the transmission types: synchronous ones need SYNC, some are reserved, some need remote frames."""
    for node, _, _, config in _tables(case):
        kind = config.transmission
        if kind is None:
            continue
        line, where = config.at.of("transmission"), f"node {node.node_id}: {config.name}"
        if kind in _RESERVED:
            yield case.error(line, f"{where}: transmission type {kind} is reserved", remedy=_KINDS)
        elif kind in RTR_TYPES and (config.receive or (config.rtr is None and config.at.sound("rtr"))):
            yield case.error(
                line,
                f"{where}: transmission type {kind} needs remote frames",
                "an RPDO is sent by the master, so no node can be asked for it"
                if config.receive
                else "the master sends none without rtr: such a PDO would never come",
                _KINDS if config.receive else f'rtr = "100ms" to request it that often, or {_KINDS}',
            )
        elif kind == 252 and not case.cell.bus.sync:
            yield case.error(
                line,
                f"{where}: transmission type 252 is sampled at SYNC, and the bus has none",
                f"sync = false at line {case.cell.bus.at.of('sync')}",
                "transmission = 253, or sync = true in [bus]",
            )
        elif is_synchronous(kind) and not case.cell.bus.sync:
            yield case.error(
                line,
                f"{where}: transmission type {kind} waits for SYNC, and the bus has none",
                f"sync = false at line {case.cell.bus.at.of('sync')}",
                "transmission = 255, or sync = true in [bus]",
            )


_KINDS = "1 to 240: with every 1st to 240th SYNC; 254 or 255: on change"


def timers(case: CheckContext) -> Problems:
    """Warn of times that the object rounds, or that have no effect."""
    for node, eds, _, config in _tables(case):
        where = f"node {node.node_id}: {config.name}"
        for key, step, unit in (("event_timer", 0.001, "1 ms"), ("inhibit_time", 0.0001, "100 µs")):
            value = getattr(config, key)
            if value and abs(value / step - round(value / step)) > 1e-6:
                yield case.warning(
                    config.at.of(key),
                    f"{where}: {key} is rounded to {round(value / step) * step * 1000:g} ms",
                    f"the object counts in steps of {unit}",
                    "write a multiple of it",
                )
            kind = _transmission_type(node, eds, config)
            if value and kind is not None and is_synchronous(kind):
                yield case.warning(
                    config.at.of(key),
                    f"{where}: {key} has no effect",
                    f"its transmission type is {kind}: it is sent with SYNC",
                    f"delete {key}, or write transmission = 255",
                )


def _transmission_type(node: NodeConfig, eds: Eds, config: PdoConfig) -> int | None:
    """Return the configured transmission type of a PDO; None if boot chooses it."""
    if config.transmission is not None:
        return config.transmission
    fixed = eds.get(pdo_tables.communication_index(config.receive, config.number), o.PDO_TRANSMISSION_TYPE)
    if fixed is None or fixed.writable:
        return None
    value = fixed.initial(node.node_id)
    return value if isinstance(value, int) else None


def starts_and_requests(case: CheckContext) -> Problems:
    """Check SYNC start values, which need a counter that reaches them, and TPDOs that the master requests by remote frames."""
    for node, _, _, config in _tables(case):
        where, bus = f"node {node.node_id}: {config.name}", case.cell.bus
        if config.sync_start and config.receive:
            yield case.error(
                config.at.of("sync_start"),
                f"{where}: an RPDO has no SYNC start value",
                remedy="delete sync_start",
            )
        elif config.sync_start and config.sync_start > bus.sync_counter:
            reach = f"the counter runs to {bus.sync_counter}" if bus.sync_counter else "SYNC has no counter"
            yield (case.error if bus.sync_counter else case.warning)(
                config.at.of("sync_start"),
                f"{where}: sync_start = {config.sync_start} "
                + ("is never reached" if bus.sync_counter else "has no effect"),
                reach,
                "delete it, or set sync_counter in [bus] to at least as much",
            )
        if config.rtr is not None and (config.receive or config.transmission not in RTR_TYPES):
            yield case.error(
                config.at.of("rtr"),
                f"{where}: rtr requests a PDO that is sent without a request",
                "only TPDOs of transmission type 252 and 253 wait for a remote frame",
                "delete rtr, or write transmission = 253",
            )


def inhibit_of_rpdo(case: CheckContext) -> Problems:
    """Warn of an inhibit time on an RPDO, which CiA 301 does not use (7.5.2.35)."""
    for node, _, _, config in _tables(case):
        if config.receive and config.inhibit_time:
            yield case.warning(
                config.at.of("inhibit_time"),
                f"node {node.node_id}: {config.name}: an RPDO has no inhibit time",
                "CiA 301 leaves 14xxh:03 unused",
                "delete inhibit_time",
            )


CHECKS: tuple[Check, ...] = (
    exists,
    entries,
    mapping,
    size,
    controlword_last,
    transmission,
    timers,
    starts_and_requests,
    inhibit_of_rpdo,
)
