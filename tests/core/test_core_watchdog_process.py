"""Whether a watchdog process runs, by its bytes: a suspended one is noticed soon, and a busy computer is not mistaken for that."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from typing import NamedTuple

import pytest

from axisbus.core.process.rescue import BEAT_PERIOD, WatchdogProcessMonitor, state_of


class Look(NamedTuple):
    """One look: seconds since the one before, whether a byte came, and the state of the process."""

    passed: float = BEAT_PERIOD
    came: bool = False
    state: str = "S"


def found(looks: list[Look]) -> tuple[int, str] | None:
    """The first look at which axes must be stopped, and why."""
    now, state = 100.0, ""
    watch = WatchdogProcessMonitor(now, lambda: state)
    for number, look in enumerate(looks):
        now, state = now + look.passed, look.state
        if (why := watch.poll(now, look.came)) is not None:
            return number, why
    return None


@pytest.mark.parametrize("state", ["T", "t", "S", "Z", ""])
def test_a_watchdog_process_that_stops_sending_is_detected_within_a_second(state):
    number, why = found([Look(came=True)] * 20 + [Look(state=state)] * 20) or (99, "")
    assert 0.6 < (number - 19) * BEAT_PERIOD < 1.0
    assert why.startswith("the watchdog process of the core has not answered for 0.")


@pytest.mark.parametrize("state", ["R", "D"])
def test_a_watchdog_process_waiting_for_the_computer_has_five_seconds_before_the_computer_is_named(
    state,
):
    assert found([Look(state=state)] * 45) is None
    number, why = found([Look(state=state)] * 60) or (0, "")
    assert 5.0 <= (number + 1) * BEAT_PERIOD < 5.3
    assert why.startswith("the watchdog process of the core got no processor time for 5.")


def test_time_in_which_the_core_itself_did_not_run_does_not_count():
    assert found([Look(passed=3.0, state="T"), Look(came=True)] * 10) is None
    assert found([Look(passed=0.5, state="T")] * 50) is None


def test_a_byte_sent_before_the_state_was_read_is_waited_for():
    starved = [Look(state="R")] * 20
    assert found([*starved, Look(state="S"), Look(came=True), *starved]) is None


def test_slow_bytes_are_bytes():
    assert found([Look(), Look(), Look(), Look(), Look(came=True)] * 20) is None


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_the_state_of_a_process_is_read_and_is_empty_after_its_end():
    sleeper = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        os.kill(sleeper.pid, signal.SIGSTOP)
        until = time.monotonic() + 10.0
        while (state := state_of(sleeper.pid)) != "T":
            assert time.monotonic() < until, state
    finally:
        sleeper.kill()
        sleeper.wait()
    assert state_of(sleeper.pid) == ""
