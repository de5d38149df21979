"""Plan the PDOs that will be sent after boot, from the cell file and the EDS files alone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from axisbus.bus.pdo.io_plan import IoObjects, Used, make_io_plan
from axisbus.bus.pdo.mapping import DevicePdos, axis_objects
from axisbus.bus.pdo.plan import PdoChange, PdoPlan, Policy, make_plan, spare_cob_ids
from axisbus.cell import pdo_tables
from axisbus.cell.cyclic_modes import feed_forward, wanted_of
from axisbus.cell.io_signals import points_of
from axisbus.cell.model import BusConfig, CellConfig, NodeConfig
from axisbus.cia301 import cob
from axisbus.cia301.frame import worst_bits
from axisbus.cia301.pdo import PdoConfiguration
from axisbus.cia401.signal import IoPoint, addresses
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds

_FULL = 0.5  # of the bus capacity; the rest is for heartbeats, SDO and a reserve
_MOST_SYNCS = 240  # transmission type 240 (CiA 301 table 72)
_OLDEST = 0.25  # seconds, the age of values that are polled by SDO
_LEAST_SHARE = 0.05  # of the bus capacity
# Bits: SYNC; RPDO and TPDO of 7 bytes; TPDOs of velocity with torque, and of the demand; the RPDO of feed-forward.
_SYNC_BITS, _FAST_BITS, _SLOW_BITS = worst_bits(0), 2 * worst_bits(7), worst_bits(6) + worst_bits(4)
_OFFSET_BITS = worst_bits(6)


def travelling(
    cell: CellConfig, node: NodeConfig, eds: Eds, dictionary: Dictionary
) -> Iterator[tuple[bool, PdoConfiguration]]:
    """Yield (whether the node receives it, PDO): the PDOs of the plan, and enabled TPDOs that are not in any plan.

    This is the result of boot if the drive accepts all that its EDS allows.
    """
    device = pdo_tables.device_pdos(node, eds)
    seen: set[tuple[bool, int]] = set()
    for plan in _plans(cell, node, dictionary, device):
        for planned in plan.pdos:
            number = (planned.receive, planned.target.number)
            if number not in seen and planned.change is not PdoChange.DISABLE:
                yield planned.receive, planned.target
            seen.add(number)
    for planned in io_plan(cell, node, dictionary, device, frozenset(seen)).active:
        yield planned.receive, planned.target
        seen.add((planned.receive, planned.target.number))
    for receive, pdos in ((True, device.rpdos), (False, device.tpdos)):
        for pdo in pdos:
            # An RPDO outside the plan is not sent.
            if not receive and pdo.valid and pdo.mapping and (receive, pdo.number) not in seen:
                yield receive, pdo


def io_plan(
    cell: CellConfig, node: NodeConfig, dictionary: Dictionary, device: DevicePdos, used: Used
) -> PdoPlan:
    """Return the plan of the node's named inputs and outputs; ``used``: the PDOs of its axes."""
    objects = io_objects(points_of(cell, node.node_id, dictionary), dictionary)
    return make_io_plan(node.node_id, device, objects, policy_of(cell, node), used)


def io_objects(points: Sequence[IoPoint], dictionary: Dictionary) -> IoObjects:
    """Return the objects of these points."""
    sides = (addresses(points, output=output) for output in (False, True))
    return IoObjects.of(dictionary, *sides)


def used_by_axes(cell: CellConfig, node: NodeConfig, dictionary: Dictionary, device: DevicePdos) -> Used:
    """Return the PDOs that the plans of a node's axes use."""
    plans = _plans(cell, node, dictionary, device)
    return {(planned.receive, planned.target.number) for plan in plans for planned in plan.active}


def beside_pdos(cell: CellConfig, node: NodeConfig, eds: Eds, dictionary: Dictionary) -> tuple[str, ...]:
    """Return a note for each value of the node's axes that no PDO carries: how it is transferred, and why."""
    plans = _plans(cell, node, dictionary, pdo_tables.device_pdos(node, eds))
    return tuple(note for plan in plans for note in plan.notes)


def _plans(
    cell: CellConfig, node: NodeConfig, dictionary: Dictionary, device: DevicePdos
) -> Iterator[PdoPlan]:
    """Yield the plan of each axis of a node."""
    policy = policy_of(cell, node)
    for axis in cell.axes_of(node.node_id):
        if axis.at.sound("drive_axis"):
            objects = axis_objects(dictionary, device, axis.drive_axis)
            wanted = wanted_of(axis, node, dictionary.eds, cell.bus.sync)
            yield make_plan(node.node_id, device, objects, wanted, policy, axis.drive_axis)


def policy_of(cell: CellConfig, node: NodeConfig) -> Policy:
    """Return the rules for planning a node's PDOs, from the cell file."""
    others = set(cell.nodes) - {node.node_id}
    return Policy(
        sync=cell.bus.sync,
        remap=node.remappable and not node.pdos,
        taken=frozenset().union(*map(cob.all_of_pdos, others)),
        spare=spare_cob_ids(frozenset(cell.nodes), node.node_id),
        fixed=pdo_tables.fixed_pdos(node.pdos),
        timed=pdo_tables.timed_pdos(node.pdos),
        requests=pdo_tables.requested_pdos(node.pdos),
        slow=slow_pace(cell.bus, len(cell.driven), _feeding_forward(cell)),
    )


def _feeding_forward(cell: CellConfig) -> int:
    return sum(feed_forward(axis, None) is not None for axis in cell.driven.values())


def slow_pace(bus: BusConfig, axes: int, feeding_forward: int = 0) -> int:
    """Return the number of SYNCs between two PDOs of velocity, torque and demand: 1 if the bus has room for it, else more.

    The calculation uses the worst-case frames of the master's own layout. With more than 1, these PDOs get the part of the bus that
    is left below one half, but at least a twentieth. They are sent at least every ``_OLDEST`` seconds. ``feeding_forward``: the
    number of ``axes`` with feed-forward.
    """
    if not bus.at.sound("bitrate", "scan_period", "sync") or bus.bitrate is None or not bus.sync:
        return 1
    room = bus.bitrate * bus.scan_period
    left = _FULL * room - _SYNC_BITS - axes * _FAST_BITS - feeding_forward * _OFFSET_BITS
    slow = axes * _SLOW_BITS
    if slow <= left:
        return 1
    latest = max(1, min(_MOST_SYNCS, int(_OLDEST / bus.scan_period)))
    return min(latest, math.ceil(slow / max(left, _LEAST_SHARE * room)))
