"""Configure a node at boot from the DCF that its section of the cell file names."""

from __future__ import annotations

from axisbus.boot.configure import writes_of
from axisbus.boot.objects import NodeObjects
from axisbus.cell.model import CellConfig
from axisbus.cia301 import objects as o
from axisbus.configuration.dcf_values import Key, Selection, require_within_limits, select
from axisbus.configuration.restore import Restore, RestoreReport, ValueEnd
from axisbus.configuration.write_order import pdo_of
from axisbus.drives.make import Make
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, BootError
from axisbus.wording import counted

_ERROR_CONTROL = frozenset((o.CONSUMER_HEARTBEAT, o.PRODUCER_HEARTBEAT, o.GUARD_TIME, o.LIFE_TIME_FACTOR))
_SHOWN = 4


def apply(objects: NodeObjects, cell: CellConfig, eds: Eds, make: Make) -> int:
    """Write those values of a node's DCF that differ in the node, read all values back, and return their number.

    The cell file takes precedence over the DCF: its ``objects`` and ``pdo`` tables, the keys of its axes, and [bus]. A node without
    ``dcf`` is not changed. Blocks for one transfer for each value.

    Raises:
        BootError: the node refuses a value or reads back another one; the error names the values.
        SdoError, BusError: the node does not answer.
    """
    node = cell.nodes[objects.node_id]
    if node.dcf is None:
        return 0
    try:
        selection = own_values(cell, objects.node_id, eds, make)
        restore = Restore(objects, selection)
        require_within_limits(restore.look(), eds, objects.node_id)
    except ArgumentError as error:
        raise BootError(
            f"node {objects.node_id}: {error.message}",
            node=objects.node_id,
            step="configuration",
            observed=error.observed,
            remedy=error.remedy,
        ) from error
    report = restore.run()
    _require_ok(report, objects.node_id, eds)
    return len(report.results)


def own_values(cell: CellConfig, node_id: int, eds: Eds, make: Make) -> Selection:
    """Return the values of a node's DCF that are written at boot: those that the cell file does not define.

    Raises:
        ArgumentError: a value does not fit its type, or a key of the cell file names no object.
    """
    selection = select(eds, node_id, make)
    taken = _taken(cell, node_id, eds)
    pdos = _tables(cell, node_id)
    items = tuple(
        item for item in selection.items if item.key not in taken and pdo_of(item.key[0]) not in pdos
    )
    ours = _bus_objects(cell)
    return Selection(tuple(item for item in items if item.key[0] not in ours), selection.skipped)


def _bus_objects(cell: CellConfig) -> frozenset[int]:
    """Return the objects that ``[bus]`` defines: error control by ``heartbeat``, the COB-ID of SYNC by ``sync``."""
    heartbeat = _ERROR_CONTROL if cell.bus.heartbeat is not None else frozenset[int]()
    return heartbeat | (frozenset((o.COB_ID_SYNC,)) if cell.bus.sync else frozenset[int]())


def _taken(cell: CellConfig, node_id: int, eds: Eds) -> frozenset[Key]:
    return frozenset(write.address for write in writes_of(cell, node_id, Dictionary(eds, node_id)))


def _tables(cell: CellConfig, node_id: int) -> frozenset[int]:
    """Return the communication parameters of the PDOs that have a table of their own in the cell file."""
    return frozenset(
        (o.RPDO_COMMUNICATION if table.receive else o.TPDO_COMMUNICATION) + table.number - 1
        for table in cell.nodes[node_id].pdos
    )


def _require_ok(report: RestoreReport, node_id: int, eds: Eds) -> None:
    failed = report.of(ValueEnd.FAILED, ValueEnd.DIFFERS)
    if not failed:
        return
    first = failed[0].item
    named = "; ".join(
        f"{each.item.key[0]:04X}h:{each.item.key[1]:02X}: {each.reason}" for each in failed[:_SHOWN]
    )
    rest = f"; and {len(failed) - _SHOWN} more" if len(failed) > _SHOWN else ""
    raise BootError(
        f"node {node_id} rejects {counted(len(failed), 'value')} of its DCF {eds.source}",
        node=node_id,
        step="configuration",
        index=first.key[0],
        subindex=first.key[1],
        observed=named + rest,
        remedy=f"list all differences: axisbus config diff {eds.source} {node_id} ...",
    )
