"""The expected traffic on a cell's bus before its first frame: devices that are no masters, and the time to listen for one."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cell import pdo_tables
from axisbus.cell.model import BusConfig, CellConfig
from axisbus.cell.other_protocols import commands_to, other_nodes, sent_by
from axisbus.cia301 import cob
from axisbus.cia301.master_detection import ExpectedMasters
from axisbus.eds.model import Eds

LONGEST = 0.5  # seconds
SHORTEST = 0.1  # seconds; a busy computer may delay frames by some hundredths
_MASTER = 127  # the usual node-ID of masters


def listening_time(bus: BusConfig) -> float:
    """Return the listening time in seconds: two heartbeats and two cycles of this cell, so that one of each must come.

    If this master has no heartbeat, the interval of another master's is unknown: the time is then the longest one.
    """
    if bus.heartbeat is None:
        return LONGEST
    return max(SHORTEST, min(LONGEST, 2 * max(bus.heartbeat, bus.scan_period)))


def expected_masters_of(
    cell: CellConfig, dictionaries: Mapping[int, Eds], rpdos: Mapping[int, int] | None = None
) -> ExpectedMasters:
    """Return the roles on a cell's bus. Its devices are no masters, nor is a SYNC that the cell expects from another device.

    ``rpdos``: the RPDOs of the booted nodes, by COB-ID.
    """
    bus, modules = cell.bus, other_nodes(cell)
    nodes = frozenset(cell.nodes) - frozenset(modules)
    syncs = frozenset({cob.SYNC, bus.sync_cob_id})
    if bus.sync_producer == "external":
        syncs -= {bus.sync_cob_id}
    sent = frozenset(
        pdo.cob_id
        for node_id, node in cell.nodes.items()
        if node_id in dictionaries
        for pdo in pdo_tables.device_pdos(node, dictionaries[node_id]).tpdos
    )
    sent |= frozenset(can_id for node_id in modules for can_id in sent_by(cell, node_id))
    commands = {can_id: node_id for node_id in modules for can_id in commands_to(cell, node_id)}
    masters = frozenset({_MASTER, bus.master_id}) - nodes
    times = frozenset() if bus.time is None else frozenset({bus.time_cob_id})
    produced = bus.sync_cob_id if bus.sync and not bus.hears_sync else None
    return ExpectedMasters(nodes, masters, syncs, sent - {0}, commands, rpdos or {}, times, produced)
