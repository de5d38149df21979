"""Whether every COB-ID has one producer, and none lies where CiA 301 lets no PDO be."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.eds.model import Eds
from axisbus.machine.cell import BusConfig, NodeConfig
from axisbus.machine.checks import pdomodel
from axisbus.machine.checks.case import Case, Check, Found
from axisbus.machine.checks.pdomodel import NodePdo

# Restricted CAN-IDs (CiA 301 table 40), and the ones that SYNC and TIME use by default.
RESTRICTED: tuple[tuple[range, str], ...] = (
    (range(0x001), "NMT"),
    (range(0x001, 0x080), "reserved"),
    (range(0x080, 0x081), "SYNC"),
    (range(0x100, 0x101), "TIME"),
    (range(0x101, 0x181), "reserved"),
    (range(0x581, 0x600), "SDO answers"),
    (range(0x601, 0x680), "SDO requests"),
    (range(0x6E0, 0x700), "reserved"),
    (range(0x701, 0x780), "heartbeats"),
    (range(0x780, 0x800), "reserved"),
)


class Use(NamedTuple):
    """One producer of a COB-ID, by the ``line`` of the cell file that it follows from.

    ``remedy`` is empty where the COB-ID is the predefined one, which is best left alone. ``doubt`` says why the COB-ID may be
    another on the bus than in the EDS, empty where it is certain.
    """

    cob_id: int
    what: str
    line: int
    remedy: str = ""
    doubt: str = ""


def duplicates(case: Case) -> Found:
    """Find COB-IDs that two producers share; the master is the producer of every RPDO."""
    seen: dict[int, Use] = {}
    for use in _uses(case):
        other = seen.setdefault(use.cob_id, use)
        if other is use:
            continue
        first, later = sorted((other, use), key=lambda each: each.line)
        message = f"COB-ID {use.cob_id:03X}h is produced twice: {first.what} and {later.what}"
        remedy = later.remedy or first.remedy or "give the nodes other IDs"
        if later.doubt or first.doubt:
            yield case.warning(later.line, message, later.doubt or first.doubt, remedy)
        else:
            yield case.error(later.line, message, f"the first is at line {first.line}", remedy)


def restricted(case: Case) -> Found:
    """Find PDOs on COB-IDs that belong to other services."""
    for node, eds, _ in case.nodes:
        for each in pdomodel.node_pdos(node, eds):
            if each.config is None or each.config.cob_id is None:
                continue
            cob_id, line = each.config.cob_id, each.config.at.of("cob_id")
            use = next((use for ids, use in RESTRICTED if cob_id in ids), None)
            if use is not None:
                yield case.error(
                    line,
                    f"node {node.node_id}: {each.name} cannot have the COB-ID {cob_id:03X}h",
                    f"it is {'restricted' if use == 'reserved' else f'that of {use}'} (CiA 301 table 40)",
                    f"leave cob_id out, or choose one from 181h to 57Fh: by default {_predefined(each, node):03X}h",
                )


def _predefined(each: NodePdo, node: NodeConfig) -> int:
    bases = cob.RPDO if each.receive else cob.TPDO
    return bases[(each.pdo.number - 1) % len(bases)] + node.node_id


def _uses(case: Case) -> Iterator[Use]:
    bus = case.cell.bus
    if bus.sync:
        odd = bus.sync_cob_id != cob.SYNC
        whose = "another device" if bus.hears_sync else "the master"
        yield Use(
            bus.sync_cob_id,
            f"SYNC of {whose}",
            bus.at.of("sync_cob_id"),
            "another sync_cob_id" if odd else "",
        )
    if bus.time is not None:
        odd = bus.time_cob_id != cob.TIME
        yield Use(
            bus.time_cob_id,
            "TIME of the master",
            bus.at.of("time_cob_id"),
            "another time_cob_id" if odd else "",
        )
    for node, eds, _ in case.nodes:
        if eds.node_id not in (None, node.node_id):
            continue  # a DCF of another node is one error already
        line = node.at.line
        yield Use(cob.SDO_TX + node.node_id, f"SDO answers of node {node.node_id}", line)
        yield Use(cob.SDO_RX + node.node_id, f"SDO requests to node {node.node_id}", line)
        yield Use(cob.HEARTBEAT + node.node_id, f"heartbeat of node {node.node_id}", line)
        yield from _emergency(case, node)
        yield from _pdo_uses(node, eds)


def _emergency(case: Case, node: NodeConfig) -> Iterator[Use]:
    predefined = cob.EMCY + node.node_id
    value = case.node_number(node, o.COB_ID_EMCY)
    if value is None or value & cob.ID_MASK_11 == cob.EMCY:
        value = predefined
    if not value & cob.INVALID:
        cob_id = value & cob.ID_MASK_11
        odd = cob_id != predefined
        remedy = f'"1014" = 0x{predefined:X} in [nodes.{node.node_id}.objects]' if odd else ""
        doubt = "by the EDS, which gives EMCY another COB-ID than 80h + node ID" if odd else ""
        yield Use(cob_id, f"EMCY of node {node.node_id}", node.at.line, remedy, doubt)


_MOVED = "by the EDS; boot gives them COB-IDs of their own, but until then a running drive disturbs the other"


def _pdo_uses(node: NodeConfig, eds: Eds) -> Iterator[Use]:
    for each in pdomodel.node_pdos(node, eds):
        cob_id = each.pdo.cob_id
        if not each.pdo.valid or cob_id > cob.ID_MASK_11 or not cob_id & 0x7F:
            continue  # off, of 29 bits, or written without node ID: boot gives it one
        line = each.config.at.of("cob_id") if each.config is not None else node.at.line
        what = f"{each.name} {'to' if each.receive else 'of'} node {node.node_id}"
        odd = cob_id != _predefined(each, node)
        remedy = f"another cob_id in [nodes.{node.node_id}.pdo.{each.name.lower()}]" if odd else ""
        yield Use(cob_id, what, line, remedy, "" if each.own_id else _MOVED)


def sync_identifier(case: Case) -> Found:
    """Check that each node takes our SYNC, and sends none of its own (1005h)."""
    for node, eds, _ in case.nodes:
        value = case.node_number(node, o.COB_ID_SYNC)
        if value is None or not case.cell.bus.sync:
            continue
        what = _sync_trouble(value, case.cell.bus)
        variable = eds.get(o.COB_ID_SYNC)
        if what and variable is not None and variable.writable:
            yield case.note(
                node.at.line,
                f"node {node.node_id} {what}",
                _said(value, eds),
                f"boot sets 1005h to {case.cell.bus.sync_cob_id:X}h",
            )
        elif what:
            yield case.error(
                node.at.line,
                f"node {node.node_id} {what}",
                _said(value, eds) + ", and cannot be written",
                "set it with the drive's own tool, or sync = false in [bus]",
            )


def _sync_trouble(value: int, bus: BusConfig) -> str:
    if value & cob.SYNC_PRODUCER and not bus.hears_sync:
        return "produces SYNC, and so does the master"
    if value & cob.ID_MASK_11 != bus.sync_cob_id:
        there = "comes on" if bus.hears_sync else "the master sends"
        return f"waits for SYNC on the COB-ID {value & cob.ID_MASK_11:03X}h; {there} {bus.sync_cob_id:03X}h"
    return ""


def sync_producers(case: Case) -> Found:
    """Check that not two nodes send SYNC where none of them is the master."""
    if not case.cell.bus.hears_sync:
        return
    values = [(node, case.node_number(node, o.COB_ID_SYNC) or 0) for node, _, _ in case.nodes]
    producers = [node for node, value in values if value & cob.SYNC_PRODUCER]
    wanted = round(case.cell.bus.scan_period * 1e6)
    for node in producers:
        period = case.node_number(node, o.CYCLE_PERIOD)
        if period is not None and period != wanted:
            yield case.warning(
                node.at.line,
                f"node {node.node_id} sends SYNC every {period} µs, but scan_period is {wanted} µs",
                "1006h of the producer is the period of the scan",
                f'"1006" = {wanted} in [nodes.{node.node_id}.objects]',
            )
    for node in producers[1:]:
        yield case.error(
            node.at.line,
            f"nodes {producers[0].node_id} and {node.node_id} both produce SYNC",
            "1005h has bit 30 set in both",
            f'"1005" = 0x{case.cell.bus.sync_cob_id:X} in the table of objects of one of them',
        )


def sync_settings(case: Case) -> Found:
    """Check what ``[bus]`` says of SYNC and TIME: identifiers that nothing else has, a counter that the nodes know."""
    bus = case.cell.bus
    for key, cob_id, on in (
        ("sync_cob_id", bus.sync_cob_id, bus.sync),
        ("time_cob_id", bus.time_cob_id, bus.time),
    ):
        own = cob.SYNC if key == "sync_cob_id" else cob.TIME
        use = next((use for ids, use in RESTRICTED if cob_id in ids and cob_id != own), None)
        if on and use is not None:
            yield case.error(
                bus.at.of(key),
                f"{key} cannot be {cob_id:03X}h",
                f"it is {'restricted' if use == 'reserved' else f'that of {use}'} (CiA 301 table 40)",
                f"leave {key} out: by default {own:03X}h",
            )
    if not bus.sync:
        for key in ("sync_producer", "sync_cob_id", "sync_counter", "sync_timeout"):
            if bus.at.gives(key):
                yield case.warning(
                    bus.at.of(key),
                    f"{key} has no effect",
                    "the bus has no SYNC (sync = false)",
                    f"delete {key}",
                )
    elif bus.sync_timeout is not None and not bus.hears_sync:
        yield case.warning(
            bus.at.of("sync_timeout"),
            "sync_timeout has no effect",
            "the master itself sends SYNC",
            'delete it, or write sync_producer = "external"',
        )
    yield from _counter(case)


def _counter(case: Case) -> Found:
    bus = case.cell.bus
    for node, eds, _ in case.nodes if bus.sync and bus.sync_counter else ():
        if eds.get(o.SYNC_COUNTER_OVERFLOW) is None and eds.get(o.COB_ID_SYNC) is not None:
            yield case.warning(
                bus.at.of("sync_counter"),
                f"node {node.node_id} may not take a SYNC with a counter",
                f"{eds.source} has no 1019h; some drives then report 8240h (unexpected SYNC data length)",
                "leave sync_counter out, unless the drive's manual allows it",
            )


def _said(value: int, eds: Eds) -> str:
    return f"1005h is {value:X}h in {eds.source}"


CHECKS: tuple[Check, ...] = (duplicates, restricted, sync_identifier, sync_producers, sync_settings)
