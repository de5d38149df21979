"""Select the values of a DCF that may be written to a node while its machine runs: only the drive's own settings.

Theory of operation
-------------------
The master sets a node's communication, PDOs and the cell file's values when it opens the machine. It also reads values then and
relies on them afterwards: scale, limits, windows, stop reactions. None of these may change while the machine runs, so they are
left to a restore without a machine. The remaining values are the drive's own settings, such as gains and filters.
"""

from __future__ import annotations

from axisbus.boot.dcf import own_values
from axisbus.cell import scale_proposal
from axisbus.cell.model import CellConfig
from axisbus.cia402 import objects as o
from axisbus.cia402 import options
from axisbus.cia402.axes import first_axis
from axisbus.configuration import guarded_write
from axisbus.configuration.dcf_values import Item, Key, Selection, SkippedValue, SkipReason
from axisbus.drives.make import Make
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds

_COMMUNICATION = range(0x1000, 0x2000)
# Objects that boot-up reads for an axis: the master calculates with them, or has reported them to its user.
BELIEVED = frozenset(
    (
        *(index for index, _ in scale_proposal.OBJECTS),
        *(option.index for option in options.ALL),
        o.FOLLOWING_ERROR_WINDOW,
        o.FOLLOWING_ERROR_TIME_OUT,
        o.POSITION_WINDOW,
        o.MAX_TORQUE,
        o.RATED_TORQUE,
        o.POLARITY,
        o.SOFTWARE_POSITION_LIMIT,
        o.QUICK_STOP_DECELERATION,
        o.MAX_ACCELERATION,
        o.MAX_DECELERATION,
        o.TORQUE_SLOPE,
        o.VELOCITY_ENCODER_RESOLUTION,
    )
)


def settings(
    cell: CellConfig, node_id: int, eds: Eds, make: Make, cyclic: frozenset[Key], whole: Selection
) -> Selection:
    """Return the values of ``whole``, a node's DCF values, that may be written now; the others are skipped with a reason.

    ``cyclic`` are the objects that the machine sends by PDO.

    Raises:
        ArgumentError: as ``own_values``.
    """
    own = {item.key for item in own_values(cell, node_id, eds, make).items}
    dictionary = Dictionary(eds, node_id)

    def is_setting(item: Item) -> bool:
        index, subindex = item.key
        return (
            item.key in own - cyclic
            and index not in _COMMUNICATION
            and first_axis(index) not in BELIEVED
            and not guarded_write.moves(eds, dictionary.entry(index, subindex))
        )

    kept = tuple(item for item in whole.items if is_setting(item))
    left = tuple(SkippedValue(item.variable, SkipReason.MACHINE) for item in whole.items if item not in kept)
    return Selection(kept, (*whole.skipped, *left))
