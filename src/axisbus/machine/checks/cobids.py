"""Whether every COB-ID has one producer, and none lies where CiA 301 lets no PDO be."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.eds.model import Eds
from axisbus.machine.cell import NodeConfig
from axisbus.machine.checks import pdomodel
from axisbus.machine.checks.case import Case, Check, Found
from axisbus.machine.checks.pdomodel import NodePdo

# Restricted CAN-IDs (CiA 301 table 40), and the ones that SYNC and TIME use here.
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
    """One producer of a COB-ID; ``line`` is that of the cell file, ``settled`` tells that boot does not move it."""

    cob_id: int
    what: str
    line: int
    settled: bool


def duplicates(case: Case) -> Found:
    """Find COB-IDs that two producers share; the master is the producer of every RPDO."""
    seen: dict[int, Use] = {}
    for use in _uses(case):
        other = seen.setdefault(use.cob_id, use)
        if other is use:
            continue
        first, later = sorted((other, use), key=lambda each: each.line)
        message = f"COB-ID {use.cob_id:03X}h is produced twice: {first.what} and {later.what}"
        if use.settled and other.settled:
            yield case.error(
                later.line, message, f"the first is at line {first.line}", "give one of them another cob_id"
            )
        else:
            yield case.warning(
                later.line,
                message,
                "by the EDS; boot gives them COB-IDs of their own, but until then a running drive disturbs the other",
                f"give it its own: cob_id = ... in [nodes.N.pdo.{_table(later)}]",
            )


def _table(use: Use) -> str:
    return use.what.split()[0].lower()


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
    if case.cell.bus.sync:
        yield Use(cob.SYNC, "SYNC of the master", case.cell.bus.at.line, True)
    for node, eds, _ in case.nodes:
        line, of = node.at.line, f"of node {node.node_id}"
        yield Use(cob.SDO_TX + node.node_id, f"SDO answers {of}", line, True)
        yield Use(cob.SDO_RX + node.node_id, f"SDO requests to node {node.node_id}", line, True)
        yield Use(cob.HEARTBEAT + node.node_id, f"heartbeat {of}", line, True)
        yield from _emergency(node, eds)
        yield from _pdo_uses(node, eds)


def _emergency(node: NodeConfig, eds: Eds) -> Iterator[Use]:
    variable = eds.get(o.COB_ID_EMCY)
    value = variable.initial(node.node_id) if variable is not None else None
    if not isinstance(value, int) or value in (0, cob.EMCY):
        value = cob.EMCY + node.node_id
    if not value & cob.INVALID:
        yield Use(value & cob.ID_MASK_11, f"EMCY of node {node.node_id}", node.at.line, True)


def _pdo_uses(node: NodeConfig, eds: Eds) -> Iterator[Use]:
    for each in pdomodel.node_pdos(node, eds):
        cob_id = each.pdo.cob_id
        if not each.pdo.valid or cob_id > cob.ID_MASK_11 or not cob_id & 0x7F:
            continue  # off, of 29 bits, or written without node ID: boot gives it one
        config = each.config
        configured = config is not None and config.cob_id is not None
        line = config.at.of("cob_id") if config is not None else node.at.line
        preposition = "to" if each.receive else "of"
        yield Use(cob_id, f"{each.name} {preposition} node {node.node_id}", line, configured or each.own_id)


CHECKS: tuple[Check, ...] = (duplicates, restricted)
