"""Handles: waiting, awaiting, several at once, and that a failure is never lost."""

from __future__ import annotations

import asyncio
import gc
import logging
import threading
import time

import pytest

from axisbus.cia402.port import Waiter
from axisbus.core.scan import Scan
from axisbus.core.waiting import ThreadWaiter
from axisbus.errors import DriveError, HomingError, MotionTimeout, Replaced, StateError, Stopped
from axisbus.machine.handle import NOBODY, Handle, wait
from axisbus.motion.command_status import Status, end_as
from kit.direct.waiting import PumpWaiter
from kit.motion.rig import PERIOD, rig


class RealTime:
    """A rig whose scan runs in a thread of its own, in real time."""

    def __init__(self, names: str = "x") -> None:
        self.rig = rig(names)
        cycle = self.rig.cycle
        advance, started = cycle.wait_until, time.monotonic() - cycle.now()

        def wait_until(t: float) -> None:
            time.sleep(max(0.0, started + t - time.monotonic()))
            advance(t)

        cycle.wait_until = wait_until
        self.waiter = ThreadWaiter()
        self.scan: Scan = self.rig.scan
        self.scan.waiter = self.waiter
        self.rig.session._waiter = self.waiter
        self.thread = threading.Thread(target=self.scan.run, name="test scan")

    def __enter__(self) -> RealTime:
        self.thread.start()
        self.waiter.callback_thread = self.thread
        return self

    def __exit__(self, *_: object) -> None:
        self.scan.quit()
        self.thread.join(5)
        assert not self.thread.is_alive()


# One handle.


def test_wait_returns_the_handle_and_an_ended_one_at_once():
    r = rig()
    handle = r.axis.enable()
    assert handle.busy
    assert not handle.done
    assert handle.wait(1) is handle
    before = r.now
    assert handle.wait() is handle
    assert r.now == before
    assert handle.done
    assert not handle.aborted
    assert handle.error is None
    assert handle.exception() is None


def test_a_wait_that_times_out_raises_and_the_motion_continues():
    r = rig().enabled()
    handle = r.axis.move_absolute(50.0)
    with pytest.raises(TimeoutError, match=r"x.move_absolute\(50 deg\): not ended after 0.1 s; it continues"):
        handle.wait(0.1)
    assert handle.busy
    handle.wait(5)
    assert r.drive.position == pytest.approx(50_000, abs=60)


def test_a_handle_shows_its_name_and_status():
    r = rig().enabled()
    handle = r.axis.move_absolute(50.0)
    assert repr(handle) == "<Handle x.move_absolute(50 deg): busy>"
    r.run(PERIOD)
    assert handle.active
    assert handle.status is Status.ACTIVE


def test_the_command_that_took_over_is_named_and_the_handle_counts_as_aborted():
    r = rig().enabled()
    first = r.axis.move_absolute(50.0)
    second = r.axis.move_absolute(20.0)
    second.wait(5)
    assert first.aborted
    assert isinstance(first.error, Replaced)
    assert first.error.message == "x.move_absolute(50 deg) was replaced by x.move_absolute(20 deg)"
    with pytest.raises(Replaced):
        first.wait()
    third = r.axis.move_absolute(40.0)
    r.axis.halt().wait(3)
    assert isinstance(third.exception(), Stopped)
    assert third.status is Status.ABORTED
    assert end_as(HomingError("x")) is Status.ERROR


def test_a_second_end_changes_nothing():
    handle = Handle("x", NOBODY)
    handle._finish(Status.DONE)
    handle._finish(Status.ERROR, DriveError("late"))
    assert handle.done
    assert handle.error is None


def test_callbacks_are_called_once_each_also_after_the_end():
    handle = Handle("x", NOBODY)
    calls = []
    handle.add_done_callback(lambda: calls.append("before"))
    assert calls == []
    handle._finish(Status.DONE)
    handle.add_done_callback(lambda: calls.append("after"))
    assert calls == ["before", "after"]


def test_callbacks_added_from_another_thread_while_the_handle_ends_are_called_exactly_once():
    for _ in range(200):
        handle, calls = Handle("x", NOBODY), []
        start = threading.Barrier(2)

        def add(handle=handle, calls=calls, start=start) -> None:
            start.wait()
            for number in range(20):
                handle.add_done_callback(lambda number=number: calls.append(number))

        thread = threading.Thread(target=add)
        thread.start()
        start.wait()
        handle._finish(Status.DONE)
        thread.join()
        assert sorted(calls) == list(range(20))


