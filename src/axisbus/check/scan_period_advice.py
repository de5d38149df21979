"""Find changes of the cell file that allow a shorter scan period; each change is tried on the cell's timetable."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from axisbus.cell.model import CellConfig, NodeConfig
from axisbus.check.cycle_schedule import shortest
from axisbus.cia305.services import BIT_TIMINGS
from axisbus.eds.model import Eds

_BY_POSITION = ("pp", "hm", "csp")  # modes that need no target other than the position
_MIN_HEARTBEAT = 1.0  # seconds between two heartbeats


class PeriodReduction(NamedTuple):
    """A change of a cell file, in words, and the shortest period (s) for which the bus is fast enough with it."""

    what: str
    period: float


def changes(cell: CellConfig, files: Mapping[int, Eds], bitrate: int) -> list[PeriodReduction]:
    """Return the changes that reduce the shortest period, the best first."""
    shortest_now = shortest(cell, files, bitrate) or float("inf")
    found = []
    for what, changed, rate in _candidates(cell, bitrate):
        period = shortest(changed, files, rate)
        if period is not None and period < shortest_now:
            found.append(PeriodReduction(what, period))
    return sorted(found, key=lambda change: change.period)


def _candidates(cell: CellConfig, bitrate: int) -> Iterator[tuple[str, CellConfig, int]]:
    for rate in sorted(rate for rate in BIT_TIMINGS if rate > bitrate):
        yield f"bitrate = {rate:_} in [bus], and on every node (axisbus lss set-bitrate)", cell, rate
    for node in cell.nodes.values():
        if node.pdos:
            yield (
                f"no [nodes.{node.node_id}.pdo]: boot then plans its PDOs",
                _with_node(cell, replace(node, pdos=())),
                bitrate,
            )
        if not node.remappable:
            yield (
                f'remap = "auto" in [nodes.{node.node_id}], if the drive allows its PDOs to be remapped',
                _with_node(cell, replace(node, remap="auto")),
                bitrate,
            )
    driven = cell.driven
    wide = [name for name, axis in driven.items() if not set(axis.modes or ("pv",)) <= set(_BY_POSITION)]
    if wide:
        where = "each axis" if len(wide) == len(driven) else ", ".join(f"[axes.{name}]" for name in wide)
        modes = ", ".join(f'"{mode}"' for mode in _BY_POSITION)
        what = f"modes = [{modes}] in {where}: no velocities and torques are then commanded"
        yield what, _with_modes(cell, wide), bitrate
    if cell.bus.heartbeat is not None and cell.bus.heartbeat < _MIN_HEARTBEAT:
        yield (
            f'heartbeat = "{_MIN_HEARTBEAT:g}s" in [bus]: a lost node is then detected later',
            replace(cell, bus=replace(cell.bus, heartbeat=_MIN_HEARTBEAT)),
            bitrate,
        )
    if len(cell.nodes) > 1:
        first = sorted(cell.nodes)[: (len(cell.nodes) + 1) // 2]
        yield (
            f"a second bus; this one keeps nodes {', '.join(map(str, first))}",
            _with_nodes(cell, first),
            bitrate,
        )


def _with_node(cell: CellConfig, node: NodeConfig) -> CellConfig:
    return replace(cell, nodes={**cell.nodes, node.node_id: node})


def _with_modes(cell: CellConfig, names: list[str]) -> CellConfig:
    changed = {name: replace(cell.axes[name], modes=_BY_POSITION) for name in names}
    return replace(cell, axes={**cell.axes, **changed})


def _with_nodes(cell: CellConfig, node_ids: list[int]) -> CellConfig:
    nodes = {node_id: node for node_id, node in cell.nodes.items() if node_id in node_ids}
    axes = {name: axis for name, axis in cell.driven.items() if axis.node in nodes}
    return replace(cell, nodes=nodes, axes=axes)
