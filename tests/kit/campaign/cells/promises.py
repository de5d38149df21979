"""What is promised for each axis of a drawn cell: by its cell file, or by whoever knows better and is plugged in as ``SOURCE``."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kit.campaign.cells.recipe import AxisRecipe
from kit.cell import Cell


class Promise(NamedTuple):
    """What the master promises of an axis.

    ``limits``: it brakes ahead of its position limits in every mode. ``velocity``, ``acceleration``: no command makes the motor
    faster, or harder, than max_velocity and max_acceleration. ``arrival``: a legal move ends well at its target.
    """

    limits: bool
    velocity: bool
    acceleration: bool
    arrival: bool


def by_cell_file(cell: Cell, name: str, recipe: AxisRecipe) -> Promise:
    """The promises of docs/cell-file.md: every limit that stands there is checked by the master."""
    return Promise(recipe.limits is not None, True, True, True)


SOURCE: Callable[[Cell, str, AxisRecipe], Promise] = by_cell_file
