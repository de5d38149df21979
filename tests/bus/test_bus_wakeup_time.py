"""How early a sleep is ended, as learned from earlier sleeps."""

from __future__ import annotations

import random

import pytest

from axisbus.bus.cycle import SleepMargin

MOST = 100e-6


def lived(*lates: float) -> SleepMargin:
    """The allowance learned from sleeps that were late by so many microseconds."""
    waking = SleepMargin(MOST)
    for late in lates:
        waking.note(late * 1e-6)
    return waking


def test_the_thread_is_woken_with_the_largest_allowance_until_enough_wakings_are_measured():
    assert lived().early == MOST
    assert lived(*[20] * 49).early == MOST


def test_after_fifty_sleeps_the_allowance_is_little_more_than_their_lateness():
    assert 20e-6 < lived(*[20] * 50).early < 30e-6


def test_a_sleep_is_shortened_by_at_most_the_maximum():
    assert lived(*[500] * 200).early == MOST


def test_a_later_waking_counts_at_once_and_for_a_hundred_wakings():
    quiet = [20] * 100
    assert lived(*quiet, 60).early > 60e-6
    assert lived(*quiet, 60, *[20] * 98).early > 60e-6
    assert lived(*quiet, 60, *[20] * 149).early == lived(*quiet).early


@pytest.mark.parametrize("seed", range(20))
def test_of_sleeps_that_are_late_by_anything_between_hardly_one_ends_after_its_time(seed: int):
    chance = random.Random(seed)
    waking, late = SleepMargin(MOST), 0
    for _ in range(2000):
        needed = chance.uniform(10e-6, 40e-6)
        late += needed > waking.early
        waking.note(needed)
    assert late == 0
    assert waking.early < 55e-6
