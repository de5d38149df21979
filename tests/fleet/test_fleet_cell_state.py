"""The known state of a cell, of its events and of a lease, by received messages and times: no network and no clock."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.errors import AxisbusError, CommandError, LimitError, OwnershipError, Stopped
from axisbus.fleet.cell_state import AXES, FRESH, MAX_EVENTS, NEWEST, CellWatch, EventLog
from axisbus.fleet.command_retry import SILENCE, CommandRetry, SendAgain, Situation, error_of
from axisbus.fleet.fleet import unreached
from axisbus.fleet.lease_session import HeldLease
from axisbus.fleet.messages import (
    PROTOCOL,
    AxisInfo,
    AxisStateMessage,
    CellInfo,
    CommandAnswer,
    Event,
    EventsAnswer,
)
from axisbus.ipc.errors import ErrorFields, to_fields
from axisbus.motion.command_status import Status
from axisbus.version import __version__


def state(n, run="a", *, age=0.0, clock=100.0, told="Standstill", position=1.0, sent=None):
    return AxisStateMessage(n, run, clock, "deg", told, age, position=position, sent=sent)


def info(run="a", *, protocol=PROTOCOL, version=__version__, clock=100.0):
    axes = (AxisInfo("y", "mm"), AxisInfo("x", "deg"))
    return CellInfo(protocol, version, run, "hall", "press", clock, True, axes)


def event(n, run="a"):
    return Event(n, run, 100.0, "incident", f"event {n}")


@pytest.fixture
def watch():
    watch = CellWatch("press", 0.0)
    watch.token(True, 1.0)
    return watch


# -- states ------------------------------------------------------------------------------------------------------------


def test_the_age_of_a_value_counts_by_the_local_clock_from_its_received_age(watch):
    watch.store_state("x", state(1, age=0.3), 10.0, 100.0)
    assert watch.last_state("x", 10.0).fresh
    assert watch.last_state("x", 10.5).age == pytest.approx(0.8)
    assert watch.last_state("x", 10.0 + FRESH - 0.31).fresh
    assert not watch.last_state("x", 10.0 + FRESH - 0.29).fresh


def test_late_and_duplicate_values_change_nothing(watch):
    assert watch.store_state("x", state(5, position=5.0), 10.0, 100.0)
    assert not watch.store_state("x", state(5, position=6.0), 10.9, 100.0)
    assert not watch.store_state("x", state(4, position=4.0), 10.9, 100.0)
    assert watch.last_state("x", 10.0).state.position == 5.0
    assert watch.last_state("x", 11.0).age == pytest.approx(1.0)


@pytest.mark.parametrize("odd", [state(1, age=None), state(1, told="unknown"), state(1, age=1.5)])
def test_a_value_unknown_to_the_cell_is_unknown_here(watch, odd):
    watch.store_state("x", odd, 10.0, 100.0)
    assert not watch.last_state("x", 10.0).fresh


def test_states_that_a_congested_network_delivers_late_but_regularly_are_not_fresh(watch):
    """The delay grows to 3 s while ten states a second arrive. The bridge's clock differs by 500 s, and its clock is slow."""

    def receive(n, at, delay):
        watch.store_state("x", state(n, age=0.01, sent=(at - delay) * (1.0 - 1e-4) + 500.0), at, 100.0)
        return watch.last_state("x", at)

    for n in range(1, 100):
        assert receive(n, n / 10, 0.02 * (n % 3)).fresh
    for n in range(100, 200):
        delay = (n - 100) * 0.03
        seen = receive(n, n / 10, delay)
        assert seen.age == pytest.approx(delay, abs=0.1)
        assert seen.fresh is (seen.age <= FRESH)
    assert not watch.last_state("x", 20.0).fresh
    assert receive(200, 20.5, 0.0).fresh
    watch.token(False, 21.0)  # its computer is suspended for an hour, and so is its monotonic clock
    watch.token(True, 3620.0)
    assert receive(201, 3621.0, 3600.0).fresh


def test_the_state_of_an_unreachable_cell_is_not_fresh_at_once(watch):
    watch.store_state("x", state(1), 10.0, 100.0)
    watch.token(False, 10.1)
    assert not watch.alive
    assert watch.since == 10.1
    assert not watch.last_state("x", 10.1).fresh


def test_a_restarted_bridge_counts_from_1_and_values_of_the_one_before_are_dropped(watch):
    watch.store_info(info(), 100.0)
    watch.store_state("x", state(500), 10.0, 100.0)
    assert watch.store_state("x", state(1, "b", position=2.0), 10.1, 100.0)
    assert watch.info is None  # to be requested again
    assert not watch.store_state("x", state(501), 10.2, 100.0)
    assert not watch.store_info(info("a"), 100.0)
    assert watch.last_state("x", 10.2).state.position == 2.0


