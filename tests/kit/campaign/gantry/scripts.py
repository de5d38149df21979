"""Events of a cell with a pair: it is brought into service, moves, one side fails, and it is stopped."""

from __future__ import annotations

import random
from collections.abc import Sequence

from kit.campaign.commands import ORDERS
from kit.campaign.events import Event
from kit.campaign.faults import ENDS, MISHAPS
from kit.campaign.gantry.commands import ALONE, MOTIONS, PAIR, STOPS
from kit.campaign.gantry.scene import AXES

_PAUSES = (0.0, 0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.5, 3.0)
_MISHAPS = (*MISHAPS, *["jam", "sticks", "pushed", "fault", "dead"] * 2)
_BESIDE = ("move_absolute", "move_velocity", "gear", "halt", "fault", "jam", "dead", "enable", "reset")


def episode(chance: random.Random, names: str) -> list[Event]:
    """Some events of a cell with these axes."""
    side = chance.choice(AXES)
    events = [
        *_recovery(chance),
        *_some(chance, side, MOTIONS, 1, 3),
        *_some(chance, side, _MISHAPS, 0, 2),
        *_some(chance, side, (*STOPS, *ALONE), 0, 2),
        *_some(chance, side, (*PAIR, *ALONE, *["free"] * 6, *["pushed_no_more"] * 3), 0, 3),
    ]
    beside = names.replace("x", "").replace("y", "")
    if beside:
        events += _some(chance, chance.choice(beside), _BESIDE, 0, 2)
    if chance.random() < 0.3:  # sometimes in another order
        one = chance.randrange(len(events) - 1)
        events[one], events[one + 1] = events[one + 1], events[one]
    return events


def _recovery(chance: random.Random) -> list[Event]:
    """The recovery of a pair; one that may be bent is disabled, and made square."""
    ends = [Event(0.0, end, name) for end in ENDS for name in AXES]
    if chance.random() < 0.5:
        return [*ends, *_told((1.0, "release"), (0.1, "reset"), (0.5, "enable"), (0.5, "halt"))]
    wide = [Event(0.5, "pair_enable", "", 1.0), Event(1.0, "pair_square", "", 0.0)]
    return [
        *ends,
        *_told((1.0, "release"), (0.5, "disable"), (0.5, "reset")),
        *wide,
        Event(2.0, "pair_halt", ""),
    ]


def _told(*told: tuple[float, str]) -> list[Event]:
    return [Event(pause, f"pair_{what}", "") for pause, what in told]


def _some(chance: random.Random, axis: str, kinds: Sequence[str], least: int, most: int) -> list[Event]:
    events = []
    for _ in range(chance.randint(least, most)):
        what = chance.choice(kinds)
        assert what in PAIR or what in ORDERS or what in MISHAPS or what in ENDS, what
        value = round(chance.uniform(-1.0, 1.0), 2)
        events.append(Event(chance.choice(_PAUSES), what, "" if what in PAIR else axis, value))
    return events