def test_a_callback_that_fails_ends_neither_the_scan_nor_the_other_callbacks(caplog):
    r = rig().enabled()
    called = []
    handle = r.axis.move_absolute(1.0)
    handle.add_done_callback(lambda: 1 / 0)
    handle.add_done_callback(lambda: called.append(True))
    handle.wait(5)
    r.run(0.1)
    assert not r.scan.ended
    assert called == [True]
    assert "ZeroDivisionError" in caplog.text
    assert "x.move_absolute(1 deg)" in caplog.text


def test_a_failed_handle_that_the_program_dropped_is_logged_by_name(caplog):
    handle = Handle("x.move_absolute(5 deg)", NOBODY)
    handle._finish(Status.ERROR, MotionTimeout("x: has not arrived", remedy="look whether it is blocked"))
    with caplog.at_level(logging.ERROR, "axisbus"):
        del handle
        gc.collect()
    assert "x.move_absolute(5 deg) failed, and its handle was not read" in caplog.text
    assert "look whether it is blocked" in caplog.text


@pytest.mark.parametrize("look", ["done", "aborted", "exception()", "wait()"])
def test_a_handle_that_was_read_or_only_aborted_is_not_reported(caplog, look):
    handle = Handle("x", NOBODY)
    handle._finish(Status.ERROR, DriveError("x"))
    if look == "wait()":
        with pytest.raises(DriveError):
            handle.wait()
    else:
        eval(f"handle.{look}")
    aborted = Handle("y", NOBODY)
    aborted._finish(Status.ABORTED, Stopped("y"))
    busy = Handle("z", NOBODY)
    del handle, aborted, busy
    gc.collect()
    assert caplog.text == ""


# Several.


def test_wait_for_several_returns_when_all_have_ended():
    r = rig("xyz").enabled()
    handles = [axis.move_absolute(10.0 * number) for number, axis in enumerate(r.axes.values(), 1)]
    assert wait(handles[0], handles[1:], timeout=10) == handles
    assert all(handle.done for handle in handles)


def test_all_failures_are_raised_together_and_the_first_stops_no_other_axis():
    r = rig("xyz", groups={"a": ["x"], "b": ["y"], "c": ["z"]}).enabled()
    r.drive_of("x").dials.blocked = r.drive_of("z").dials.blocked = True
    handles = [
        r.axes["x"].move_absolute(10.0, timeout=0.2),
        r.axes["y"].move_absolute(100.0),
        r.axes["z"].move_absolute(10.0, timeout=0.4),
    ]
    with pytest.raises(ExceptionGroup) as caught:
        wait(handles, timeout=10)
    assert [type(error) for error in caught.value.exceptions] == [MotionTimeout, MotionTimeout]
    assert [error.axis for error in caught.value.exceptions] == ["x", "z"]
    assert handles[1].done
    assert r.drive_of("y").position == pytest.approx(100_000, abs=60)


def test_waiting_for_several_has_one_time_out_in_virtual_time_too():
    r = rig("xy").enabled()
    for axis in r.axes.values():
        axis.move_velocity(10.0).wait(2)
    handles = [r.axes["x"].move_absolute(300.0, velocity=1.0), r.axes["y"].move_absolute(300.0, velocity=1.0)]
    start = r.now
    with pytest.raises(TimeoutError, match="they continue"):
        wait(handles, timeout=0.5)
    assert r.now - start == pytest.approx(0.5, abs=2 * PERIOD)
    assert all(handle.busy for handle in handles)


def test_waiting_for_nothing_is_done_at_once():
    assert wait([]) == []


def test_handles_of_two_machines_can_be_waited_for_together():
    one, other = rig(), rig()
    assert len(wait(one.axis.enable(), other.axis.enable(), timeout=5)) == 2
    assert one.drive.power.stage == other.drive.power.stage == 4


# asyncio, in virtual time.


def test_await_returns_the_handle_or_raises_its_error():
    r = rig().enabled()

    async def job():
        handle = await r.axis.move_absolute(5.0)
        assert handle.done
        r.drive.dials.blocked = True
        with pytest.raises(MotionTimeout):
            await r.axis.move_absolute(10.0, timeout=0.2)

    asyncio.run(job())