def test_two_bridges_of_one_name_are_reported_once_neither_can_be_one_that_was_killed(watch):
    watch.presence("a", True, 10.0)
    assert not watch.has_second_bridge(20.0)
    watch.presence("b", True, 20.0)
    assert not watch.has_second_bridge(21.0)
    assert watch.has_second_bridge(22.5)
    watch.presence("a", False, 23.0)
    assert not watch.has_second_bridge(23.0)


def test_of_two_bridges_the_first_counts_until_it_ends(watch):
    watch.presence("a", True, 10.0)
    assert watch.store_state("x", state(1, "a"), 10.0, 100.0)
    watch.presence("b", True, 11.0)
    assert not watch.store_state("x", state(1, "b"), 11.0, 100.0)
    watch.presence("a", False, 12.0)
    assert watch.store_state("x", state(2, "b"), 12.0, 100.0)
    watch.presence("a", True, 13.0)  # over another connection
    watch.presence("b", False, 14.0)
    assert watch.store_state("x", state(2, "a"), 14.0, 100.0)


def test_messages_of_a_bridge_that_is_not_present_change_nothing(watch):
    watch.presence("a", True, 10.0)
    watch.store_state("x", state(1, "a"), 10.0, 100.0)
    assert not watch.store_state("x", state(9, "nobody"), 10.1, 100.0)
    assert not watch.store_event(event(9, "nobody"))
    assert watch.last_state("x", 10.1).state.n == 1


def test_of_more_axes_than_a_cell_has_nothing_is_kept(watch):
    taken = [watch.store_state(f"x{n}", state(n + 1), 10.0, 100.0) for n in range(AXES + 10)]
    assert taken.count(True) == AXES


def test_a_bridge_that_waits_for_its_machine_is_there_and_its_cell_is_not(watch):
    watch.presence("a", True, 10.0)
    watch.token(False, 11.0)
    assert watch.bridged
    assert not watch.alive


def test_the_axes_are_in_the_order_of_the_cell_file_if_it_is_known(watch):
    watch.store_state("x", state(1), 10.0, 100.0)
    watch.store_state("a", state(2), 10.0, 100.0)
    assert watch.axes == ("a", "x")
    watch.store_info(info(), 100.0)
    assert watch.axes == ("y", "x")
    assert watch.axis_info("y").unit == "mm"
    assert watch.axis_info("z") is None


def test_a_difference_of_the_clocks_is_reported_and_changes_no_age(watch):
    watch.store_state("x", state(1, clock=4000.0), 10.0, 100.0)
    assert watch.clock_difference == 3900.0
    assert watch.last_state("x", 10.2).age == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (info(), ""),
        (info(version="0.0.1"), "axisbus 0.0.1"),
        (info(protocol=PROTOCOL + 1, version="9.9"), f"protocol {PROTOCOL + 1}"),
    ],
)
def test_a_version_that_differs_is_reported(watch, told, words):
    watch.store_info(told, 100.0)
    assert words in watch.differs
    assert bool(watch.differs) == bool(words)


# -- events ------------------------------------------------------------------------------------------------------------


class Bridge:
    """The events that a bridge keeps, and its answers."""

    def __init__(self, kept=1000, most=256):
        self.all, self.kept, self.most = [], kept, most

    def happen(self):
        self.all.append(event(len(self.all) + 1))
        return self.all[-1]

    def answer(self, ask):
        kept = self.all[-self.kept :]
        if not kept:
            return EventsAnswer("a")
        last = kept[-1].n if ask.last is None else ask.last
        found = tuple(each for each in kept if ask.first <= each.n <= last)
        return EventsAnswer("a", kept[0].n, kept[-1].n, found[: self.most])


def caught_up(log, bridge):
    for _ in range(100):
        if (ask := log.missing) is None:
            return
        log.answered(ask, bridge.answer(ask))
    raise AssertionError("it asks on and on")


@given(st.integers(0, 2**32), st.integers(1, 400), st.integers(0, 200))
def test_with_random_losses_delays_and_duplicates_all_events_are_stored_in_order(seed, count, before):
    chance, bridge, log, late = random.Random(seed), Bridge(), EventLog(), []
    for _ in range(before):
        bridge.happen()
    log.begin("a")
    caught_up(log, bridge)
    for _ in range(count):
        one, fate = bridge.happen(), chance.random()
        if fate < 0.3:
            late.append(one)
        elif fate < 0.8:
            log.add(one)
        if late and chance.random() < 0.1:
            log.add(late.pop())
        if chance.random() < 0.1:
            caught_up(log, bridge)
    log.add(bridge.happen())
    caught_up(log, bridge)
    numbers = [each.n for each in log.events]
    assert numbers == list(range(numbers[0], len(bridge.all) + 1))
    assert numbers[0] <= max(1, before - 49)
    assert log.lost == 0


