"""What one axis's failure does to the others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FaultPolicy:
    """Default policy: a failure stops its group; an axis in no group, or a cell without groups, stops the cell.

    ``groups`` maps a group's name to its axes.
    """

    axes: tuple[str, ...]
    groups: Mapping[str, Sequence[str]]

    def stops(self, failed: str) -> frozenset[str]:
        """Return the axes to stop, besides ``failed`` itself, when ``failed`` fails."""
        mates = {axis for axes in self.groups.values() if failed in axes for axis in axes}
        return frozenset(mates or self.axes) - {failed}

    def all_stops(self, failed: Iterable[str]) -> dict[str, str]:
        """Return each axis to stop with the failed axis that is the reason."""
        failed = list(failed)
        return {axis: cause for cause in failed for axis in self.stops(cause) if axis not in failed}
