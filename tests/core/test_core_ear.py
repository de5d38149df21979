"""What a core makes of its program's signals: only what lies there for long is heard, and a second one is told."""

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


def test_a_signal_that_its_program_takes_is_not_heard(ends):
    inside, outside = ends
    ear = SignalForwarder(inside, NAMES)
    signalled(outside, signal.SIGINT)
    assert ear.look(10.0) is None
    assert ear.look(10.09) is None
    assert inside.recv(1) == bytes((signal.SIGINT,))
    assert ear.look(10.2) is None


def test_one_that_nobody_takes_is_heard_once_after_a_tenth_of_a_second_and_left_to_its_program(ends):
    inside, outside = ends
    ear = SignalForwarder(inside, NAMES)
    signalled(outside, signal.SIGTERM)
    assert [ear.look(now) for now in (5.0, 5.05, 5.11, 5.2)] == [None, None, ("SIGTERM", 1), None]
    assert inside.recv(8) == bytes((signal.SIGTERM,))


def test_a_second_one_is_told_too_and_a_later_one_begins_anew(ends):
    inside, outside = ends
    ear = SignalForwarder(inside, NAMES)
    signalled(outside, signal.SIGINT)
    assert [ear.look(now) for now in (1.0, 1.11)] == [None, ("Ctrl-C", 1)]
    signalled(outside, signal.SIGINT)
    assert ear.look(1.12) == ("Ctrl-C", 2)
    inside.recv(8)
    assert ear.look(1.14) is None
    signalled(outside, signal.SIGINT)
    assert [ear.look(now) for now in (2.0, 2.05, 2.11)] == [None, None, ("Ctrl-C", 1)]


def test_other_signals_and_a_program_that_is_gone_say_nothing(ends):
    inside, outside = ends
    ear = SignalForwarder(inside, NAMES)
    signalled(outside, signal.SIGCHLD)
    assert [ear.look(now) for now in (1.0, 2.0)] == [None, None]
    inside.recv(8)
    outside.close()
    assert [ear.look(now) for now in (3.0, 4.0)] == [None, None]