def test_events_that_the_bridge_does_not_keep_are_counted_as_lost():
    bridge, log = Bridge(kept=10), EventLog()
    log.begin("a")
    caught_up(log, bridge)
    for _ in range(30):
        bridge.happen()
    log.add(bridge.all[-1])
    caught_up(log, bridge)
    assert [each.n for each in log.events] == list(range(21, 31))
    assert log.lost == 20


def test_events_from_a_cut_connection_are_requested_even_if_no_new_one_came():
    bridge, log = Bridge(), EventLog()
    log.begin("a")
    log.add(bridge.happen())
    caught_up(log, bridge)
    bridge.happen()
    assert log.missing is None
    log.require_check()
    caught_up(log, bridge)
    assert [each.n for each in log.events] == [1, 2]


def test_a_restarted_bridge_is_asked_for_its_events_and_earlier_events_are_kept():
    log = EventLog()
    log.begin("a")
    log.answered(NEWEST, EventsAnswer("a"))
    log.add(event(1))
    log.begin("b")
    assert log.missing == NEWEST
    log.answered(NEWEST, EventsAnswer("b", 1, 1))
    assert (log.missing.first, log.missing.last) == (1, 1)
    log.answered(log.missing, EventsAnswer("b", 1, 1, (event(1, "b"),)))
    assert [each.bridge for each in log.events] == ["a", "b"]
    assert log.missing is None


def test_an_answer_of_a_run_that_is_over_changes_nothing():
    log = EventLog()
    log.begin("b")
    log.answered(NEWEST, EventsAnswer("a", 1, 100))
    assert log.missing == NEWEST


def test_numbers_as_large_as_can_be_cost_no_time_and_no_room():
    log = EventLog()
    log.begin("a")
    log.answered(NEWEST, EventsAnswer("a"))
    log.add(event(1 << 60))
    log.answered(log.missing, EventsAnswer("a", 1 << 60, 1 << 60))
    assert log.lost == (1 << 60) - 1
    for n in range(3 * MAX_EVENTS):
        log.add(event((1 << 60) + n))
    assert len(log.events) == MAX_EVENTS
    assert log.missing is None


@pytest.mark.parametrize("joined", [True, False])
def test_a_gap_that_no_answer_fills_does_not_let_the_log_grow(joined):
    log = EventLog()
    log.begin("a")
    if joined:
        log.answered(NEWEST, EventsAnswer("a"))
    for n in range(2, 3 * MAX_EVENTS, 2):
        log.add(event(n))
    assert len(log._events) == MAX_EVENTS
    assert log.lost == (joined and 3 * MAX_EVENTS // 2 - 1 - MAX_EVENTS)
    log.answered(NEWEST, EventsAnswer("a", 1, 3 * MAX_EVENTS))
    assert (log.missing.first, log.missing.last) == (MAX_EVENTS - 1, MAX_EVENTS - 1)


# -- reachable endpoints -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("endpoints", "links", "missing"),
    [
        ([], ["tcp/10.0.0.9:50000"], []),
        (["tcp/10.0.0.5:7447"], ["tcp/10.0.0.5:7447"], []),
        (["tcp/10.0.0.5:7447#iface=eth0"], ["tcp/10.0.0.5:7447"], []),
        (["tcp/10.0.0.5:7447", "tcp/10.0.0.6:7447"], ["tcp/10.0.0.5:7447"], ["tcp/10.0.0.6:7447"]),
        (["tcp/10.0.0.5:7447"], ["tcp/10.0.0.9:50000"], ["tcp/10.0.0.5:7447"]),
        (["tls/one:7447", "tls/two:7447"], ["tls/10.0.0.5:7447"], ["tls/two:7447"]),
        (["tls/one:7447"], ["tls/10.0.0.5:7448"], ["tls/one:7447"]),
        (["tls/one:7447", "tls/10.0.0.5:7447"], ["tls/10.0.0.5:7447"], ["tls/one:7447"]),
        (["tcp/[::1]:7447"], ["tcp/[::1]:7447"], []),
    ],
)
def test_an_endpoint_counts_as_reached_if_a_connection_uses_it(endpoints, links, missing):
    assert unreached(endpoints, links) == missing


