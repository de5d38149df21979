"""An axis that watches only its motion in uneventful cycles is the same, in all that it holds, as one that always looks at all."""

from __future__ import annotations

import functools
from collections import Counter, deque
from enum import Enum

import pytest

from axisbus.cia402.port import Sample, ValueTransport
from axisbus.cia402.state import PowerState
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.axis.fast_path import FastPath
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.commands import FollowTrajectory
from axisbus.motion.group.commands import MoveLinear
from axisbus.motion.group.core import GroupCore
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.motion.random_commands import Play
from kit.motion.rig import PERIOD, SCALE, rig

CYCLES = 700


class Thorough:
    """Makes a core look at all in every cycle."""

    def __init__(self, core: AxisCore) -> None:
        self.core = core

    def step(self, inputs):
        self.core._was_uneventful, self.core._fast_path = False, None
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
        pairs = [
            (f"{where}[{key!r}]", x, y)
            for key in a.keys() | b.keys()
            if (x := a.get(key)) is not (y := b.get(key))
        ]
    elif isinstance(a, (list, tuple, deque)):
        pairs = [(f"{where}[{n}]", x, y) for n, (x, y) in enumerate(zip(a, b, strict=False))]
        pairs.append((f"len({where})", len(a), len(b)))
    elif isinstance(a, functools.partial):
        pairs = [(where, list(a.args), list(b.args))]
    elif isinstance(a, (int, float, str, bytes, frozenset, set, Enum)) or callable(a):
        return [] if callable(a) or a == b or a != a else [f"{where}: {a!r} != {b!r}"]
    else:
        mine, others = parts(a), parts(b)
        pairs = [
            (f"{where}.{key}", x, y)
            for key in mine.keys() | others.keys()
            if (x := mine.get(key)) is not (y := others.get(key))
        ]
    return [
        found
        for path, x, y in pairs
        if not path.endswith(
            ("._was_uneventful", "._fast_path", "._present", "._path_values", "._motion")
        )  # the last ones: caches
        for found in differences(x, y, path, seen)
    ]


class GroupPlay(Play):
    """A random life mostly on paths; half of them are lines of a group, which has a clock of its own."""

    every = 90

    def __init__(self, seed: int, count: int = 1) -> None:
        super().__init__(seed, count)
        self.groups = [GroupCore({"x": core}, PERIOD) for core in self.cores]

    def _some_command(self):
        core = self.cores[0]
        if not core.powered or core.stop_sequence is not None or self.random.random() < 0.3:
            return super()._some_command()
        return FollowTrajectory(
            TrapezoidalTrajectory(self.here, self.here + self.random.choice((-90.0, 90.0)), 40.0, 300.0)
        )

    @property
    def here(self) -> float:
        image = self.cores[0].image
        return 0.0 if image.position is None else (image.position - image.origin) / SCALE

    def command(self, command):
        if not isinstance(command, FollowTrajectory) or self.random.random() < 0.5:
            super().command(command)
            return
        line = MoveLinear({"x": self.here + self.random.choice((-20.0, 4.0, 35.0))}, 40.0, 300.0)
        for group, tickets in zip(self.groups, self.tickets, strict=True):
            tickets.append(CommandStatus("line"))
            group.accept(line, tickets[-1])

    def inputs(self, cycles):
        for inputs in super().inputs(cycles):
            for group in self.groups:
                group.step()
            yield inputs


@pytest.mark.parametrize("kind", [Play, GroupPlay])
@pytest.mark.parametrize("seed", range(8))
def test_uneventful_cycles_give_the_outputs_and_state_of_whole_cycles(seed, kind):
    play = kind(seed, 2)
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


