"""How a bridge follows the machines of a cell, one after the other, with fake machines."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from axisbus.errors import StateError
from axisbus.gateway import machine_follower
from axisbus.gateway.machine_follower import MachineFollower

JOINED, ENDED, WAITS = (
    "joined the running machine",
    "the machine has ended",
    "waits for a machine: axisbus run",
)


class Runs:
    """A machine that ends after so many looks, or breaks with them."""

    def __init__(self, looks, error=None, leaving=None):
        self.looks, self.error = looks, error
        self.session = SimpleNamespace(ended=looks == 0, leaving_because=leaving)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self.session.ended = True

    def sleep(self, _):
        self.looks -= 1
        if self.looks == 0 and self.error is not None:
            raise self.error
        self.session.ended = self.looks == 0


@pytest.fixture
def follow(monkeypatch):
    """Follow the machine found at each look; return the messages, and the actions."""

    def followed(*found, may_continue=None):
        left, said, done = list(found), [], []

        def join(_):
            one = left.pop(0)
            if isinstance(one, Exception):
                raise one
            return one

        @contextmanager
        def serve(machine):
            done.append("served")
            try:
                yield lambda: done.append("looked")
            finally:
                done.append("left too late" if machine.session.ended and machine.error else "left")

        monkeypatch.setattr(machine_follower, "Machine", SimpleNamespace(try_attach=join))
        monkeypatch.setattr(machine_follower, "time", SimpleNamespace(sleep=lambda _: None))
        MachineFollower("cell.toml", said.append).run(serve, 1.0, may_continue or (lambda: bool(left)))
        return said, done

    return followed


def test_successive_machines_are_served_and_each_message_is_printed_once(follow):
    said, done = follow(None, None, Runs(2), None, None, Runs(1), None)
    assert said == [WAITS, JOINED, ENDED, WAITS, JOINED, ENDED, WAITS]
    assert done == ["served", "looked", "looked", "left", "served", "looked", "left"]


def test_a_machine_that_is_leaving_is_not_joined_again(follow):
    leaving = Runs(2, leaving="Ctrl-C")
    said, done = follow(Runs(1), leaving, Runs(0), None, Runs(1), None)
    assert said == [JOINED, ENDED, WAITS, JOINED, ENDED, WAITS]
    assert done == ["served", "looked", "left", "served", "looked", "left"]
    assert leaving.session.ended  # it is closed


def test_a_machine_that_cannot_be_joined_is_reported_once_and_tried_again(follow):
    said, done = follow(StateError("it is full"), StateError("it is full"), Runs(1), None)
    assert said == ["no machine is observed: it is full", JOINED, ENDED, WAITS]
    assert done == ["served", "looked", "left"]


def test_a_session_that_fails_is_left_before_it_is_closed_and_the_next_machine_is_observed(follow):
    said, done = follow(Runs(2, StateError("the core is gone")), Runs(1), None)
    assert said == [JOINED, "no machine is observed: the core is gone", JOINED, ENDED, WAITS]
    assert done == ["served", "looked", "looked", "left", "served", "looked", "left"]


def test_an_interruption_leaves_it(follow):
    with pytest.raises(KeyboardInterrupt):
        follow(Runs(1, KeyboardInterrupt()), None)


def test_the_end_of_the_bridge_leaves_a_running_machine(follow):
    goes = iter([True, True, True, False, False])
    said, done = follow(Runs(10), may_continue=lambda: next(goes))
    assert done == ["served", "looked", "looked", "left"]
    assert said == [JOINED]