# -- the lease -----------------------------------------------------------------------------------------------------------


def test_a_lease_is_renewed_in_time_and_counts_from_its_request():
    lease = HeldLease("t", 1.0, 10.0)
    assert not lease.due(10.2)
    assert lease.due(10.26)
    assert not lease.due(10.3)  # an answer may come
    assert lease.due(10.4)
    lease.renewed(1.0, 10.26)
    assert lease.remaining(10.4) == pytest.approx(0.86)
    assert not lease.lost(11.25)
    assert lease.lost(11.27)


def test_a_lease_lasts_for_a_minute_at_most():
    lease = HeldLease("t", 1e300, 10.0)
    assert lease.remaining(10.0) == 60.0
    assert lease.next == 25.0
    lease.renewed(1e300, 20.0)
    assert lease.remaining(20.0) == 60.0


def test_a_late_answer_neither_shortens_nor_revives_a_lease():
    lease = HeldLease("t", 1.0, 10.0)
    lease.renewed(1.0, 10.8)
    lease.renewed(1.0, 10.3)
    assert lease.remaining(11.0) == pytest.approx(0.8)
    lease.refuse(OwnershipError("gone"))
    lease.renewed(1.0, 11.5)
    assert lease.lost(11.6)
    assert not lease.due(11.6)
    assert lease.why.message == "gone"


# -- how commands go on ----------------------------------------------------------------------------------------------------

HERE = Situation(10.0, True, "a", True)


def order(**more):
    return CommandRetry("press.x.move_absolute(position=1.0)", 10.0, "a", **more)


def test_an_answer_ends_a_command_as_it_ended_there():
    assert order().answered(CommandAnswer("done", note="well"), 10.0) == (Status.DONE, None, "well")
    limit = LimitError("beyond", observed="seen", remedy="do")
    end = order().answered(CommandAnswer("error", to_fields(limit)), 10.0)
    assert end.status is Status.ERROR
    assert (type(end.error), str(end.error)) == (LimitError, str(limit))
    assert order().answered(CommandAnswer("error", to_fields(Stopped("halt"))), 10.0).status is Status.ABORTED


def test_a_running_command_is_requested_again_and_is_active():
    one = order()
    assert isinstance(one.answered(CommandAnswer("running"), 10.0), SendAgain)
    assert one.active


@pytest.mark.parametrize(
    ("situation", "more", "why"),
    [
        (HERE, {}, None),
        (HERE._replace(alive=False), {}, "gone"),
        (HERE._replace(run="b"), {}, "has restarted"),
        (HERE._replace(leased=False), {}, "lease is lost"),
        (HERE._replace(leased=False), {"needs_lease": False}, None),
        (HERE, {"once": True}, "must not arrive late"),
        (HERE._replace(now=10.0 + SILENCE - 0.1), {}, None),
        (HERE._replace(now=10.0 + SILENCE + 0.1), {}, "did not answer"),
    ],
)
def test_a_command_without_an_answer_is_requested_again_until_its_end_is_unknown(situation, more, why):
    found = order(**more).unanswered(situation)
    if why is None:
        assert isinstance(found, SendAgain)
        return
    assert found.status is Status.ERROR
    assert isinstance(found.error, CommandError)
    assert why in found.error.observed
    assert "it is not known whether the axis moved" in found.error.remedy


def test_a_jog_that_was_taken_has_ended_here_for_asking_again_would_press_again():
    assert order(once=True).answered(CommandAnswer("running"), 10.0).status is Status.DONE


@pytest.mark.parametrize(
    "fields",
    [
        None,
        ErrorFields("NoSuchError", {"message": "it failed"}),
        ErrorFields("__import__", {"message": "it failed"}),
        ErrorFields("StateError", {}),
        ErrorFields("StateError", {"message": 3}),
    ],
)
def test_a_foreign_error_is_reported_as_far_as_possible(fields):
    error = error_of(fields, "press.x.halt()")
    assert type(error) is AxisbusError
    assert "press.x.halt()" in str(error)


def test_an_error_without_all_its_texts_can_be_printed():
    error = error_of(ErrorFields("StateError", {"message": "no", "observed": 3}), "x")
    assert str(error) == "no\n  observed: 3"


def test_the_description_of_a_cell_is_read_again_after_a_loss():
    watch = CellWatch("press", 0.0)
    watch.token(True, 0.0)
    watch.store_info(info(), 100.0)
    assert watch.informed
    watch.token(False, 1.0)
    watch.token(True, 2.0)
    assert not watch.informed
    assert watch.info is not None  # until the answer is here it is shown as it was
    watch.store_info(info(), 100.0)
    assert watch.informed
