"""What a cell's bus must sound like before its first frame: who is no master, and how long to listen for one."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cell import pdo_tables
from axisbus.cell.can_simple.modules import modules_of
from axisbus.cell.model import BusConfig, CellConfig
from axisbus.cia301 import cob
from axisbus.cia301.master_detection import ExpectedMasters
from axisbus.drives.gim6010.can_simple.coexistence import commands_to, sent_by
from axisbus.eds.model import Eds

LONGEST = 0.5  # seconds
SHORTEST = 0.1  # seconds; a busy computer may hold frames back for some hundredths
_MASTER = 127  # the node ID that masters have by custom


def listening_time(bus: BusConfig) -> float:
    """Return how long to listen, in seconds: two heartbeats and two cycles as this cell has them, so that one of each must come.

    Without a heartbeat of ours nothing says how often another master shows itself: then as long as it ever takes.
    """
    if bus.heartbeat is None:
        return LONGEST
    return max(SHORTEST, min(LONGEST, 2 * max(bus.heartbeat, bus.scan_period)))


def cast_of(
    cell: CellConfig, dictionaries: Mapping[int, Eds], rpdos: Mapping[int, int] | None = None
) -> ExpectedMasters:
    """Return who is who on a cell's bus: its devices are no masters, nor is the SYNC one that it says another device sends.

    ``rpdos``: where the nodes that are booted take RPDOs, by COB-ID.
    """
    bus, modules = cell.bus, modules_of(cell)
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
    sent |= frozenset(can_id for node_id in modules for can_id in sent_by(node_id))
    commands = {can_id: node_id for node_id in modules for can_id in commands_to(node_id)}
    masters = frozenset({_MASTER, bus.master_id}) - nodes
    times = frozenset() if bus.time is None else frozenset({bus.time_cob_id})
    produced = bus.sync_cob_id if bus.sync and not bus.hears_sync else None
    return ExpectedMasters(nodes, masters, syncs, sent - {0}, commands, rpdos or {}, times, produced)
