"""Scripts from seeds: axes are brought into service, move, something goes wrong, they are stopped, and more happens."""

from __future__ import annotations

import random
from collections.abc import Sequence

from kit.campaign.commands import AXIS_STOPS, GROUP, GROUP_MOTIONS, GROUP_STOPS, MOTIONS, ORDERS
from kit.campaign.events import Event, Script
from kit.campaign.faults import ENDS, MISHAPS
from kit.campaign.gantry import scripts as gantry
from kit.campaign.scenes import SCENES, makers, scene_of

ENDINGS = ("close", "close", "close", "with", "exception", "ctrl-c", "closed-twice", "busy-close")
_PAUSES = (0.0, 0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.5)
_PAIRS = 10  # each such seed is of a cell with a pair
_MAKERS = 2  # weight of the scenes on makers' files
# Scenes whose seeds are shared with others, of nearly the same cell.
_IN_TURN = {
    "usual": ("outputs", "usual", "feed-forward", "outputs", "module"),
    "ranged": ("ranged", "ranged", "interpolated"),
}
# The events that bring an axis back into service, whatever the fault: pauses and events.
_ENDS = tuple(end for end in ENDS if end != "pushed_no_more")  # an axis without a beam is not pushed
_RECOVERY = (*((0.0, end) for end in _ENDS), (1.0, "release"), (0.1, "reset"), (0.5, "enable"), (0.5, "halt"))
_MISHAPS = (*(what for what in MISHAPS if what != "pushed"), *["jam"] * 6)


def script(seed: int, episodes: int = 3) -> Script:
    """Return the events of the campaign for a seed; every axis is enabled at its beginning."""
    chance = random.Random(seed)
    if seed % _PAIRS == _PAIRS - 1:
        return _of_pair(chance, episodes)
    drawn = _scene(chance)
    turns = _IN_TURN.get(drawn, (drawn,))
    name = turns[seed % len(turns)]
    scene = scene_of(name)
    plant = chance.choice(scene.plants)
    events = [event for _ in range(episodes) for event in _episode(chance, scene.names)]
    return Script(plant, tuple(events), name, chance.choice(ENDINGS))


def _of_pair(chance: random.Random, episodes: int) -> Script:
    """The script of a cell with a pair."""
    name = chance.choice([name for name, scene in SCENES.items() if scene.pair])
    scene = scene_of(name)
    events = [event for _ in range(episodes) for event in gantry.episode(chance, scene.names)]
    return Script(chance.choice(scene.plants), tuple(events), name, chance.choice(ENDINGS))


def _scene(chance: random.Random) -> str:
    drawn = [name for name, scene in SCENES.items() for _ in range(scene.weight)]
    name = chance.choice([*drawn, *["of"] * _MAKERS])
    files = makers()
    if name != "of":
        return name
    return f"of:{chance.choice(files)}" if files else "usual"


def _episode(chance: random.Random, names: str) -> list[Event]:
    axis = chance.choice(names[0] * 3 + names)
    events = [
        *_recovery(chance, axis, names),
        *_some(chance, axis, MOTIONS, GROUP_MOTIONS, 1, 2),
        *_some(chance, axis, _MISHAPS, (), 0, 2),
        *_some(chance, axis, AXIS_STOPS, GROUP_STOPS, 0, 2),
        *_some(chance, axis, (*ORDERS, *["free"] * 9), tuple(GROUP), 0, 3),
    ]
    if len(events) > 1 and chance.random() < 0.3:  # sometimes in another order
        one = chance.randrange(len(events) - 1)
        events[one], events[one + 1] = events[one + 1], events[one]
    return events


def _recovery(chance: random.Random, axis: str, all_names: str) -> list[Event]:
    names = chance.choice((axis, all_names, all_names, ""))
    return [
        Event(pause if name == names[0] else 0.0, what, name) for pause, what in _RECOVERY for name in names
    ]


def _some(
    chance: random.Random, axis: str, own: Sequence[str], shared: Sequence[str], least: int, most: int
) -> list[Event]:
    """Return some events of an axis, or of its group, with pauses and numbers by chance."""
    events = []
    for _ in range(chance.randint(least, most)):
        grouped = bool(shared) and chance.random() < 0.3
        what = chance.choice(shared if grouped else own)
        value = round(chance.uniform(-1.0, 1.0), 2)
        events.append(Event(chance.choice(_PAUSES), what, "" if what in GROUP else axis, value))
    return events
