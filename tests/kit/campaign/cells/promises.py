"""The promises that ``boot`` prints for each axis of a drawn cell, and those that the objects of its drive permit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from axisbus.cia402.modes import FACTS
from axisbus.motion.stop import promises
from axisbus.motion.stop.promises import LimitEnforcement
from kit.campaign.cells.files import GENERIC
from kit.campaign.cells.recipe import AxisRecipe
from kit.cell import Cell

_MODES = {fact.short: int(mode) for mode, fact in FACTS.items()}
_BRAKES = frozenset({0x605A, 0x605D, 0x6084, 0x6085})  # objects by which a drive says how it brakes


class Promise(NamedTuple):
    """The promises of the master for an axis.

    ``limits``: the modes (6061h) in which it brakes ahead of its position limits, or refuses the motion. ``velocity``: those in
    which the motor is never faster than max_velocity. ``printed``: the limit, the mode and how it is kept, as ``boot`` prints it.
    """

    limits: frozenset[int]
    velocity: frozenset[int]
    printed: tuple[str, ...]


def promise_of(cell: Cell, name: str) -> Promise:
    """Return the promises that ``boot`` prints for an axis."""
    found = cell[name].promises
    return Promise(
        frozenset(_modes(found, promises.POSITION, LimitEnforcement.AHEAD, LimitEnforcement.REFUSED)),
        frozenset(_modes(found, promises.VELOCITY, LimitEnforcement.WATCHED)),
        tuple(f"{each.limit} in {each.mode}: {each.kept.value}" for each in found),
    )


def _modes(found: tuple[promises.Promise, ...], limit: str, *kept: LimitEnforcement) -> Iterator[int]:
    return (_MODES[each.mode] for each in found if each.limit == limit and each.kept in kept)


def missing(cell: Cell, name: str, recipe: AxisRecipe) -> list[str]:
    """Return the promises that the recipe's objects permit and that the master does not make."""
    whole = recipe.file == GENERIC and not _BRAKES.intersection(
        (*recipe.without, *(index for index, _ in recipe.fixed))
    )
    if not (whole and recipe.counted):
        return []
    best = {promises.POSITION: LimitEnforcement.AHEAD, promises.VELOCITY: LimitEnforcement.WATCHED}
    return [
        f"{each.limit} in {each.mode}: {each.kept.value} {each.why}"
        for each in cell[name].promises
        if each.kept is not best[each.limit] and each.mode != "hm"
    ]
