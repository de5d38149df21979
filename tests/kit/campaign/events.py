"""Parts of a script: plain events, and the cell and plant to which they happen."""

from __future__ import annotations

from typing import NamedTuple

from kit.campaign.cells.recipe import CellRecipe


class Event(NamedTuple):
    """An event of an axis (or of the group ``""``) after ``pause`` seconds; ``value`` is a number from -1 to 1."""

    pause: float
    what: str
    axis: str
    value: float = 0.0


class Script(NamedTuple):
    """A plant (by its name in ``kit.plants``) in a scene (by its name in ``scenes``), its events, and its end."""

    plant: str
    events: tuple[Event, ...]
    scene: str = "usual"
    ending: str = "close"
    cell: CellRecipe | None = None  # of the scene "drawn"
