"""The PDOs that will travel after boot, worked out from the cell file and the EDS files alone."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.bus.pdo.mapping import axis_objects
from axisbus.bus.pdo.plan import Change, Policy, make_plan, spare_cob_ids
from axisbus.cell import pdo_tables
from axisbus.cell.model import CellConfig, NodeConfig
from axisbus.cia301 import cob
from axisbus.cia301.pdo import Pdo
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds


def travelling(
    cell: CellConfig, node: NodeConfig, eds: Eds, dictionary: Dictionary
) -> Iterator[tuple[bool, Pdo]]:
    """Yield (whether the node receives it, PDO): those of the plan, and TPDOs that are on and that no plan touches.

    It is what boot does when the drive takes what its EDS says it takes.
    """
    device = pdo_tables.device_pdos(node, eds)
    seen: set[tuple[bool, int]] = set()
    policy = _policy(cell, node)
    for axis in cell.axes_of(node.node_id):
        if not axis.at.sound("drive_axis"):
            continue
        objects = axis_objects(dictionary, device, axis.drive_axis)
        plan = make_plan(node.node_id, device, objects, policy=policy, axis=axis.drive_axis)
        for planned in plan.pdos:
            number = (planned.receive, planned.target.number)
            if number not in seen and planned.change is not Change.DISABLE:
                yield planned.receive, planned.target
            seen.add(number)
    for receive, pdos in ((True, device.rpdos), (False, device.tpdos)):
        for pdo in pdos:
            # An RPDO outside the plan is sent by nobody.
            if not receive and pdo.valid and pdo.mapping and (receive, pdo.number) not in seen:
                yield receive, pdo


def _policy(cell: CellConfig, node: NodeConfig) -> Policy:
    others = set(cell.nodes) - {node.node_id}
    return Policy(
        sync=cell.bus.sync,
        remap=node.remappable and not node.pdos,
        taken=frozenset(base + other for other in others for base in (*cob.RPDO, *cob.TPDO)),
        spare=spare_cob_ids(frozenset(cell.nodes), node.node_id),
        fixed=pdo_tables.fixed_pdos(node.pdos),
        timed=pdo_tables.timed_pdos(node.pdos),
        requests=pdo_tables.requested_pdos(node.pdos),
    )
