"""Virtual time: waiting takes no real time, one thread runs at a time, and every run is the same."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
from types import FrameType, SimpleNamespace
from typing import Any

import pytest

from axisbus.clock import REAL, Clock, FairLock, RealSpeed, VirtualClock, poll_until, sleep_until
from axisbus.errors import StateError

HOUR = 3600.0


class Ticks:
    """An event source that is due every ``period`` seconds, ``count`` times."""

    def __init__(self, clock: VirtualClock, period: float, count: int = 1000) -> None:
        self.due, self._period, self._left = period, period, count
        self.seen: list[float] = []
        self.caught_up: list[float] = []
        self._clock = clock

    def run(self, now: float, until: float) -> None:
        assert now == self.due <= until
        self.seen.append(now)
        self._left -= 1
        self.due = now + self._period if self._left else math.inf

    def catch_up(self, now: float) -> None:
        self.caught_up.append(now)


@pytest.fixture(params=["real", "virtual"])
def clock(request: pytest.FixtureRequest) -> Clock:
    return REAL if request.param == "real" else VirtualClock()


# -- both clocks -------------------------------------------------------------------------------------------------------


def test_a_sleep_lasts_at_least_its_time(clock: Clock) -> None:
    began = clock.now()
    clock.sleep(0.02)
    assert clock.now() - began >= 0.02


def test_an_event_wakes_a_thread_that_waits_for_it(clock: Clock) -> None:
    event, seen = clock.event(), list[bool]()
    thread = clock.thread(lambda: seen.append(event.wait(10.0)), "axisbus test")
    thread.start()
    clock.sleep(0.01)
    assert thread.is_alive()
    event.set()
    thread.join(10.0)
    assert seen == [True]
    assert event.is_set()
    assert not thread.is_alive()


def test_a_wait_ends_at_its_time_out(clock: Clock) -> None:
    began = clock.now()
    assert not clock.event().wait(0.02)
    condition = clock.condition()
    with condition:
        assert not condition.wait(0.02)
    assert clock.now() - began >= 0.04


def test_a_lock_is_held_by_one_of_many_threads_of_the_program(clock: Clock) -> None:
    """They do not wait for it: while they waited, virtual time would pass."""
    lock, count = clock.lock(), 0

    def add() -> None:
        nonlocal count
        for _ in range(300):
            while not lock.acquire(blocking=False):
                time.sleep(0)
            before = count
            time.sleep(0)  # another thread may run here
            count = before + 1
            lock.release()

    threads = [threading.Thread(target=add) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert count == 1200


def test_a_condition_is_waited_for_until_something_holds(clock: Clock) -> None:
    condition, items = clock.condition(), list[int]()

    def add() -> None:
        for number in range(3):
            clock.sleep(0.01)
            with condition:
                items.append(number)
                condition.notify_all()

    clock.thread(add, "axisbus test").start()
    with condition:
        assert condition.wait_for(lambda: len(items) == 3, 5.0)
        began = clock.now()
        assert not condition.wait_for(lambda: len(items) == 4, 0.02)
    assert clock.now() - began >= 0.02


def test_polling_ends_when_the_condition_holds_or_the_time_is_over(clock: Clock) -> None:
    asked = list[float]()

    def done() -> bool:
        asked.append(clock.now())
        return len(asked) == 3

    begin = clock.now()
    assert poll_until(clock, done, begin + 10.0, 0.005)
    assert not poll_until(clock, lambda: False, clock.now() + 0.02, 0.005)
    assert clock.now() - begin >= 0.03
    sleep_until(clock, begin)  # which has passed
    sleep_until(clock, begin + 0.05)
    assert clock.now() >= begin + 0.05


def test_a_condition_wakes_one_or_all(clock: Clock) -> None:
    condition, woken = clock.condition(), list[int]()

    def wait(number: int) -> None:
        with condition:
            if condition.wait(10.0):
                woken.append(number)

    threads = [clock.thread(lambda number=number: wait(number), "axisbus test") for number in range(3)]
    for thread in threads:
        thread.start()
    clock.sleep(0.05)
    with condition:
        condition.notify()
    clock.sleep(0.05)
    assert len(woken) == 1
    with condition:
        condition.notify_all()
    for thread in threads:
        thread.join(10.0)
    assert sorted(woken) == [0, 1, 2]


def test_a_lock_that_is_held_while_waiting_lets_the_next_in_later(clock: Clock) -> None:
    lock, order = clock.lock(), list[str]()

    def other() -> None:
        with lock:
            order.append("other")

    with lock:
        thread = clock.thread(other, "axisbus test")
        thread.start()
        clock.sleep(0.02)
        assert not lock.acquire(blocking=False)
        assert not lock.acquire(timeout=0.01)
        order.append("first")
    thread.join(10.0)
    assert order == ["first", "other"]
    assert lock.acquire(timeout=0.01)
    lock.release()


def test_a_fair_lock_is_given_to_the_one_who_waits_although_the_holder_asks_again_at_once(
    clock: Clock,
) -> None:
    lock, held, end = FairLock(clock), list[float](), clock.event()

    def hold() -> None:
        while not end.is_set():
            with lock:
                held.append(clock.now())
                clock.sleep(0.02)

    thread = clock.thread(hold, "holds the lock again and again")
    thread.start()
    clock.sleep(0.01)
    with lock:
        assert len(held) == 1
        assert lock.locked()
        assert not lock.acquire(timeout=0.05)
    clock.sleep(0.05)
    end.set()
    thread.join(5)
    assert not thread.is_alive()
    assert len(held) > 1
    assert not lock.locked()


def test_a_thread_knows_itself(clock: Clock) -> None:
    seen: list[bool] = []
    thread = clock.thread(lambda: seen.append(clock.is_current(thread)), "axisbus test")
    assert not clock.is_current(thread)
    assert not clock.is_current(None)
    thread.start()
    thread.join(10.0)
    assert seen == [True]


# -- virtual time ------------------------------------------------------------------------------------------------------


def test_at_real_speed_virtual_time_is_not_ahead_of_real_time_and_a_pause_only_delays_it(monkeypatch) -> None:
    real, clock = VirtualClock(), VirtualClock()
    monkeypatch.setattr("axisbus.clock.REAL", real)
    clock.add(RealSpeed())
    clock.sleep(1.0)
    assert real.now() == pytest.approx(1.0, abs=0.02)
    real.sleep(5.0)  # the computer pauses
    clock.sleep(1.0)
    assert (clock.now(), real.now()) == (2.0, pytest.approx(7.0, abs=0.02))


def test_waiting_takes_no_real_time() -> None:
    clock, began = VirtualClock(), time.perf_counter()
    clock.sleep(HOUR)
    assert not clock.event().wait(HOUR)
    assert clock.now() == 2 * HOUR
    assert time.perf_counter() - began < 60.0


def test_events_happen_at_their_times_while_a_thread_waits() -> None:
    clock = VirtualClock()
    ticks = Ticks(clock, 0.25)
    clock.add(ticks)
    assert not ticks.seen  # no time passes
    clock.sleep(1.0)
    assert ticks.seen == [0.25, 0.5, 0.75, 1.0]
    assert ticks.caught_up == [1.0]  # a read of a plant after a wait gives its present state


def test_an_event_that_wakes_the_program_ends_its_wait_at_once() -> None:
    clock = VirtualClock()
    event = clock.event()
    ticks = Ticks(clock, 0.25)
    run = ticks.run
    ticks.run = lambda now, until: (run(now, until), now == 0.5 and event.set())  # type: ignore[method-assign,func-returns-value]
    clock.add(ticks)
    assert event.wait(10.0)
    assert clock.now() == 0.5


def test_threads_run_one_at_a_time_in_the_order_of_their_times() -> None:
    def played() -> list[tuple[float, str]]:
        clock, seen = VirtualClock(), list[tuple[float, str]]()

        def live(name: str, period: float) -> None:
            for _ in range(4):
                clock.sleep(period)
                seen.append((clock.now(), name))

        threads = [
            clock.thread(lambda name=name, period=period: live(name, period), "axisbus test")
            for name, period in (("a", 0.3), ("b", 0.2), ("c", 0.3))
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return seen

    once = played()
    assert once == sorted(once, key=lambda each: each[0])
    assert [played() for _ in range(3)] == [once] * 3


def test_a_wait_that_nothing_can_end_is_an_error() -> None:
    with pytest.raises(StateError, match="nothing more can happen in virtual time"):
        VirtualClock().event().wait()


def test_a_thread_that_nothing_can_wake_does_not_keep_the_program_from_continuing() -> None:
    clock = VirtualClock()
    thread = clock.thread(lambda: clock.event().wait(), "axisbus test")
    thread.start()
    clock.sleep(5.0)
    assert thread.is_alive()
    thread.join(1.0)
    assert clock.now() == 6.0
    clock.close()
    assert not thread.is_alive()


def test_closing_ends_threads_in_every_wait_and_those_that_have_not_begun() -> None:
    clock, cleaned = VirtualClock(), list[str]()

    def live() -> None:
        try:
            clock.sleep(HOUR)
        finally:
            cleaned.append("up")

    waits, waits_too, never_ran = (clock.thread(live, "axisbus test") for _ in range(3))
    waits.start()
    waits_too.start()
    clock.sleep(1.0)
    never_ran.start()
    before = threading.active_count()
    clock.close()
    assert cleaned == ["up", "up"]
    assert threading.active_count() == before - 3
    clock.close()


def test_an_interrupt_is_raised_when_the_other_thread_waits_again() -> None:
    """A signal handler may raise while another thread has the turn: two threads must never run at once."""
    clock, order = VirtualClock(), list[str]()

    def live() -> None:
        order.append("begins")
        time.sleep(0.05)  # the program's thread is interrupted meanwhile
        order.append("waits")
        clock.sleep(1.0)

    clock.thread(live, "axisbus test").start()
    back = clock._back
    calls = iter([KeyboardInterrupt()])

    def interrupted() -> bool:
        for error in calls:
            raise error
        return back.acquire()

    clock._back = SimpleNamespace(acquire=interrupted, release=back.release, locked=back.locked)  # type: ignore[assignment]
    with pytest.raises(KeyboardInterrupt):
        clock.sleep(0.5)
    assert order == ["begins", "waits"]
    clock.close()


class Interrupted(BaseException):
    """As of a signal handler."""


def interrupt_at(step: int) -> Callable[..., Any]:
    """Return a trace function that raises once, before the bytecode number ``step`` of handing a turn over."""
    steps = count(1)

    def local(frame: FrameType, event: str, _: object) -> Any:
        if event == "opcode" and next(steps) == step:
            raise Interrupted
        return local

    def trace(frame: FrameType, event: str, _: object) -> Any:
        if frame.f_code is not VirtualClock._run.__code__:
            return None
        frame.f_trace_opcodes = True
        return local

    return trace


@pytest.mark.parametrize("step", range(1, 60))
def test_an_interrupt_at_any_step_of_a_change_of_threads_loses_none_and_lets_no_two_run(step):
    clock, running, turns, together = VirtualClock(), [], Counter(), []

    def work(name: str) -> None:
        for _ in range(20):
            running.append(name)
            together.append(tuple(running))
            time.sleep(0.0002)  # another thread would begin now
            turns[name] += 1
            running.remove(name)
            clock.sleep(0.01)

    threads = [clock.thread(partial(work, name), f"axisbus test {name}") for name in "ab"]
    for thread in threads:
        thread.start()
    clock.sleep(0.05)
    before = sys.gettrace()
    sys.settrace(interrupt_at(step))
    try:
        with suppress(Interrupted):
            clock.sleep(0.03)
    finally:
        sys.settrace(before)
    assert not running
    clock.sleep(1.0)
    assert turns == {"a": 20, "b": 20}
    assert max(map(len, together)) == 1
    clock.close()
