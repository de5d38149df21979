"""What a script is made of: plain events, and the cell and plant that they happen to."""

from __future__ import annotations

from typing import NamedTuple

from kit.campaign.cells.recipe import CellRecipe


class Event(NamedTuple):
    """What happens to an axis (or to the group ``""``) after ``pause`` seconds; ``value`` is a number from -1 to 1."""

    pause: float
    what: str
    axis: str
    value: float = 0.0


class Script(NamedTuple):
    """A plant (by its name in ``kit.plants``) in a scene (by its name in ``scenes``), what happens to it, and how it is left."""

    plant: str
    events: tuple[Event, ...]
    scene: str = "usual"
    ending: str = "close"
    cell: CellRecipe | None = None  # of the scene "drawn"
