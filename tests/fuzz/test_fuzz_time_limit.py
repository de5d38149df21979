"""The limit of a fuzzer's single case leaves the test's own time-out alone, and comes before it."""

from __future__ import annotations

import signal
import time

import pytest

from kit.fuzz_frames import TooLongError, within


def test_a_case_that_does_not_end_is_ended():
    with pytest.raises(TooLongError), within(0.05):
        time.sleep(5)


def test_a_case_that_catches_its_interruption_is_interrupted_again():
    caught: list[TooLongError] = []

    def log_handler() -> None:
        try:
            time.sleep(5)
        except TooLongError as error:
            caught.append(error)

    def case() -> None:
        with within(0.05):
            log_handler()
            log_handler()
            time.sleep(5)

    began = time.monotonic()
    with pytest.raises(TooLongError):
        case()
    assert len(caught) == 2
    assert time.monotonic() - began < 4.0


def test_the_time_out_of_the_test_continues_behind_a_case():
    handler = signal.getsignal(signal.SIGALRM)
    left, _ = signal.getitimer(signal.ITIMER_REAL)
    assert left > 0.0  # this test's own
    with within(30):
        assert signal.getitimer(signal.ITIMER_REAL)[0] <= 30.0
    assert signal.getsignal(signal.SIGALRM) is handler
    assert left - 20.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= left


def test_a_case_may_not_have_as_much_time_as_the_whole_test():
    left, _ = signal.getitimer(signal.ITIMER_REAL)
    with pytest.raises(AssertionError, match="not below"), within(left + 1.0):
        pass


def test_without_a_running_time_out_none_runs_later():
    left, _ = signal.setitimer(signal.ITIMER_REAL, 0.0)
    try:
        with within(30):
            pass
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, left)
