"""Check that each COB-ID has one producer, and that no PDO uses a COB-ID that CiA 301 restricts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from axisbus.cell import pdo_tables
from axisbus.cell.model import NodeConfig
from axisbus.cell.pdo_tables import NodePdo
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.eds.model import Eds

# Restricted CAN-IDs (CiA 301 7.3.5), and the default CAN-IDs of SYNC and TIME.
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


def reserved_for(cob_id: int) -> str:
    """Return why PDOs, SYNC and TIME may not have a COB-ID; empty if they may."""
    use = next((use for ids, use in RESTRICTED if cob_id in ids), "")
    if not use:
        return ""
    return f"it is {'restricted' if use == 'reserved' else f'that of {use}'} (CiA 301 7.3.5)"


class Use(NamedTuple):
    """One producer of a COB-ID; ``line`` is the line of the cell file that defines it.

    ``remedy`` is empty if the COB-ID is the predefined one, which should not be changed. ``uncertainty`` says why the COB-ID
    on the bus may differ from the EDS; empty if the COB-ID is certain.
    """

    cob_id: int
    what: str
    line: int
    remedy: str = ""
    uncertainty: str = ""


def duplicates(case: CheckContext) -> Problems:
    """Find COB-IDs that two producers share; the master is the producer of each RPDO."""
    used_by: dict[int, Use] = {}
    for use in _uses(case):
        other = used_by.setdefault(use.cob_id, use)
        if other is use:
            continue
        first, later = sorted((other, use), key=lambda each: each.line)
        message = f"COB-ID {use.cob_id:03X}h is produced twice: {first.what} and {later.what}"
        remedy = later.remedy or first.remedy or "give the nodes other IDs"
        if later.uncertainty or first.uncertainty:
            yield case.warning(later.line, message, later.uncertainty or first.uncertainty, remedy)
        else:
            yield case.error(later.line, message, f"the first is at line {first.line}", remedy)


def restricted(case: CheckContext) -> Problems:
    """Find PDOs on COB-IDs that belong to other services."""
    for node, eds, _ in case.nodes:
        for each in pdo_tables.node_pdos(node, eds):
            if each.config is None or each.config.cob_id is None:
                continue
            cob_id, line = each.config.cob_id, each.config.at.of("cob_id")
            if why := reserved_for(cob_id):
                yield case.error(
                    line,
                    f"node {node.node_id}: {each.name} cannot have the COB-ID {cob_id:03X}h",
                    why,
                    f"leave cob_id out, or choose one from 181h to 57Fh{_by_default(each, node)}",
                )


def _by_default(each: NodePdo, node: NodeConfig) -> str:
    predefined = cob.of_pdo(each.pdo.number, node.node_id, receive=each.receive)
    return "" if predefined is None else f": by default {predefined:03X}h"


def _uses(case: CheckContext) -> Iterator[Use]:
    bus = case.cell.bus
    if bus.sync:
        is_changed = bus.sync_cob_id != cob.SYNC
        sync_producer = "another device" if bus.hears_sync else "the master"
        yield Use(
            bus.sync_cob_id,
            f"SYNC of {sync_producer}",
            bus.at.of("sync_cob_id"),
            "another sync_cob_id" if is_changed else "",
        )
    if bus.time is not None:
        is_changed = bus.time_cob_id != cob.TIME
        yield Use(
            bus.time_cob_id,
            "TIME of the master",
            bus.at.of("time_cob_id"),
            "another time_cob_id" if is_changed else "",
        )
    for node, eds, _ in case.nodes:
        if eds.node_id not in (None, node.node_id):
            continue  # a DCF of another node is already an error
        line = node.at.line
        yield Use(cob.SDO_TX + node.node_id, f"SDO answers of node {node.node_id}", line)
        yield Use(cob.SDO_RX + node.node_id, f"SDO requests to node {node.node_id}", line)
        yield Use(cob.HEARTBEAT + node.node_id, f"heartbeat of node {node.node_id}", line)
        yield from _emergency(case, node)
        yield from _pdo_uses(node, eds)


def _emergency(case: CheckContext, node: NodeConfig) -> Iterator[Use]:
    predefined = cob.EMCY + node.node_id
    value = case.node_number(node, o.COB_ID_EMCY)
    if value is None or value & cob.ID_MASK_11 == cob.EMCY:
        value = predefined
    if not value & cob.INVALID:
        cob_id = value & cob.ID_MASK_11
        is_changed = cob_id != predefined
        remedy = f'"1014" = 0x{predefined:X} in [nodes.{node.node_id}.objects]' if is_changed else ""
        uncertainty = "by the EDS, which gives EMCY a COB-ID other than 80h + node ID" if is_changed else ""
        yield Use(cob_id, f"EMCY of node {node.node_id}", node.at.line, remedy, uncertainty)


_MOVED = "by the EDS; boot gives them separate COB-IDs (it fails if a drive refuses); until then a running drive disturbs the other"


def _pdo_uses(node: NodeConfig, eds: Eds) -> Iterator[Use]:
    for each in pdo_tables.node_pdos(node, eds):
        cob_id = each.pdo.cob_id
        if not each.pdo.valid or cob_id > cob.ID_MASK_11 or not cob_id & 0x7F:
            continue  # disabled, 29 bits long, or written without node-ID: boot assigns a COB-ID
        line = each.config.at.of("cob_id") if each.config is not None else node.at.line
        what = f"{each.name} {'to' if each.receive else 'of'} node {node.node_id}"
        is_changed = cob_id != cob.of_pdo(each.pdo.number, node.node_id, receive=each.receive)
        remedy = f"another cob_id in [nodes.{node.node_id}.pdo.{each.name.lower()}]" if is_changed else ""
        yield Use(cob_id, what, line, remedy, "" if each.own_id else _MOVED)


CHECKS: tuple[Check, ...] = (duplicates, restricted)
