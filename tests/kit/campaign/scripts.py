"""Scripts from seeds: axes are brought into service, move, something goes wrong, they are stopped, and more happens."""

from __future__ import annotations

import random
from collections.abc import Sequence

from kit.campaign.events import Event, Script
from kit.campaign.mishaps import ENDS, MISHAPS
from kit.campaign.orders import AXIS_STOPS, GROUP, GROUP_MOTIONS, GROUP_STOPS, MOTIONS, ORDERS
from kit.campaign.scenes import SCENES, makers, scene_of

ENDINGS = ("close", "close", "close", "with", "exception", "ctrl-c", "closed-twice", "busy-close")
_PAUSES = (0.0, 0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.5)
_MAKERS = 2  # weight of the scenes on makers' files
# What brings an axis back into service, whatever was the matter with it: pauses and events.
_RECOVERY = (*((0.0, end) for end in ENDS), (1.0, "release"), (0.1, "reset"), (0.5, "enable"), (0.5, "halt"))
_MISHAPS = (*MISHAPS, *["jam"] * 6)


def script(seed: int, episodes: int = 3) -> Script:
    """Return what happens in the campaign of a seed; every axis is enabled at its beginning."""
    chance = random.Random(seed)
    name = _scene(chance)
    if name == "usual" and seed % 2:
        name = "outputs"  # the same cell with a module beside it
    elif name == "usual" and seed % 4 == 0:
        name = "feed-forward"
    elif name == "usual" and seed % 12 == 2:
        name = "module"  # one that speaks CAN Simple beside it
    elif name == "ranged" and seed % 3 == 0:
        name = "interpolated"
    scene = scene_of(name)
    plant = chance.choice(scene.plants)
    events = [event for _ in range(episodes) for event in _episode(chance, scene.names)]
    return Script(plant, tuple(events), name, chance.choice(ENDINGS))


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
