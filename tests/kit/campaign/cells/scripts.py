"""Scripts for drawn cells: axes are in service and move most of the time, are stopped, and now and then something goes wrong."""

from __future__ import annotations

import random
from collections.abc import Collection, Iterator, Sequence

from kit.campaign.cells import commands
from kit.campaign.cells.recipe import CellRecipe, draw, with_usual
from kit.campaign.events import Event, Script
from kit.campaign.faults import ENDS, MISHAPS

SCENE = "drawn"
_PAUSES = (0.0, 0.0, 0.01, 0.05, 0.1, 0.2, 0.5, 0.5, 1.0, 2.0)
_ENDINGS = ("close", "close", "close", "with", "exception", "ctrl-c", "closed-twice", "busy-close")
_MISHAPS = (
    *(what for what in MISHAPS if what not in ("pushed", "forks")),
    *["fault", "jam", "dead", "outputs_lost"] * 4,
    *[
        "wire_loses",
        "wire_doubles",
        "wire_jitters",
        "wire_delays",
        "wire_slows",
        "wire_cut",
        "bus_off",
        "queue_full",
    ]
    * 2,
    *["second_device"] * 3,
)
# What goes wrong with the link, and shows only in the stop of an axis that turns freely.
_SHOWN_BY_MOTION = frozenset({"second_device", "wire_slows"})
_TROUBLED = 0.3  # share of episodes in which something goes wrong
_AT_ONCE = (150.0, 500.0)  # axis cycles per second up to which there are three episodes, and two


def script(seed: int, usual: Collection[str] = ()) -> Script:
    """Return the cell of a seed, and its events; ``usual``: fields of its axes that keep their usual values."""
    chance = random.Random(seed)
    cell = with_usual(draw(chance), usual)
    load = len(cell.axes) * 1000.0 / cell.period
    episodes = 3 - sum(load > bound for bound in _AT_ONCE)
    events = [event for number in range(episodes) for event in _episode(chance, cell, number)]
    return Script("stiff", tuple(events), SCENE, chance.choice(_ENDINGS), cell)


def _episode(chance: random.Random, cell: CellRecipe, number: int) -> Iterator[Event]:
    singles = cell.names[2:] if cell.gantry else cell.names
    actors = [*(["pair"] * 3 if cell.gantry else []), *singles]
    if len(singles) > 1:
        actors += ["group"] * (3 if cell.kinematics else 1)
    actor = chance.choice(actors)
    if number:
        yield Event(chance.choice((0.2, 0.5, 1.0)), "service", "")
    if chance.random() < 0.25:
        yield Event(0.0, "nudge", "" if actor in ("pair", "group") else actor, _value(chance))
    for other in singles:
        if other != actor and chance.random() < 0.4:
            yield _event(chance, chance.choice(("move_absolute", "move_velocity", "gear", "follow")), other)
    yield from _some(chance, actor, commands.MOTIONS, commands.GROUP_MOTIONS, commands.PAIR_MOTIONS, 1, 2)
    if chance.random() < 0.5:
        yield Event(chance.choice(_PAUSES), "service", "")
    yield from _some(chance, actor, commands.MOTIONS, commands.GROUP_MOTIONS, commands.PAIR_MOTIONS, 1, 2)
    if chance.random() < 0.5:
        shared, paired = ("override", "cell_override"), ("pair_override", "pair_resume")
        for event in _some(chance, actor, commands.ALONG, shared, paired, 1, 2):
            yield event
            if event.what.endswith("override") and event.value < commands.HOLDS and chance.random() < 0.7:
                yield event._replace(pause=2.5, value=-event.value)  # it is held for a while, and continues
    if chance.random() < _TROUBLED:
        what = chance.choice(_MISHAPS)
        axis = actor if actor in cell.names else chance.choice(cell.names)
        shown = what in _SHOWN_BY_MOTION and axis in singles
        if shown:
            yield Event(0.1, "move_velocity", axis, _value(chance))
        yield Event(0.5 if shown else chance.choice(_PAUSES), what, axis, _value(chance))
        if shown:
            yield Event(chance.choice((1.0, 5.0)), "probe", axis, _value(chance))  # it has time to brake
        if MISHAPS[what].ends and chance.random() < 0.5:
            yield Event(chance.choice(_PAUSES), MISHAPS[what].ends, axis, _value(chance))
    yield from _some(chance, actor, commands.STOPS, commands.GROUP_STOPS, commands.PAIR_STOPS, 0, 2)
    if chance.random() < 0.3:
        yield _event(chance, "enable" if actor in cell.names else f"{actor}_enable", actor)
        yield from _some(chance, actor, commands.STOPS, commands.GROUP_STOPS, commands.PAIR_STOPS, 0, 1)
    if chance.random() < 0.5:
        yield Event(chance.choice(_PAUSES), "service", "")
        yield from _some(chance, actor, commands.MOTIONS, commands.GROUP_MOTIONS, commands.PAIR_MOTIONS, 1, 2)


def _some(
    chance: random.Random,
    actor: str,
    own: Sequence[str],
    shared: Sequence[str],
    paired: Sequence[str],
    least: int,
    most: int,
) -> Iterator[Event]:
    kinds = {"group": shared, "pair": paired}.get(actor, own)
    for _ in range(chance.randint(least, most)):
        yield _event(chance, chance.choice(kinds), actor)


def _event(chance: random.Random, what: str, actor: str) -> Event:
    axis = {"group": "", "pair": "a"}.get(actor, actor)
    return Event(chance.choice(_PAUSES), what, axis, _value(chance))


def _value(chance: random.Random) -> float:
    return round(chance.uniform(-1.0, 1.0), 3)


def is_known(what: str) -> bool:
    """Whether something of this name can happen in a drawn cell."""
    known = (commands.ORDERS, commands.GROUP, commands.GANTRY, MISHAPS, ENDS)
    return what in ("service", "nudge") or any(what in names for names in known)
