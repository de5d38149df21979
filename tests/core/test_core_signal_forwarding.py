"""The reaction of a core to its program's signals: only one that stays pending is used, and a second one is forwarded."""

import signal
import socket

import pytest

from axisbus.core.process.signal_forwarding import SignalForwarder

NAMES = {int(signal.SIGINT): "Ctrl-C", int(signal.SIGTERM): "SIGTERM"}


@pytest.fixture
def ends():
    inside, outside = socket.socketpair()
    with inside, outside:
        yield inside, outside


def signalled(outside, *numbers):
    outside.send(bytes(numbers))


def test_a_signal_that_its_program_handles_is_not_forwarded(ends):
    inside, outside = ends
    ear = SignalForwarder(inside, NAMES)
    signalled(outside, signal.SIGINT)
    assert ear.poll(10.0) is None
    assert ear.poll(10.09) is None
    assert inside.recv(1) == bytes((signal.SIGINT,))
    assert ear.poll(10.2) is None


def test_an_unhandled_signal_is_forwarded_once_after_a_tenth_of_a_second_and_left_to_its_program(ends):
    inside, outside = ends
    ear = SignalForwarder(inside, NAMES)
    signalled(outside, signal.SIGTERM)
    assert [ear.poll(now) for now in (5.0, 5.05, 5.11, 5.2)] == [None, None, ("SIGTERM", 1), None]
    assert inside.recv(8) == bytes((signal.SIGTERM,))


def test_a_second_signal_is_forwarded_too_and_a_later_one_starts_again(ends):
    inside, outside = ends
    ear = SignalForwarder(inside, NAMES)
    signalled(outside, signal.SIGINT)
    assert [ear.poll(now) for now in (1.0, 1.11)] == [None, ("Ctrl-C", 1)]
    signalled(outside, signal.SIGINT)
    assert ear.poll(1.12) == ("Ctrl-C", 2)
    inside.recv(8)
    assert ear.poll(1.14) is None
    signalled(outside, signal.SIGINT)
    assert [ear.poll(now) for now in (2.0, 2.05, 2.11)] == [None, None, ("Ctrl-C", 1)]


def test_other_signals_and_an_ended_program_are_ignored(ends):
    inside, outside = ends
    ear = SignalForwarder(inside, NAMES)
    signalled(outside, signal.SIGCHLD)
    assert [ear.poll(now) for now in (1.0, 2.0)] == [None, None]
    inside.recv(8)
    outside.close()
    assert [ear.poll(now) for now in (3.0, 4.0)] == [None, None]
