"""Decide how the failure of one axis affects the other axes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

from axisbus.errors import AxisbusError, NodeError


class LostNode(Enum):
    """Axes that the loss of a node stops, besides the axes of that node."""

    GROUP = "group"
    CELL = "cell"
    REPORT = "report"


class GroupFault(Enum):
    """How a failure stops the other axes of a group; ordered from soft to hard."""

    PATH = "path"  # along their path
    EACH = "each"  # each axis with its own deceleration
    QUICK = "quick"  # with the quick stop of each drive


_HARDER = list(GroupFault)


@dataclass(frozen=True, slots=True)
class FaultPolicy:
    """Default policy: a failure stops the axis's group. If the axis is in no group, the failure stops the cell.

    ``groups`` maps a group's name to its axes. ``lost_node`` is for the loss of a node: stop the same axes as any failure
    (``GROUP``), stop the whole cell (``CELL``), or stop no other axis (``REPORT``). ``on_fault``: how each group is stopped, if not
    along its path. A command of the group itself cannot continue without one of its axes, whatever the policy says. ``mates`` maps
    each of two axes that carry one beam to the other one. A stop of one stops both, and the two axes never brake independently.
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
        """Map each axis to stop to the failed axis that is the reason; ``failed`` may map each failed axis to its error."""
        errors = failed if isinstance(failed, Mapping) else dict.fromkeys(failed)
        return {
            axis: cause
            for cause, error in errors.items()
            for axis in self.stops(cause, error)
            if axis not in errors
        }

    def how(self, axis: str, failed: str) -> GroupFault:
        """Return how ``axis`` is stopped because of ``failed``: by the hardest setting of the groups that contain both."""
        settings = (
            self.on_fault.get(name, GroupFault.PATH)
            for name, axes in self.groups.items()
            if axis in axes and failed in axes
        )
        how = max(settings, key=_HARDER.index, default=GroupFault.PATH)
        return GroupFault.PATH if how is GroupFault.EACH and axis in self.mates else how
