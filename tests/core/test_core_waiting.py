"""Which threads may wait for the scan: each but its own, also one with the identifier of a scan's thread that has ended."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import pytest

from axisbus.core.scan_thread import ScanThread
from axisbus.core.waiting import ThreadWaiter
from axisbus.errors import StateError
from axisbus.machine.machine import Machine
from kit.pages import ROOT


def scan_of(run) -> Any:
    return SimpleNamespace(run=run, period=0.01, waiter=None, ended=True, lateness=SimpleNamespace(cycles=0))


def error_of_waiting(waiter: ThreadWaiter) -> StateError | None:
    try:
        waiter.wait(lambda: False, 0.0)
    except StateError as error:
        return error
    return None


def test_a_scans_thread_cannot_wait_for_itself_and_a_later_thread_with_its_identifier_can_wait():
    waiter, found, begun = ThreadWaiter(), [], threading.Event()

    def run():
        begun.wait(10.0)
        found.append((threading.get_ident(), error_of_waiting(waiter)))

    scan = ScanThread(scan_of(run), waiter, None)
    scan.start()
    begun.set()
    scan.stop()
    ((ident, error),) = found
    assert "a callback cannot wait" in str(error)
    later = []
    for _ in range(
        100
    ):  # the system gives the identifier of a thread that has ended to one of the next threads
        thread = threading.Thread(
            target=lambda: later.append((threading.get_ident(), error_of_waiting(waiter)))
        )
        thread.start()
        thread.join()
        if later[-1][0] == ident:
            break
    else:
        pytest.skip("this system does not use the identifier of a thread again")
    assert later[-1][1] is None


def test_in_virtual_time_a_callback_that_waits_is_refused_too():
    with Machine.simulated(ROOT / "examples" / "cell.toml") as machine:
        machine["x"].enable().wait()
        errors = []

        def wait_in_callback() -> None:
            for wait in (lambda: machine["x"].halt().wait(1.0), lambda: machine.sleep(0.1)):
                with pytest.raises(StateError, match="a callback cannot wait") as caught:
                    wait()
                errors.append(caught.value)

        machine["x"].move_relative(2.0).add_done_callback(wait_in_callback)
        machine.sleep(2.0)
        assert len(errors) == 2
        machine["x"].move_relative(2.0).wait(5.0)