def test_the_random_plays_have_uneventful_cycles_in_every_powered_state_and_other_cycles():
    uneventful, others = set(), set()
    for seed in range(24):
        play = Play(seed)
        core = play.cores[0]
        for inputs in play.inputs(CYCLES):
            was = core._was_uneventful
            play.port.write(core.step(inputs))
            (uneventful if was and core._was_uneventful else others).add(core.state)
    powered = {AxisState.STANDSTILL, AxisState.STOPPING, AxisState.HOMING}
    assert uneventful >= powered | {
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


@pytest.mark.parametrize("kind", [Play, GroupPlay])
def test_the_random_plays_have_cycles_that_use_the_fast_path(kind, monkeypatch):
    taken, step = [], FastPath.step

    def noted(fast_path, inputs):
        outputs = step(fast_path, inputs)
        taken.append((outputs is not None, fast_path._follow._own_clock, inputs.demand is not None))
        return outputs

    monkeypatch.setattr(FastPath, "step", noted)
    for seed in range(16):
        play = kind(seed)
        for inputs in play.inputs(CYCLES):
            play.port.write(play.cores[0].step(inputs))
    counted = Counter(taken)
    if kind is Play:
        assert counted[True, True, False] > 100
        assert counted[False, True, False] > 10
    else:
        assert min(counted[True, own, demand] for own in (True, False) for demand in (True, False)) > 50
        assert counted[False, False, False] > 30


def cruising():
    """An axis on a long trajectory, and the inputs of its next cycle."""
    made = rig(port={"inputs": {"demand": ValueTransport.NONE}}).enabled()
    made.axis.follow(TrapezoidalTrajectory(0.0, 500.0, 20.0, 400.0))
    made.run(0.5)
    core, port, cycle = made.core, made.ports["x"], made.cycle
    cycle.wait_until(core.image.now + PERIOD)
    cycle.sync()
    return core, port.read(cycle.now())


def test_an_axis_on_a_trajectory_takes_the_short_cycle():
    core, inputs = cruising()
    assert core._fast_path.step(inputs) is not None


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [
        (lambda core: core, "state", AxisState.STOPPING),
        (lambda core: core, "powered", False),
        (lambda core: core, "touched", False),
        (lambda core: core, "halted", True),
        (lambda core: core, "tripped", "an error"),
        (lambda core: core, "_broken", "an error"),
        (lambda core: core, "_fault_diagnosis", "a fault's"),
        (lambda core: core.order, "goal", PowerState.SWITCHED_ON),
        (lambda core: core.order, "mode", 1),
        (lambda core: core.order, "word", 0x06),
        (lambda core: core.order, "bits", 0x10),
        (lambda core: core.order, "halt", True),
        (lambda core: core.order, "sdo", ["one"]),
        (lambda core: core.order, "cancel", [1]),
        (lambda core: core.order, "nmt_stop", True),
        (lambda core: core.order, "target_position", 5),
        (lambda core: core.order, "target_velocity", 0),
        (lambda core: core.order, "target_torque", 0),
        (lambda core: core.stopping, "stop_sequence", "one"),
        (lambda core: core.standstill_waiters, "waiting", ["one"]),
        (lambda core: core.running, "set_point", "one"),
        (lambda core: core.running, "activity", None),
        (lambda core: core.activity.clock, "braking", True),
        (lambda core: core.image.reference_tracker, "target", None),
        (lambda core: core.image.reference_tracker, "target", 10_000_000),
        (lambda core: core.image, "had_demand", True),
        (lambda core: core.image, "position_stamp", -1e9),
        (lambda core: core.supervision.following, "commanded_at", 1e9),
    ],
)
def test_each_thing_that_a_command_may_have_changed_ends_the_short_cycle(part, name, value):
    core, inputs = cruising()
    setattr(part(core), name, value)
    assert core._fast_path.step(inputs) is None


def test_a_position_beyond_the_limits_ends_the_short_cycle():
    core, inputs = cruising()
    path = core.activity
    path._limits, path._path_values, path._is_known = (-1.0, 0.5), None, True
    assert core._fast_path.step(inputs) is None


def other(sample, value=None, age=0.0):
    """A sample with another value, or one that is older."""
    return Sample(sample.value if value is None else value, sample.stamp - age)


@pytest.mark.parametrize(
    "change",
    [
        lambda _: {"operational": False},
        lambda _: {"emcy": ("one",)},
        lambda _: {"sdo": ("a reply",)},
        lambda _: {"nmt": 127},
        lambda _: {"bus": "off"},
        lambda _: {"overdue": True},
        lambda _: {"statusword": None},
        lambda i: {"statusword": other(i.statusword, 0x0233)},
        lambda i: {"statusword": other(i.statusword, age=9.0)},
        lambda _: {"mode": None},
        lambda i: {"mode": other(i.mode, 3)},
        lambda i: {"mode": other(i.mode, age=9.0)},
        lambda _: {"position": None},
        lambda i: {"position": other(i.position, age=9.0)},
        lambda i: {"position": other(i.position, age=0.02)},
        lambda i: {"position": other(i.position, age=-9.0)},
        lambda i: {"position": other(i.position, i.position.value + 100_000)},
        lambda i: {"position": other(i.position, i.position.value - 2**32)},
        lambda i: {"velocity": other(i.velocity, age=9.0)},
        lambda i: {"torque": other(i.torque, age=9.0)},
        lambda i: {"demand": other(i.position, i.position.value + 100_000)},
        lambda i: {"now": i.now + PERIOD},
        lambda i: {"now": i.now + 9.0},
        lambda i: {"now": i.now - 0.5},
    ],
)
def test_one_value_out_of_the_ordinary_leaves_the_cycle_to_the_whole_step_and_changes_nothing(change):
    core, inputs = cruising()
    twin, _ = cruising()
    assert core._fast_path.step(inputs._replace(**change(inputs))) is None
    found = differences(core, twin, "core", set())
    assert not [
        path for path in found if "image.now" not in path and "stamp" not in path and "since" not in path
    ], found[:9]


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [
        (lambda core: core.image, "state", PowerState.QUICK_STOP_ACTIVE),
        (lambda core: core.image, "operational", False),
        (lambda core: core.image, "lost_count", True),
        (lambda core: core.image, "emcy", ("one",)),
        (lambda core: core, "powered", False),
        (lambda core: core, "touched", False),
        (lambda core: core, "state", AxisState.ERRORSTOP),
        (lambda core: core, "tripped", "an error"),
        (lambda core: core, "_broken", "an error"),
        (lambda core: core, "_fault_diagnosis", "a fault's"),
        (lambda core: core.order, "goal", PowerState.SWITCHED_ON),
        (lambda core: core.stopping, "stop_sequence", "one"),
    ],
)
def test_each_single_exceptional_condition_makes_a_cycle_eventful(part, name, value):
    core = rig().enabled().core
    assert core._is_uneventful(core.image)
    setattr(part(core), name, value)
    assert not core._is_uneventful(core.image)


def test_a_cycle_after_more_than_the_longest_gap_is_eventful():
    core = rig().enabled().core
    longest = core.supervision.longest_gap
    uneventful = []
    for gap in (0.0, longest, 1.001 * longest):
        core.image.gap = gap
        uneventful.append(core._is_uneventful(core.image))
    assert uneventful == [True, True, False]
