"""How late cycles were: quantiles from classes, and why cycles were skipped."""

from __future__ import annotations

import gc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.core.lateness import Cause, Lateness, cause_of
from axisbus.core.realtime_setup import Collector
from axisbus.session import LATENESS_BOUNDS, LatenessReport
from kit.cell import Stage


def counted(*delays: float) -> LatenessReport:
    lateness = Lateness()
    for late in delays:
        lateness.note(late)
    return lateness.report()


def test_before_the_first_cycle_the_report_is_empty():
    assert Lateness().report() == LatenessReport()
    assert str(LatenessReport()) == "no cycle yet"
    assert LatenessReport().mean == 0.0


@given(st.lists(st.floats(1e-6, 60.0), min_size=1, max_size=200))
def test_a_quantile_is_at_most_an_eighth_above_the_delay_that_it_is_of(delays):
    report, ordered = counted(*delays), sorted(delays)
    for share, told in ((0.5, report.p50), (0.99, report.p99)):
        needed = next(late for number, late in enumerate(ordered, 1) if number >= share * len(delays))
        assert needed <= told <= needed * 1.125 + 1e-12 or told == report.worst
        assert needed <= told
    assert report.worst == ordered[-1]
    assert report.mean == pytest.approx(sum(delays) / len(delays))


@given(st.lists(st.floats(0.0, 100.0), max_size=200))
def test_how_many_cycles_lie_within_a_bound_is_no_estimate(delays):
    report = counted(*delays)
    assert report.within == tuple(sum(late < bound for late in delays) for bound in LATENESS_BOUNDS)
    assert report.within[-1] == report.cycles == len(delays)
    assert report.total == pytest.approx(sum(delays))


@pytest.mark.parametrize("late", [0.0, -0.0, 1e-9, -1e-7, 1e-6, 63.9, 64.1, 1e9])
def test_any_delay_has_a_class(late):
    report = counted(late)
    assert report.p50 <= max(0.0, report.worst)
    assert report.cycles == 1


def test_a_report_does_not_count_on():
    lateness = Lateness()
    lateness.note(0.001)
    before = lateness.report()
    lateness.note(0.5)
    lateness.skip(2, Cause.SEND)
    assert (before.cycles, before.worst, before.skipped, before.causes) == (1, 0.001, 0, {})
    after = lateness.report()
    assert (after.cycles, after.skipped, after.causes) == (2, 2, {"a send that blocked": 2})


def test_the_report_as_text():
    lateness = Lateness()
    for late in (0.00025, 0.00025, 0.032):
        lateness.note(late)
    lateness.skip(3, Cause.COLLECTOR)
    assert (
        str(lateness.report()) == "3 cycles, half of them at most 275 µs late, 99 % 32000, the worst 32000; "
        "3 skipped (3 because of the garbage collector)"
    )


@pytest.mark.parametrize(
    ("overrun", "sending", "collecting", "cause"),
    [
        (-0.008, 0.0, 0.0, Cause.NOT_RUN),
        (0.004, 0.004, 0.0, Cause.NOT_RUN),  # the most of it passed after the cycle before
        (0.01, 0.009, 0.0, Cause.SEND),
        (0.01, 0.001, 0.0, Cause.WORK),
        (0.01, 0.009, 0.006, Cause.COLLECTOR),
        (-0.008, 0.0, 0.01, Cause.COLLECTOR),
    ],
)
def test_why_a_cycle_was_ten_milliseconds_late(overrun, sending, collecting, cause):
    assert cause_of(0.01, overrun, sending, collecting) is cause


def test_the_time_of_the_collector_is_counted_while_it_is_watched():
    collector = Collector()
    gc.collect()
    assert collector.seconds == 0.0
    collector.watch()
    try:
        gc.collect()
        took = collector.seconds
        assert took > 0.0
    finally:
        collector.forget()
    gc.collect()
    assert collector.seconds == took


def test_a_cell_reports_a_send_that_blocked(tmp_path):
    with Stage(tmp_path) as stage:
        cell = stage.simulated()
        cell.run(0.5)
        assert cell.machine.cycle_jitter.skipped == 0
        cell.faults.send_blocks = 0.05
        cell.run(0.5)
        report = cell.machine.cycle_jitter
        assert set(report.causes) == {"a send that blocked"}
        assert report.skipped == report.causes["a send that blocked"] >= 3
