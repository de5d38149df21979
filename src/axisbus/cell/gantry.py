"""Convert ``[gantries.NAME]`` to the parameters that motion needs of a pair."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cell.model import CellConfig, GantryConfig
from axisbus.cia402.touch_probe import Edge
from axisbus.motion.gantry.parameters import GantryParameters, SwitchSearch


def gantries_of(cell: CellConfig) -> Mapping[str, GantryParameters]:
    """Return the pairs of a cell, by name."""
    return {name: gantry_of(config) for name, config in cell.gantries.items()}


def gantry_of(config: GantryConfig) -> GantryParameters:
    """Return one pair; its table must be free of errors."""
    first, second = config.axes
    return GantryParameters(config.name, first, second, config.max_skew, config.offset, _search(config))


def _search(config: GantryConfig) -> SwitchSearch | None:
    homing = config.homing
    if homing is None:
        return None
    first, *others = homing.positions
    return SwitchSearch(
        each=homing.switches == "each",
        input=homing.input,
        edge=Edge(homing.edge),
        velocity=homing.velocity,
        distance=homing.distance,
        positions=(first, others[0] if others else first + config.offset),
        skew=config.max_skew if homing.skew is None else homing.skew,
    )
