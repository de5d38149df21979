"""Whether 6062h is the actual position under another name: only places that are really other ones count."""

from __future__ import annotations

import pytest

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import State
from axisbus.motion.axis import led

CSP, ON = int(ModeOfOperation.CYCLIC_SYNC_POSITION), State.OPERATION_ENABLED


@pytest.mark.parametrize("origin", [0, 100_000, -100_000])
def test_a_demand_that_trembles_with_the_axis_at_one_place_counts_once(origin):
    watched = led.Led()
    for number in range(100):
        place = origin + number % 2 * led._MOVED
        watched.judge(place, place, ON, CSP)
    assert not watched.idle


@pytest.mark.parametrize("step", [1000, -1000])
def test_a_demand_that_goes_along_with_the_axis_is_none(step):
    watched = led.Led()
    found = [watched.judge(step * number, step * number, ON, CSP) for number in range(1, 30)]
    assert found.index(True) == led._NO_CHANCE
    assert watched.idle


def test_a_demand_that_is_ahead_once_begins_the_count_anew():
    watched = led.Led()
    for number in range(1, 200):
        ahead = 7 if number % 3 == 0 else 0
        watched.judge(1000 * number + ahead, 1000 * number, ON, CSP)
    assert not watched.idle
