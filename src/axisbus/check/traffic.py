"""The expected traffic of a cell: the rate of each frame after boot, by node and by service."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from axisbus.cell.can_simple.modules import canopen_nodes, module_frames
from axisbus.cell.model import CellConfig
from axisbus.cell.pdo_plan import travelling
from axisbus.check.context import CheckContext
from axisbus.check.cycle_schedule import per_cycle
from axisbus.cia301.frame import plain_bits, worst_bits
from axisbus.eds.model import Eds


@dataclass(frozen=True, slots=True)
class TrafficStream:
    """Frames of one kind: ``node`` is None for frames of no node, ``rate`` in frames per second."""

    node: int | None
    kind: str
    name: str
    rate: float
    data_bytes: int
    extended: bool = False

    @property
    def least(self) -> float:
        """Bits per second without any stuff bit."""
        return self.rate * plain_bits(self.data_bytes, self.extended)

    @property
    def worst(self) -> float:
        """Bits per second with the maximum number of stuff bits."""
        return self.rate * worst_bits(self.data_bytes, self.extended)


def streams(cell: CellConfig, files: Mapping[int, Eds]) -> list[TrafficStream]:
    """Return the traffic while the cell runs: SYNC, PDOs, heartbeats, and the requests and targets of CAN Simple modules.

    SDO and EMCY come irregularly and are not included.
    """
    return [stream for stream in _all(cell, files) if stream.rate > 0]


def _all(cell: CellConfig, files: Mapping[int, Eds]) -> Iterator[TrafficStream]:
    bus = cell.bus
    if bus.sync:
        yield TrafficStream(None, "SYNC", "SYNC", 1 / bus.scan_period, 0)
    for node, eds, dictionary in CheckContext(cell, files).nodes:
        for receive, pdo in travelling(cell, node, eds, dictionary):
            kind = "RPDO" if receive else "TPDO"
            rate = per_cycle(pdo, receive, cell, node.node_id) / bus.scan_period
            yield TrafficStream(node.node_id, kind, f"{kind}{pdo.number}", rate, pdo.size, pdo.cob_id > 0x7FF)
    if bus.heartbeat is not None:
        for node_id in (*canopen_nodes(cell), bus.master_id):
            yield TrafficStream(node_id, "heartbeat", "heartbeat", 1 / bus.heartbeat, 1)
    for each in module_frames(cell):
        yield TrafficStream(each.node, each.kind, each.name, each.rate, each.data_bytes)
