"""A drawn cell as a scene of the campaign."""

from __future__ import annotations

from functools import partial

from kit.campaign.cells.cell_setup import DrawnCell, open_cell
from kit.campaign.cells.recipe import CellRecipe
from kit.campaign.cells.rules import Physics
from kit.campaign.scenes import Scene
from kit.cell import Stage
from kit.plants import Plant


def scene_on(recipe: CellRecipe) -> Scene:
    """Return the scene of a cell."""
    return Scene(partial(_open, recipe), recipe.names, period=recipe.period / 1000.0, travel=Physics)


def _open(recipe: CellRecipe, stage: Stage, plant: Plant) -> DrawnCell:  # its plants are its own
    return open_cell(stage, recipe)
