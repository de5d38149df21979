"""Configure a node at boot from the DCF that its section of the cell file names."""

from __future__ import annotations

from axisbus.boot.configure import writes_of
from axisbus.boot.objects import NodeObjects
from axisbus.cell import scale_proposal
from axisbus.cell.model import CellConfig
from axisbus.cell.pdo_tables import communication_index
from axisbus.cia301 import objects as o
from axisbus.cia402 import objects as cia402_objects
from axisbus.cia402 import options
from axisbus.cia402.axes import first_axis
from axisbus.configuration import guarded_write
from axisbus.configuration.dcf_values import (
    Item,
    Key,
    Selection,
    SkippedValue,
    SkipReason,
    require_within_limits,
    select,
)
from axisbus.configuration.restore import Restore, RestoreReport, ValueEnd
from axisbus.drives.plugin import DrivePlugin
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, BootError
from axisbus.wording import counted, first_of

_ERROR_CONTROL = frozenset((o.CONSUMER_HEARTBEAT, o.PRODUCER_HEARTBEAT, o.GUARD_TIME, o.LIFE_TIME_FACTOR))
_SHOWN = 4


def apply(objects: NodeObjects, cell: CellConfig, eds: Eds, make: DrivePlugin) -> int:
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
        require_within_limits(restore.read_present(), eds, objects.node_id)
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


def own_values(cell: CellConfig, node_id: int, eds: Eds, make: DrivePlugin) -> Selection:
    """Return the values of a node's DCF that are written at boot: those that the cell file does not define.

    Raises:
        ArgumentError: a value does not fit its type, or a key of the cell file names no object.
    """
    selection = select(eds, node_id, make)
    taken = {write.address for write in writes_of(cell, node_id, Dictionary(eds, node_id))}
    pdos = {communication_index(table.receive, table.number) for table in cell.nodes[node_id].pdos}
    items = tuple(
        item for item in selection.items if item.key not in taken and o.pdo_of(item.key[0]) not in pdos
    )
    bus_objects = _bus_objects(cell)
    return Selection(tuple(item for item in items if item.key[0] not in bus_objects), selection.skipped)


def _bus_objects(cell: CellConfig) -> frozenset[int]:
    """Return the objects that ``[bus]`` defines: error control by ``heartbeat``, the COB-ID of SYNC by ``sync``."""
    heartbeat = _ERROR_CONTROL if cell.bus.heartbeat is not None else frozenset[int]()
    return heartbeat | (frozenset((o.COB_ID_SYNC,)) if cell.bus.sync else frozenset[int]())


def _require_ok(report: RestoreReport, node_id: int, eds: Eds) -> None:
    failed = report.of(ValueEnd.FAILED, ValueEnd.DIFFERS)
    if not failed:
        return
    first = failed[0].item
    named = [f"{each.item.key[0]:04X}h:{each.item.key[1]:02X}: {each.reason}" for each in failed]
    raise BootError(
        f"node {node_id} rejects {counted(len(failed), 'value')} of its DCF {eds.source}",
        node=node_id,
        step="configuration",
        index=first.key[0],
        subindex=first.key[1],
        observed=first_of(named, _SHOWN),
        remedy=f"list all differences: axisbus config diff {eds.source} {node_id} ...",
    )


# -- Select the values of a DCF that may be written to a node while its machine runs: only the drive's own settings ----
#
# Theory of operation
# The master sets a node's communication, PDOs and the cell file's values when it opens the machine. It also reads values then and
# relies on them afterwards: scale, limits, windows, stop reactions. None of these may change while the machine runs, so they are
# left to a restore without a machine. The remaining values are the drive's own settings, such as gains and filters.


_COMMUNICATION = range(0x1000, 0x2000)
# Objects that boot-up reads for an axis: the master calculates with them, or has reported them to its user.
TRUSTED_OBJECTS = frozenset(
    (
        *(index for index, _ in scale_proposal.OBJECTS),
        *(option.index for option in options.ALL),
        cia402_objects.FOLLOWING_ERROR_WINDOW,
        cia402_objects.FOLLOWING_ERROR_TIME_OUT,
        cia402_objects.POSITION_WINDOW,
        cia402_objects.MAX_TORQUE,
        cia402_objects.RATED_TORQUE,
        cia402_objects.POLARITY,
        cia402_objects.SOFTWARE_POSITION_LIMIT,
        cia402_objects.QUICK_STOP_DECELERATION,
        cia402_objects.MAX_ACCELERATION,
        cia402_objects.MAX_DECELERATION,
        cia402_objects.TORQUE_SLOPE,
        cia402_objects.VELOCITY_ENCODER_RESOLUTION,
    )
)


def settings(
    cell: CellConfig, node_id: int, eds: Eds, make: DrivePlugin, cyclic: frozenset[Key], whole: Selection
) -> Selection:
    """Return the values of ``whole``, a node's DCF values, that may be written now; the others are skipped with a reason.

    ``cyclic`` are the objects that the machine sends by PDO.

    Raises:
        ArgumentError: as ``own_values``.
    """
    own = {item.key for item in own_values(cell, node_id, eds, make).items} - cyclic
    dictionary = Dictionary(eds, node_id)

    def is_setting(item: Item) -> bool:
        index, subindex = item.key
        return (
            item.key in own
            and index not in _COMMUNICATION
            and first_axis(index) not in TRUSTED_OBJECTS
            and not guarded_write.moves(eds, dictionary.entry(index, subindex))
        )

    writable, left_out = [], []
    for item in whole.items:
        if is_setting(item):
            writable.append(item)
        else:
            left_out.append(SkippedValue(item.variable, SkipReason.MACHINE))
    return Selection(tuple(writable), (*whole.skipped, *left_out))