def test_gather_runs_commands_side_by_side():
    r = rig("xy").enabled()

    async def job():
        return await asyncio.gather(*(axis.move_absolute(50.0) for axis in r.axes.values()))

    start = r.now
    handles = asyncio.run(job())
    assert [handle.done for handle in handles] == [True, True]
    assert r.now - start < 1.0  # 0.7 s each


def test_cancelling_the_await_does_not_cancel_the_motion():
    r = rig().enabled()
    handle = r.axis.move_absolute(50.0)

    async def job():
        task = asyncio.ensure_future(_of(handle))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(job())
    assert handle.busy
    handle.wait(5)
    assert r.drive.position == pytest.approx(50_000, abs=60)


async def _of(handle: Handle) -> Handle:
    return await handle


# Threads, in real time.


def test_a_thread_waits_for_the_scan_in_another():
    with RealTime() as real:
        real.rig.axis.enable().wait(5)
        real.rig.axis.move_absolute(2.0).wait(5)
    assert real.rig.drive.position == pytest.approx(2_000, abs=60)


def test_a_wait_in_real_time_times_out_in_time():
    with RealTime() as real:
        real.rig.axis.enable().wait(5)
        handle = real.rig.axis.move_absolute(300.0, velocity=1.0)
        start = time.monotonic()
        with pytest.raises(TimeoutError):
            handle.wait(0.15)
        assert 0.14 < time.monotonic() - start < 2.0
        assert handle.busy
    assert handle.exception() is not None  # the scan has ended, and with it every handle


def test_an_event_loop_that_closed_before_the_motion_ends_does_not_disturb_the_scan():
    with RealTime() as real:
        real.rig.axis.enable().wait(5)
        handle = real.rig.axis.move_absolute(20.0)

        async def impatient():
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(_of(handle), 0.05)

        asyncio.run(impatient())
        handle.wait(5)
        assert handle.done
        real.rig.axis.move_absolute(21.0).wait(5)
        assert not real.scan.ended
    assert real.scan.failure is None


def test_a_task_awaits_the_scan_in_another_thread():
    with RealTime() as real:

        async def job():
            await real.rig.axis.enable()
            results = await asyncio.gather(
                real.rig.axis.move_absolute(1.0), asyncio.sleep(0.01), return_exceptions=True
            )
            return results[0]

        assert asyncio.run(job()).done


def test_the_scan_cannot_wait_for_itself():
    with RealTime() as real:
        seen = []

        def inside(_now, _snapshots) -> None:
            if not seen:
                handle = real.rig.axis.enable()
                handle.add_done_callback(handle.exception)
                try:
                    handle.wait(1)
                except StateError as error:
                    seen.append(error)

        real.scan.observers.append(inside)
        deadline = time.monotonic() + 5
        while not seen and time.monotonic() < deadline:
            time.sleep(0.005)
    assert seen[0].message == "a callback cannot wait for a command"


def test_both_waiters_implement_the_waiter_protocol():
    def seam(waiter: Waiter) -> Waiter:
        return waiter

    assert not seam(ThreadWaiter()).wait(lambda: False, 0.0)
    r = rig()
    start = r.now
    assert not seam(PumpWaiter(r.scan)).wait(lambda: False, 0.1)
    assert r.now - start == pytest.approx(0.1, abs=PERIOD)
    assert seam(NOBODY).wait(lambda: True, None)


def test_a_handle_is_a_coroutine_for_any_number_of_tasks():
    r = rig().enabled()
    handle = r.axis.move_absolute(5.0)

    async def job():
        assert asyncio.iscoroutine(handle)
        first, second = asyncio.create_task(handle), asyncio.create_task(handle)
        return await asyncio.gather(first, second, asyncio.wait_for(handle, 5.0))

    assert asyncio.run(job()) == [handle] * 3
    assert handle.done
    assert not handle._tasks


def test_a_task_that_is_made_of_a_handle_fails_as_it_does_and_is_cancelled_alone():
    r = rig().enabled()

    async def job():
        moving = r.axis.move_absolute(50.0)
        task, other = asyncio.create_task(moving), asyncio.create_task(moving)
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert moving.busy
        r.drive.dials.blocked = True
        with pytest.raises(MotionTimeout):
            await asyncio.create_task(r.axis.move_absolute(10.0, timeout=0.2))
        with pytest.raises(Replaced):
            await other
        assert not moving._tasks

    asyncio.run(job())
