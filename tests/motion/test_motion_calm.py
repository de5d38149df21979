"""An axis that watches only its motion in calm cycles is the same, in all that it holds, as one that always looks at all."""

from __future__ import annotations

import functools
from collections import deque
from enum import Enum

import pytest

from axisbus.cia402.state import State
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.states import AxisState
from kit.motion.randomplay import Play
from kit.motion.rig import rig

CYCLES = 700


class Thorough:
    """Makes a core look at all in every cycle."""

    def __init__(self, core: AxisCore) -> None:
        self.core = core

    def step(self, inputs):
        self.core._was_calm, self.core._cruise = False, None
        return self.core.step(inputs)


def parts(thing) -> dict:
    """All attributes of an object, in slots or not."""
    slots = [name for cls in type(thing).__mro__ for name in getattr(cls, "__slots__", ())]
    return {name: getattr(thing, name) for name in slots if hasattr(thing, name)} | getattr(
        thing, "__dict__", {}
    )


def differences(a, b, where: str, seen: set) -> list[str]:
    """Where two graphs of objects differ in a value or a type."""
    if type(a) is not type(b):
        return [f"{where}: {a!r} is not {b!r}"]
    if a is b or (id(a), id(b)) in seen or isinstance(a, type):
        return []
    seen.add((id(a), id(b)))
    if isinstance(a, dict):
        pairs = [(f"{where}[{key!r}]", a.get(key), b.get(key)) for key in a.keys() | b.keys()]
    elif isinstance(a, (list, tuple, deque)):
        pairs = [(f"{where}[{n}]", x, y) for n, (x, y) in enumerate(zip(a, b, strict=False))]
        pairs.append((f"len({where})", len(a), len(b)))
    elif isinstance(a, functools.partial):
        pairs = [(where, list(a.args), list(b.args))]
    elif isinstance(a, (int, float, str, bytes, frozenset, set, Enum)) or callable(a):
        return [] if callable(a) or a == b or a != a else [f"{where}: {a!r} != {b!r}"]
    else:
        mine, others = parts(a), parts(b)
        pairs = [(f"{where}.{key}", mine.get(key), others.get(key)) for key in mine.keys() | others.keys()]
    return [
        found
        for path, x, y in pairs
        if not path.endswith(("._was_calm", "._cruise"))
        for found in differences(x, y, path, seen)
    ]


@pytest.mark.parametrize("seed", range(16))
def test_calm_cycles_change_nothing_of_what_an_axis_does_and_holds(seed):
    play = Play(seed, 2)
    core, other = play.cores
    thorough = Thorough(other)
    for number, inputs in enumerate(play.inputs(CYCLES)):
        outputs = core.step(inputs)
        assert thorough.step(inputs) == outputs, number
        found = differences(core, other, "core", set())
        assert not found, (number, found[:5])
        play.port.write(outputs)
    mine, others = [[(one.status, one.note, str(one.error)) for one in tickets] for tickets in play.tickets]
    assert mine == others


def test_the_lives_have_calm_cycles_in_every_state_that_is_powered_and_others():
    calm, others = set(), set()
    for seed in range(24):
        play = Play(seed)
        core = play.cores[0]
        for inputs in play.inputs(CYCLES):
            was = core._was_calm
            play.port.write(core.step(inputs))
            (calm if was and core._was_calm else others).add(core.state)
    powered = {AxisState.STANDSTILL, AxisState.STOPPING, AxisState.HOMING}
    assert calm >= powered | {
        AxisState.SYNCHRONIZED_MOTION,
        AxisState.CONTINUOUS_MOTION,
        AxisState.DISCRETE_MOTION,
    }
    assert others >= {
        AxisState.DISABLED,
        AxisState.ERRORSTOP,
        AxisState.STANDSTILL,
        AxisState.SYNCHRONIZED_MOTION,
    }


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [
        (lambda core: core.image, "state", State.QUICK_STOP_ACTIVE),
        (lambda core: core.image, "operational", False),
        (lambda core: core.image, "lost_count", True),
        (lambda core: core.image, "emcy", ("one",)),
        (lambda core: core, "powered", False),
        (lambda core: core, "touched", False),
        (lambda core: core, "state", AxisState.ERRORSTOP),
        (lambda core: core, "tripped", "an error"),
        (lambda core: core, "_broken", "an error"),
        (lambda core: core, "_story", "a fault's"),
        (lambda core: core.order, "goal", State.SWITCHED_ON),
        (lambda core: core.stopping, "ladder", "one"),
    ],
)
def test_one_thing_out_of_the_ordinary_is_enough_for_a_cycle_not_to_be_calm(part, name, value):
    core = rig().enabled().core
    assert core._is_calm(core.image)
    setattr(part(core), name, value)
    assert not core._is_calm(core.image)


def test_a_cycle_that_comes_later_than_the_longest_gap_is_not_calm():
    core = rig().enabled().core
    longest = core.supervision.longest_gap
    calm = []
    for gap in (0.0, longest, 1.001 * longest):
        core.image.gap = gap
        calm.append(core._is_calm(core.image))
    assert calm == [True, True, False]
