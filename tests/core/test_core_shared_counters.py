"""The counters of a core, read by another process from shared memory."""

from __future__ import annotations

import mmap

from axisbus.cia301.frame import BusTraffic
from axisbus.core.lateness import Cause, Lateness
from axisbus.core.process import shared_counters
from axisbus.core.process.shared_counters import SharedCounters
from axisbus.session import LatenessReport

AXES, POINTS = 3, 2


def memory() -> mmap.mmap:
    return mmap.mmap(-1, shared_counters.offset(AXES, POINTS) + shared_counters.SIZE)


def test_before_the_first_cycle_there_is_nothing():
    reader = SharedCounters(memory(), AXES, POINTS)
    assert reader.lateness == LatenessReport()
    assert reader.carried is None


def test_counts_from_before_and_after_sharing_are_read_by_others():
    shared = memory()
    lateness, reader = Lateness(), SharedCounters(shared, AXES, POINTS)
    lateness.note(0.002)
    SharedCounters(shared, AXES, POINTS).take(lateness)
    lateness.note(0.001)
    lateness.skip(3, Cause.COLLECTOR)
    assert reader.lateness == lateness.report()
    assert (reader.lateness.cycles, reader.lateness.skipped, reader.lateness.worst) == (2, 3, 0.002)
    assert reader.lateness.causes == {"the garbage collector": 3}


def test_the_bus_traffic_is_that_of_the_last_cycle():
    shared = memory()
    now = BusTraffic(1.0, 10, 80)
    write = SharedCounters(shared, AXES, POINTS).writer(lambda: now)
    reader = SharedCounters(shared, AXES, POINTS)
    write(1.0, {})
    now = BusTraffic(2.0, 2**40, 2**43)
    assert reader.carried == BusTraffic(1.0, 10, 80)
    write(2.0, {})
    assert reader.carried == now


def test_the_counters_change_no_other_bytes_of_the_shared_memory():
    """The numbers lie behind whatever else is in the memory."""
    shared = memory()
    before = shared[: shared_counters.offset(AXES, POINTS)]
    lateness = Lateness()
    SharedCounters(shared, AXES, POINTS).take(lateness)
    for number in range(1000):
        lateness.note(number * 1e-5)
    SharedCounters(shared, AXES, POINTS).writer(lambda: BusTraffic(1.0, 2**63, 2**63))()
    assert shared[: shared_counters.offset(AXES, POINTS)] == before
