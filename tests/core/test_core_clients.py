"""What a client of a core is told when the scan ends: first that it has, then which of its commands ended with it."""

from __future__ import annotations

import mmap
import threading
from types import SimpleNamespace

import pytest

from axisbus.core.process.clients import Clients
from axisbus.core.process.outlet import Outlet
from axisbus.errors import ScanError
from axisbus.motion.ticket import Status
from axisbus.session import CommandEvent
from axisbus.wire.image import size_of
from axisbus.wire.messages import Condition, Told


class Session:
    """A scan of no axes; ``hear`` tells how a command goes on."""

    dead = left = None
    ended = failed = False

    def listen(self, hear):
        self.hear = hear

    def fail(self, *ends):
        """End, as a scan does: the commands are told once it is known to be over."""
        self.dead, self.ended, self.failed = "the link is down", True, True
        for end in ends:
            self.hear(end)


def end(number):
    return CommandEvent(number, Status.ERROR, ScanError("x.move was ended"), "")


@pytest.fixture
def scene():
    session, sent = Session(), []
    clients = Clients(SimpleNamespace(session=session), Outlet(mmap.mmap(-1, size_of(0)), ()), None)
    clients.admit(SimpleNamespace(send=sent.append), "a program")
    return SimpleNamespace(session=session, clients=clients, sent=sent)


@pytest.mark.parametrize("elsewhere", [False, True], ids=["in the thread of the scan", "in another thread"])
def test_a_client_knows_that_the_scan_is_over_before_its_commands_end(scene, elsewhere):
    if not elsewhere:
        scene.clients.outlet.after_cycle(0.0, {})
    scene.session.fail(end(1), end(2))
    assert scene.sent == []
    scene.clients.tell_condition()
    condition, told = scene.sent
    assert condition == Condition("the link is down", True, True)
    assert isinstance(told, Told)
    assert [event.number for event in told.events] == [1, 2]


def test_what_ends_after_the_scan_is_told_as_well(scene):
    scene.session.fail()
    scene.clients.tell_condition()
    scene.session.hear(end(3))
    scene.clients.tell_condition()
    assert [type(message) for message in scene.sent] == [Condition, Told]


def test_each_end_is_told_once_by_however_many_threads(scene):
    scene.session.fail(*map(end, range(200)))
    tellers = [threading.Thread(target=scene.clients.tell_condition) for _ in range(8)]
    for teller in tellers:
        teller.start()
    for teller in tellers:
        teller.join()
    told = [event.number for message in scene.sent if isinstance(message, Told) for event in message.events]
    assert sorted(told) == list(range(200))
    assert isinstance(scene.sent[0], Condition)
