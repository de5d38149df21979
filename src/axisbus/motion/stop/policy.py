"""What one axis's failure does to the others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from axisbus.errors import AxisbusError, NodeError


class LostNode(Enum):
    """What the loss of a node stops beside its own axes."""

    GROUP = "group"
    CELL = "cell"
    REPORT = "report"


@dataclass(frozen=True, slots=True)
class FaultPolicy:
    """Default policy: a failure stops its group; an axis in no group, or a cell without groups, stops the cell.

    ``groups`` maps a group's name to its axes. ``lost_node`` is for the loss of a node: as any failure (``GROUP``), the whole cell,
    or nobody else. A group's own command cannot go on without one of its axes, whatever is said here.
    """

    axes: tuple[str, ...]
    groups: Mapping[str, Sequence[str]]
    lost_node: LostNode = LostNode.GROUP

    def stops(self, failed: str, error: AxisbusError | None = None) -> frozenset[str]:
        """Return the axes to stop, besides ``failed`` itself, when ``failed`` fails because of ``error``."""
        if isinstance(error, NodeError) and self.lost_node is LostNode.REPORT:
            return frozenset()
        if isinstance(error, NodeError) and self.lost_node is LostNode.CELL:
            return frozenset(self.axes) - {failed}
        mates = {axis for axes in self.groups.values() if failed in axes for axis in axes}
        return frozenset(mates or self.axes) - {failed}

    def all_stops(self, failed: Mapping[str, AxisbusError | None] | Iterable[str]) -> dict[str, str]:
        """Return each axis to stop with the failed axis that is the reason; ``failed`` may hold each one's error."""
        errors = failed if isinstance(failed, Mapping) else dict.fromkeys(failed)
        return {
            axis: cause
            for cause, error in errors.items()
            for axis in self.stops(cause, error)
            if axis not in errors
        }
