"""The messages to a client of a core when the scan ends: first the end, then the commands that ended with it."""

from __future__ import annotations

import mmap
import threading
from types import SimpleNamespace

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.core.process import publisher
from axisbus.core.process.clients import Clients
from axisbus.core.process.publisher import Publisher
from axisbus.core.process.session import Errors
from axisbus.errors import AxisbusError, ScanError, StateError
from axisbus.ipc import frames
from axisbus.ipc.image import size_of
from axisbus.ipc.messages import CommandEvents, CoreCondition, CycleImages, ErrorMessage, Frames
from axisbus.motion.command_status import Status
from axisbus.motion.states import AxisState
from axisbus.session import CommandEvent


class Session:
    """A scan without axes; ``hear`` reports the progress of a command."""

    dead = left = None
    ended = failed = False

    def listen(self, hear):
        self.hear = hear

    def fail(self, *ends):
        """End, as a scan does: the commands are ended once it is known to be over."""
        self.dead, self.ended, self.failed = "the link is down", True, True
        for end in ends:
            self.hear(end)


def end(number):
    return CommandEvent(number, Status.ERROR, ScanError("x.move was ended"), "")


@pytest.fixture
def scene():
    session, sent = Session(), []
    clients = Clients(SimpleNamespace(session=session), Publisher(mmap.mmap(-1, size_of(0)), ()), None)
    clients.admit(SimpleNamespace(send=sent.append), "a program")
    return SimpleNamespace(session=session, clients=clients, sent=sent)


@pytest.mark.parametrize("elsewhere", [False, True], ids=["in the thread of the scan", "in another thread"])
def test_a_client_knows_that_the_scan_is_over_before_its_commands_end(scene, elsewhere):
    if not elsewhere:
        scene.clients.publisher.after_cycle(0.0, {})
    scene.session.fail(end(1), end(2))
    assert scene.sent == []
    scene.clients.send_condition()
    condition, told = scene.sent
    assert condition == CoreCondition("the link is down", True, True)
    assert isinstance(told, CommandEvents)
    assert [event.number for event in told.events] == [1, 2]


def test_a_command_that_ends_after_the_scan_is_reported_too(scene):
    scene.session.fail()
    scene.clients.send_condition()
    scene.session.hear(end(3))
    scene.clients.send_condition()
    assert [type(message) for message in scene.sent] == [CoreCondition, CommandEvents]


def test_each_end_of_a_command_is_reported_once_by_any_number_of_threads(scene):
    scene.session.fail(*map(end, range(200)))
    tellers = [threading.Thread(target=scene.clients.send_condition) for _ in range(8)]
    for teller in tellers:
        teller.start()
    for teller in tellers:
        teller.join()
    told = [
        event.number
        for message in scene.sent
        if isinstance(message, CommandEvents)
        for event in message.events
    ]
    assert sorted(told) == list(range(200))
    assert isinstance(scene.sent[0], CoreCondition)


class Deaf:
    """A connection whose far end reads nothing: all that is sent waits."""

    def __init__(self):
        self.sent = []

    @property
    def waiting(self):
        return len(self.sent)

    def send(self, message):
        self.sent.append(message)


def test_images_that_a_program_does_not_take_are_counted_and_reported_to_it_once(monkeypatch):
    monkeypatch.setattr(publisher, "_MAX_WAITING", 3)
    monkeypatch.setattr(frames, "_MOST", 5)
    place = Publisher(mmap.mmap(-1, size_of(0)), ())
    clients = Clients(SimpleNamespace(session=Session()), place, None)
    slow, quick = Deaf(), Deaf()
    for stream, who in ((slow, "slow"), (quick, "quick")):
        clients.admit(stream, who).outbox.observed = True
    reader = place._outboxes[0]
    for cycle in range(100):
        place.after_cycle(cycle * 0.06, {})
        reader.frames.put(CanFrame(0.0, 0x181))
        reader.flush_frames()
        quick.sent.clear()
    told = [message for message in slow.sent if isinstance(message, CycleImages)]
    kept = sum(len(message.images) for message in told)
    programs = clients.programs
    assert [(each.who, each.lost_cycles > 0, each.lost_frames > 0) for each in programs] == [
        ("slow", True, True),
        ("quick", False, False),
    ]
    assert not any(message.lost for message in told)
    slow.sent.clear()  # it continues reading
    for cycle in range(100, 104):
        place.after_cycle(cycle * 0.06, {})
        reader.flush_frames()
    after = [message for message in slow.sent if isinstance(message, CycleImages)]
    assert sum(message.lost for message in after) == programs[0].lost_cycles
    waiting = len(reader._images)
    assert kept + programs[0].lost_cycles + sum(len(each.images) for each in after) + waiting == 104
    assert sum(each.lost for each in slow.sent if isinstance(each, Frames)) == programs[0].lost_frames
    assert clients.programs[0].lost_cycles == programs[0].lost_cycles


@pytest.mark.parametrize(
    ("ends", "why"),
    [
        ({"x": None, "y": None}, ""),
        ({"x": None, "y": AxisbusError("y went into fault")}, "y: y went into fault"),
    ],
)
def test_control_is_not_taken_if_the_halt_of_an_axis_ends_with_an_error(scene, ends, why):
    session, clients = scene.session, scene.clients
    times = SimpleNamespace(stop_times=SimpleNamespace(stop_sequence=0.1))
    session.axes = {name: SimpleNamespace(parameters=times) for name in ends}
    session.snapshots = {name: SimpleNamespace(state=AxisState.CONTINUOUS_MOTION) for name in ends}
    clients.core.scan = SimpleNamespace(hold_to_run=lambda *_: None)

    def submit(number, target, command, name):
        error = ends[target]
        session.hear(CommandEvent(number, Status.ERROR if error else Status.DONE, error, ""))
        return number

    session.submit = submit
    opener, other = clients._handlers[0], clients.admit(SimpleNamespace(send=scene.sent.append), "another")
    clients.open_for(opener, shared=False)
    if not why:
        clients.give_control(other, take=True)
        assert clients.commanded_by == other.name
        return
    with pytest.raises(StateError) as refused:
        clients.give_control(other, take=True)
    assert refused.value.observed == why
    assert clients.commanded_by == opener.name


def test_a_client_keeps_the_newest_errors_of_each_axis_and_no_more():
    errors, rare = Errors(), AxisbusError("rare")
    errors.take(ErrorMessage("x", 1, rare))
    for number in range(2, 2000):
        errors.take(ErrorMessage("y", number, AxisbusError(str(number))))
    assert errors.of(1) is rare
    assert str(errors.of(1999)) == "1999"
    assert str(errors.of(1950)) == "1950"
    assert len(errors._found) < 100
