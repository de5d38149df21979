"""What one axis's failure does to the others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

from axisbus.errors import AxisbusError, NodeError


class LostNode(Enum):
    """What the loss of a node stops beside its own axes."""

    GROUP = "group"
    CELL = "cell"
    REPORT = "report"


class GroupFault(Enum):
    """How a failure stops the other axes of a group; ordered from soft to hard."""

    PATH = "path"  # along the path that they are on
    EACH = "each"  # each by its own deceleration
    QUICK = "quick"  # by the quick stop of each drive


_HARDER = list(GroupFault)


@dataclass(frozen=True, slots=True)
class FaultPolicy:
    """Default policy: a failure stops its group; an axis in no group, or a cell without groups, stops the cell.

    ``groups`` maps a group's name to its axes. ``lost_node`` is for the loss of a node: as any failure (``GROUP``), the whole cell,
    or nobody else; ``on_fault``: how each group is stopped, where that is not on its path. A group's own command cannot go on
    without one of its axes, whatever is said here. ``mates``: of two axes that carry one beam each one's other; what stops one
    stops both, and nothing brakes them apart.
    """

    axes: tuple[str, ...]
    groups: Mapping[str, Sequence[str]]
    lost_node: LostNode = LostNode.GROUP
    on_fault: Mapping[str, GroupFault] = field(default_factory=dict)
    mates: Mapping[str, str] = field(default_factory=dict)

    def stops(self, failed: str, error: AxisbusError | None = None) -> frozenset[str]:
        """Return the axes to stop, besides ``failed`` itself, when ``failed`` fails because of ``error``."""
        found = self._stops(failed, error)
        beside = {self.mates[axis] for axis in (failed, *found) if axis in self.mates}
        return (found | beside) - {failed} if beside else found

    def _stops(self, failed: str, error: AxisbusError | None) -> frozenset[str]:
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

    def how(self, axis: str, failed: str) -> GroupFault:
        """Return how ``axis`` is stopped because of ``failed``: as hard as any group of both asks for."""
        ways = (
            self.on_fault.get(name, GroupFault.PATH)
            for name, axes in self.groups.items()
            if axis in axes and failed in axes
        )
        how = max(ways, key=_HARDER.index, default=GroupFault.PATH)
        return GroupFault.PATH if how is GroupFault.EACH and axis in self.mates else how
