"""The pace of a bus, measured on frames whose times are known."""

from __future__ import annotations

import random

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.trace.cycle_timing import CycleTiming, CyclicIdentifiers, histogram, spread

CAST = CyclicIdentifiers(
    0x80, frozenset({0x181, 0x182, 0x281}), frozenset({0x201, 0x202}), frozenset({0x181, 0x182})
)
PERIOD = 0.004


def cycle(began, tpdos=(0.0003, 0.0005, 0.0007), rpdos=(0.0002, 0.0009)):
    frames = [CanFrame(began, 0x80), CanFrame(began + 0.001, 0x701)]
    frames += [
        CanFrame(began + after, can_id) for after, can_id in zip(tpdos, (0x181, 0x182, 0x281), strict=False)
    ]
    return frames + [
        CanFrame(began + after, can_id) for after, can_id in zip(rpdos, (0x201, 0x202), strict=False)
    ]


def paced(frames, size=7):
    pace = CycleTiming(CAST, PERIOD)
    for start in range(0, len(frames), size):
        pace.add(frames[start : start + size])
    pace.finish()
    return pace


def test_frames_after_a_sync_are_measured_from_it():
    pace = paced([frame for number in range(100) for frame in cycle(10.0 + number * PERIOD)])
    assert (pace.cycles, pace.missing) == (99, 0)  # the last one is not over
    assert pace.off == pytest.approx([0.0] * 99, abs=1e-9)
    assert pace.last_tpdo == pytest.approx([0.0007] * 99)
    assert pace.last_rpdo == pytest.approx([0.0009] * 99)
    assert pace.skew == pytest.approx([0.0002] * 99)


def test_frames_reported_out_of_order_are_sorted_by_time():
    frames = [frame for number in range(300) for frame in cycle(number * PERIOD)]
    chance = random.Random(3)
    told = sorted(frames, key=lambda frame: frame.time + chance.uniform(0.0, 0.2))
    assert told != sorted(frames)
    for size in (1, 7, 100):
        assert paced(told, size).last_tpdo == paced(sorted(frames)).last_tpdo
        assert paced(told, size).missing == 0


def test_a_sync_that_is_missing_is_counted_and_one_that_is_late_is_off():
    begins = [0.0, PERIOD, 2 * PERIOD + 0.0005, 3 * PERIOD, 6 * PERIOD, 7 * PERIOD]
    pace = paced([frame for began in begins for frame in cycle(began)])
    assert (pace.cycles, pace.missing) == (5, 2)
    assert pace.off == pytest.approx([0.0, 0.0005, -0.0005, 0.0, 0.0], abs=1e-9)


def test_if_an_answer_is_missing_there_is_no_skew():
    pace = paced([*cycle(0.0), *cycle(PERIOD, tpdos=(0.0003,), rpdos=()), *cycle(2 * PERIOD)])
    assert len(pace.skew) == 1
    assert pace.last_tpdo == pytest.approx([0.0007, 0.0003])
    assert len(pace.last_rpdo) == 1


def test_frames_before_the_first_sync_belong_to_no_cycle():
    pace = paced([CanFrame(-0.001, 0x181), *cycle(0.0), *cycle(PERIOD)])
    assert pace.last_tpdo == pytest.approx([0.0007])


def test_values_are_spread_in_both_directions():
    found = spread([-5.0, 1.0, 2.0, -3.0])
    assert (found.cycles, found.least, found.p50, found.worst) == (4, 1.0, 3.0, 5.0)
    assert spread([float(number) for number in range(1000)]).p99 == 990.0
    assert spread([]) is None


def test_a_histogram_has_every_value_once():
    values = [random.Random(1).gauss(0, 1) for _ in range(1000)] + [3.0]
    bins = histogram(values, 10)
    assert sum(count for *_, count in bins) == len(values)
    assert bins[0][0] == min(values)
    assert bins[-1][1] == pytest.approx(max(values))
    for begin, end, count in bins[1:-1]:
        assert count == sum(1 for value in values if begin <= value < end)
    assert histogram([2.0, 2.0], 10) == [(2.0, 2.0, 2)]
