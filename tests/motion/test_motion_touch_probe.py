"""Touch probes under random edges, slow and missing answers, late cycles and further requests: every report is true."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.motion.probing.arming import Latch, is_within
from kit.motion.rig import SCALE, rig


class Signal:
    """Input 1 of a rig's drive; holds every rising edge that there was: its number, and where."""

    def __init__(self, r) -> None:
        r.run(0.05)  # until it is known where the axis is
        self._r = r
        self.edges: list[int] = []

    def pulse(self) -> None:
        """Give a rising edge, and a falling one after it."""
        probe = self._r.drive.touch_probe
        probe.set_input(1, True)
        self.edges.append(round(self._r.drive.axis.motor.position))
        probe.set_input(1, False)


def disturb(dice: random.Random, r) -> None:
    """Let answers be slow or missing for a while, or a cycle be late."""
    dials = r.device.dials
    dials.sdo_delay = dice.choice([0.0, 0.0, 0.002, 0.015, 0.05])
    dials.sdo_silent = dice.random() < 0.03
    r.cycle.dials.wait_late = dice.choice([0.0, 0.0, 0.0, 0.003, 0.012])


def turned(r, dice: random.Random) -> None:
    """Turn the motor by hand, so that each edge is at another place."""
    r.drive.axis.motor.position += dice.randrange(1, 40)


def calm(r) -> None:
    """Let nothing be disturbed any more."""
    r.device.dials.sdo_silent, r.device.dials.sdo_delay, r.cycle.dials.wait_late = False, 0.0, 0.0


@pytest.mark.parametrize("seed", range(12))
def test_every_capture_is_an_edge_after_the_request_and_none_is_reported_twice(seed):
    dice, r = random.Random(seed), rig()
    signal = Signal(r)
    probe = r.axis.probe(continuous=True)
    for _ in range(200):
        disturb(dice, r)
        for _ in range(dice.choice([0, 0, 0, 0, 1, 1, 3])):
            turned(r, dice)
            signal.pulse()
        r.run(0.01)
    calm(r)
    r.run(4.0)
    assert probe.active, probe.error
    told = [signal.edges.index(round(edge.position * SCALE)) for edge in probe.captures]
    assert told == sorted(set(told))  # in order, and none twice
    assert told[-1] == len(signal.edges) - 1
    # The number of edges before the first one that was seen is unknown; later ones are reported or counted.
    assert told[-1] - told[0] == len(told) - 1 + sum(edge.missed for edge in probe.captures)


@pytest.mark.parametrize("seed", range(12))
def test_a_single_probe_reports_the_first_edge_since_it_is_armed(seed):
    dice, r = random.Random(seed), rig()
    signal = Signal(r)
    for _ in range(8):
        begun, sure = len(signal.edges), None
        probe = r.axis.probe()
        while probe.busy:
            disturb(dice, r)
            if dice.random() < 0.3:
                sure = len(signal.edges) if sure is None and probe.active else sure
                turned(r, dice)
                signal.pulse()
            r.run(0.01)
        assert probe.done, probe.error
        (only,) = probe.captures
        told = signal.edges.index(round(only.position * SCALE))
        assert begun <= told
        assert sure is None or told <= sure  # armed before, it lets none go by


@pytest.mark.parametrize("seed", range(12))
def test_requests_one_after_the_other_all_end_and_nothing_stays_armed(seed):
    dice, r = random.Random(seed), rig()
    signal, handles = Signal(r), []
    for _ in range(120):
        disturb(dice, r)
        what = dice.random()
        if what < 0.15:
            handles.append(
                r.axis.probe(
                    dice.choice([1, 2]),
                    dice.choice(["rising", "falling", "both"]),
                    continuous=dice.random() < 0.3,
                )
            )
        elif what < 0.25 and any(hasattr(h, "cancel") for h in handles):
            handles.append(dice.choice([h for h in handles if hasattr(h, "cancel")]).cancel())
        elif what < 0.3:
            handles.append(r.axis.probe_abort(dice.choice([1, 2])))
        elif what < 0.35:
            turned(r, dice)
            signal.pulse()
        r.run(0.01)
    calm(r)
    last = [r.axis.probe_abort(1), r.axis.probe_abort(2)]
    for handle in last:
        handle.wait(20)
    assert all(not handle.busy for handle in handles)
    assert r.drive.touch_probe.function == 0
    assert not r.core.probes.requests
    for handle in handles:
        handle.exception()  # looked at


# -- its parts -------------------------------------------------------------------------------------------------------


@given(st.lists(st.lists(st.integers(0, 3), min_size=3, max_size=3), min_size=1, max_size=30))
def test_a_counted_latch_never_pairs_a_position_with_the_count_of_another(looks):
    """The drive latches so many edges before each of three answers; edge n is at place 100 n."""
    latch, count, told = Latch(0x60BA, 0x60D5), 0, []
    missed = 0
    for edges in looks:
        latch.begin()
        gaps = iter([*edges, *edges, *edges])
        while not latch.over:
            count += next(gaps, 0)
            value = count & 0xFFFF if latch.next_object == 0x60D5 else 100 * count
            found = latch.take(value)
            if found is not None:
                told.append(found.raw // 100)
                missed += found.missed
    assert told == sorted(set(told))
    if told:
        assert told[-1] - told[0] == len(told) - 1 + missed


@given(st.lists(st.integers(-5, 5), max_size=40))
def test_without_a_counter_each_change_of_the_position_is_reported(places):
    latch, told = Latch(0x60BA, None), []
    for place in places:
        latch.begin()
        found = latch.take(place)
        assert latch.over
        told += [] if found is None else [found.raw]
    changes = [place for number, place in enumerate(places) if number == 0 or places[number - 1] != place]
    assert told == changes


@pytest.mark.parametrize(
    ("position", "window", "modulo", "inside"),
    [
        (5.0, None, None, True),
        (5.0, (5.0, 6.0), None, True),
        (6.0, (5.0, 6.0), None, True),
        (4.9, (5.0, 6.0), None, False),
        (365.0, (0.0, 10.0), 360.0, True),
        (-1.0, (350.0, 10.0), 360.0, True),
        (20.0, (350.0, 10.0), 360.0, False),
        (719.0, (350.0, 10.0), 360.0, True),
        (340.0, (350.0, 10.0), 360.0, False),
    ],
)
def test_a_window_is_from_one_position_to_another(position, window, modulo, inside):
    assert is_within(position, window, modulo) is inside
