"""Received frames and their times, by a test clock: node events, external SYNC, confirmations, TIME, and the work of a cycle."""

from __future__ import annotations

import math
from datetime import datetime, timedelta, timezone
from types import SimpleNamespace

import pytest

from axisbus.bus.cycle import CanCycle
from axisbus.bus.link import frame_files
from axisbus.bus.link.bitrate_change import ChangedOver, Opening, _commands
from axisbus.bus.node import nmt_commands
from axisbus.bus.node.events import BAD, NodeEventKind, NodeEvents
from axisbus.bus.node.nmt import Confirmation
from axisbus.bus.node.nmt_commands import NmtConfirmation
from axisbus.bus.sync_and_time import SyncConsumer, TimeConsumer, TimeProducer
from axisbus.cia301.dropped_frames import Drops
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sync import SyncTimes
from axisbus.clock import SystemClock
from axisbus.core.lateness import Lateness
from axisbus.core.scan import Scan
from axisbus.errors import BusOff, SdoTimeout, SyncError
from kit.manual_clock import HandClock

OPERATIONAL, STOPPED, UNKNOWN = NmtState.OPERATIONAL, NmtState.STOPPED, NmtState.UNKNOWN
UTC = timezone.utc  # noqa: UP017 - one name for the compared value


# Events of a node.


class Monitor(SimpleNamespace):
    """The known state of a node."""

    def overdue(self, now: float) -> bool:
        return now > self.deadline


def monitor(**changes) -> Monitor:
    base = {
        "node_id": 5,
        "state": OPERATIONAL,
        "stamp": 1.0,
        "bootups": 0,
        "bootup_stamp": None,
        "deadline": math.inf,
        "guarded": False,
        "duplicate": "",
    }
    return Monitor(**(base | changes))


def events_of(made: NodeEvents) -> list[tuple]:
    return [(event.kind, event.stamp, event.silent, event.reaction) for event in made.history]


def test_each_change_is_one_event_with_its_times():
    node = monitor()
    told = []
    events = NodeEvents(node)
    events.subscribe(told.append)
    events.look(2.0)
    assert events_of(events) == []
    node.state, node.stamp = STOPPED, 2.5
    for now in (3.0, 3.5):
        events.look(now)
    node.state, node.stamp = OPERATIONAL, 4.0
    events.look(4.25)
    node.bootups, node.bootup_stamp, node.state, node.stamp = 1, 5.0, NmtState.PRE_OPERATIONAL, 5.125
    events.look(5.5)
    events.look(5.75)
    node.state, node.stamp = OPERATIONAL, 6.0
    events.look(6.0)
    node.state = UNKNOWN
    events.look(8.0)
    assert events_of(events) == [
        (NodeEventKind.STATE, 3.0, 0.5, 0.5),
        (NodeEventKind.OPERATIONAL, 4.25, 0.25, 0.25),
        (NodeEventKind.BOOT_UP, 5.5, 0.375, 0.5),
        (NodeEventKind.OPERATIONAL, 6.0, 0.0, 0.0),
        (NodeEventKind.UNKNOWN, 8.0, 2.0, 0.0),
    ]
    assert list(events.history) == told
    assert (
        str(told[0])
        == "node 5 is in an NMT state other than operational (stopped, last frame 500 ms ago; detected within 500.0 ms)"
    )


def test_a_missing_heartbeat_and_its_return_are_an_event_each():
    node = monitor(deadline=2.0)
    events = NodeEvents(node)
    for now in (2.0, 2.25, 2.5):
        events.look(now)
    node.stamp, node.deadline = 3.0, 4.0
    events.look(3.125)
    assert events_of(events) == [
        (NodeEventKind.LOST, 2.25, 1.25, 0.25),
        (NodeEventKind.BACK, 3.125, 0.125, 0.125),
    ]


def test_a_guarded_node_that_is_lost_is_one_that_does_not_answer():
    node = monitor(deadline=2.0, guarded=True)
    events = NodeEvents(node)
    events.look(2.25)
    assert events_of(events) == [(NodeEventKind.UNANSWERED, 2.25, 1.25, 0.25)]
    assert str(events.history[0]).startswith("node 5 is lost: it does not answer node guarding (")
    assert NodeEventKind.UNANSWERED in BAD


def test_a_node_that_never_reported_has_no_silence():
    node = monitor(state=UNKNOWN, stamp=None)
    events = NodeEvents(node)
    node.state = OPERATIONAL
    events.look(7.0)
    node.bootups = 2
    events.look(8.0)
    assert events_of(events) == [
        (NodeEventKind.OPERATIONAL, 7.0, 0.0, 0.0),
        (NodeEventKind.BOOT_UP, 8.0, 0.0, 0.0),
    ]
    watched = monitor(state=UNKNOWN, stamp=None, deadline=2.0)
    events = NodeEvents(watched)
    events.look(3.0)
    watched.deadline = math.inf  # it is not monitored any more
    events.look(4.0)
    assert events_of(events) == [(NodeEventKind.LOST, 3.0, 0.0, 1.0), (NodeEventKind.BACK, 4.0, 0.0, 0.0)]


def test_an_event_during_the_scan_has_no_time_in_the_future():
    node = monitor()
    events = NodeEvents(node)
    node.state, node.stamp = STOPPED, 2.5
    events.look(2.25)
    assert events_of(events) == [(NodeEventKind.STATE, 2.25, 0.0, 0.0)]


def test_a_kind_of_event_is_reported_again_after_a_second_and_until_then_its_newest_is_held():
    node = monitor(state=STOPPED)
    events = NodeEvents(node)
    told = []
    for number, now in enumerate((2.0, 2.5, 2.75, 3.0, 4.0, 5.5)):
        node.bootups = number + 1
        events.look(now)
        told.append([(event.stamp, event.times) for event in events.history])
    assert told == [
        [(2.0, 1)],
        [(2.0, 1)],
        [(2.0, 1)],
        [(2.0, 1), (3.0, 3)],
        [(2.0, 1), (3.0, 3), (4.0, 1)],
        [(2.0, 1), (3.0, 3), (4.0, 1), (5.5, 1)],
    ]


def test_a_held_event_is_reported_when_it_is_due_even_if_nothing_else_happens():
    node = monitor(state=STOPPED)
    events = NodeEvents(node)
    for number, now in enumerate((2.0, 2.5)):
        node.bootups = number + 1
        events.look(now)
    events.look(2.875)
    assert [event.stamp for event in events.history] == [2.0]
    assert [event.stamp for event in events.events] == [2.0, 2.5]
    events.look(3.0)
    assert [event.stamp for event in events.history] == [2.0, 2.5]


def test_simultaneous_events_are_reported_in_order_however_often_they_were_before():
    node = monitor()
    events = NodeEvents(node)
    node.bootups = 1
    events.look(2.0)
    node.bootups, node.deadline = 2, 2.5
    events.look(3.0)
    assert [event.kind for event in events.history][1:] == [NodeEventKind.BOOT_UP, NodeEventKind.LOST]


def test_each_event_reaches_every_subscriber():
    node = monitor()
    events = NodeEvents(node)
    first, second = [], []
    events.subscribe(first.append)
    events.subscribe(second.append)
    node.bootups = 1
    events.look(2.0)
    assert first == second == list(events.history)


def test_events_that_are_bad_and_the_number_that_is_kept():
    assert {kind.name for kind in BAD} == {
        *("LOST", "UNANSWERED", "BOOT_UP", "STATE", "UNKNOWN", "DUPLICATE", "MASTER")
    }
    node = monitor()
    events = NodeEvents(node)
    for number in range(300):
        node.bootups = number + 1
        events.look(float(number))
    assert len(events.history) == 256
    assert events.history[0].stamp == 44.0


# SYNC of another device.


class WireClock(SystemClock):
    """The clock of a ``Wire``."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def now(self) -> float:
        return self._wire.now

    def sleep(self, seconds: float) -> None:
        self._wire.now += seconds

    def condition(self) -> Changed:
        return Changed(self._wire)


class Wire:
    """A channel without a bus, with a clock that continues during a wait; ``coming`` are the stamps of SYNC."""

    behind = None

    def __init__(self, *coming: float) -> None:
        self.now, self.coming, self.receiver = 0.0, list(coming), None
        self.sent: list[tuple[float, int, bytes | int]] = []
        self.late: dict[int, float] = {}
        self.waits = 0
        self.fails = False
        self.clock = WireClock(self)
        self.drops = Drops()
        self.syncs = SyncTimes()

    def subscribe(self, can_id: int, receiver) -> None:
        self.receiver = receiver

    def unsubscribe(self, can_id: int, receiver) -> None:
        assert receiver == self.receiver
        self.receiver = None

    def drain(self) -> None:
        pass

    def check(self) -> None:
        if self.fails:
            raise BusOff("off")

    def send_all(self, frames) -> int:
        """As an adapter that takes one at a time."""
        self.check()
        return 0

    def send(self, can_id: int, data: bytes = b"", patience: float = 0.0) -> None:
        self.check()
        self.sent.append((self.now, can_id, data))

    def send_remote(self, can_id: int, length: int = 0) -> None:
        self.check()
        self.sent.append((self.now, can_id, length))

    def deliver(self) -> None:
        while self.coming and self.coming[0] <= self.now and self.receiver is not None:
            self.receiver(b"", self.coming.pop(0))


class Changed:
    """A condition whose wait lets the wire's clock continue."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def notify(self) -> None: ...

    def wait(self, seconds: float) -> None:
        wire = self.wire
        wire.waits += 1
        until = wire.now + seconds
        if wire.coming and wire.coming[0] <= until:
            until = wire.coming[0]
        wire.now = max(wire.now, until) + wire.late.pop(wire.waits, 0.0)
        wire.deliver()


def consumer(wire: Wire, period: float = 0.125, patience: float | None = 0.5) -> SyncConsumer:
    return SyncConsumer(wire, 0x80, period, patience)


def test_each_sync_begins_one_cycle_with_its_own_time():
    wire = Wire(*(0.125 * number for number in range(1, 9)))
    made = consumer(wire)
    assert [made.wait() for _ in range(8)] == [0.125 * number for number in range(1, 9)]
    assert made.skipped == 0
    made.close()
    assert wire.receiver is None


def test_the_newest_of_several_begins_the_cycle():
    wire = Wire(*(0.125 * number for number in range(1, 9)))
    made = consumer(wire)
    made.wait()
    wire.now = 0.5
    wire.deliver()
    assert made.wait() == 0.5
    assert made.skipped == 2


def test_a_sync_that_stays_away_is_reported_after_its_patience():
    wire = Wire(0.125, 0.25)
    made = consumer(wire)
    made.wait()
    made.wait()
    with pytest.raises(SyncError, match="SYNC of the other producer is missing") as caught:
        made.wait()
    assert wire.now == pytest.approx(0.75)
    assert "expected within 500 ms" in caught.value.observed
    assert caught.value.remedy.startswith("check the device that sends SYNC")


@pytest.mark.parametrize(("asleep", "said"), [(1.5, "1.5 s"), (5.0, "1.9 s")])
def test_if_this_program_did_not_run_that_is_reported_before_the_producer_is_blamed(asleep, said):
    wire = Wire(10.0, 10.125)
    made = consumer(wire)
    wire.now = 9.9
    made.wait()
    made.wait()
    wire.late[wire.waits + 1] = asleep  # in the wait for the third one
    with pytest.raises(SyncError) as caught:
        made.wait()
    assert (
        caught.value.message
        == f"this program did not run for {said} of the last 2 s, and SYNC was not received"
    )
    assert caught.value.remedy.startswith("give this program enough processor time")
    assert "if it is still missing: check the device that sends SYNC" in caught.value.remedy


def test_that_this_program_did_not_run_long_ago_is_no_reason_for_a_missing_sync():
    wire = Wire(10.0, 10.125, 13.0)
    made = consumer(wire, patience=4.0)
    wire.now = 9.9
    made.wait()
    made.wait()
    wire.late[wire.waits + 1] = 1.0
    assert made.wait() == 13.0
    with pytest.raises(SyncError, match="SYNC of the other producer is missing"):
        made.wait()


def test_if_we_are_late_ourselves_a_sync_received_meanwhile_counts():
    wire = Wire(0.125, 0.25, 2.0)
    made = consumer(wire)
    made.wait()
    made.wait()
    wire.late[wire.waits + 1] = 1.75  # asleep until the third one is there, and not read yet
    deliver, wire.deliver = wire.deliver, lambda: None
    made._wait(0.0)
    wire.deliver = deliver
    assert made.wait() == 2.0


@pytest.mark.parametrize(
    ("now", "comes", "begins"),
    [
        (2.0, 2.03, True),
        (2.0, 2.04, False),  # half a period later is too late
        (0.625 + 0.03125, 0.68, True),  # just half a period late ourselves
        (0.625 + 0.03, 0.68, False),
    ],
)
def test_if_we_are_late_ourselves_sync_may_be_half_a_period_late(now, comes, begins):
    wire = Wire(0.0625, 0.125, comes)
    made = consumer(wire, 0.0625, 0.5)
    made.wait()
    made.wait()
    wire.now = now
    if begins:
        assert made.wait() == comes
        return
    with pytest.raises(SyncError) as caught:
        made.wait()
    assert caught.value.observed.startswith(f"none on 080h for {(wire.now - 0.125) * 1000:.1f} ms, ")


def test_a_failed_channel_is_reported_before_a_missing_sync():
    wire = Wire()
    made = consumer(wire)
    wire.fails = True
    with pytest.raises(BusOff):
        made.wait()
    with pytest.raises(BusOff):
        made.await_steady(0.5)


def test_a_steady_sync_is_measured_and_one_of_another_period_refused():
    wire = Wire(*(0.125 * number for number in range(1, 40)))
    assert consumer(wire).await_steady(5.0) == pytest.approx(0.125)
    other = Wire(*(0.25 * number for number in range(1, 40)))
    with pytest.raises(SyncError, match="SYNC comes every 250 ms, but scan_period is 125 ms") as caught:
        consumer(other).await_steady(4.0)
    assert 'scan_period = "250ms"' in caught.value.remedy
    assert "125000" in caught.value.remedy
    none = Wire()
    with pytest.raises(SyncError, match="no steady SYNC on 080h") as caught:
        consumer(none).await_steady(0.5)
    assert caught.value.observed == "none within 0.5 s"
    assert 0.5 <= none.now < 0.65
    one = Wire(0.25)
    with pytest.raises(SyncError) as caught:
        consumer(one).await_steady(0.5)
    assert caught.value.observed == "1 SYNC within 0.5 s"


# The actions of a cycle.


def due(wire: Wire, times: list[float], **options) -> list[tuple[float, int, bytes | int]]:
    cycle = CanCycle(wire, [], **options)
    for now in times:
        wire.now = now
        cycle.heartbeat()
    return wire.sent


def test_our_heartbeat_is_sent_in_its_period_and_a_late_one_moves_no_other():
    times = [10.0, 10.25, 10.5, 11.125, 11.25, 11.5, 15.0, 15.25, 15.5]
    sent = due(Wire(), times, master_id=127, heartbeat=0.5)
    assert [at for at, _, _ in sent] == [10.0, 10.5, 11.125, 11.5, 15.0, 15.5]
    assert {(can_id, data) for _, can_id, data in sent} == {(0x77F, b"\5")}
    for options in (
        {"master_id": None, "heartbeat": 0.5},
        {"master_id": 127, "heartbeat": 0.0},
        {"heartbeat": 0.5},
    ):
        assert due(Wire(), times, **options) == []


class GuardedNode:
    """A node that is asked for its state."""

    def __init__(self, wire: Wire, node_id: int) -> None:
        self.wire, self.can_id = wire, 0x700 + node_id

    def ask(self, _: float) -> None:
        self.wire.send_remote(self.can_id)


def test_each_node_without_heartbeat_is_guarded_in_its_period():
    wire = Wire()
    sent = due(
        wire, [10.0, 10.25, 10.5, 10.75, 11.0], guarded={GuardedNode(wire, 5): 0.5, GuardedNode(wire, 6): 1.0}
    )
    assert [(at, can_id) for at, can_id, _ in sent] == [
        (10.0, 0x705),
        (10.0, 0x706),
        (10.5, 0x705),
        (11.0, 0x705),
        (11.0, 0x706),
    ]


def test_a_node_that_joins_is_guarded_and_checked_too():
    wire = Wire()
    cycle = CanCycle(wire, [])
    looked = []
    cycle.add([], GuardedNode(wire, 7), SimpleNamespace(look=looked.append), 0.5)
    cycle.add([], GuardedNode(wire, 8), SimpleNamespace(look=looked.append))
    wire.now = 3.0
    cycle.heartbeat()
    cycle.commit()
    assert [can_id for _, can_id, _ in wire.sent] == [0x707]
    assert looked == [3.0, 3.0]


@pytest.mark.parametrize(
    ("counter", "data"),
    [(0, [b""] * 4), (3, [b"\1", b"\2", b"\3", b"\1"]), (2, [b"\1", b"\2", b"\1", b"\2"])],
)
def test_sync_counts_from_1_to_its_overflow(counter, data):
    wire = Wire()
    cycle = CanCycle(wire, [], sync_counter=counter)
    for _ in data:
        cycle.sync()
    assert [sent for _, _, sent in wire.sent] == data
    assert cycle._sync_frame(True) == ((0x80, {0: b"", 3: b"\2", 2: b"\1"}[counter]),)
    assert cycle._sync_frame(False) == ()
    silent = CanCycle(Wire(), [], sync_cob_id=None)
    silent.sync()
    assert silent._sync_frame(True) == ()


def lateness_of(cycle: CanCycle, due: float) -> Lateness:
    """Run one cycle of a scan that is due then; return its counts."""
    scan = Scan(cycle, {}, {}, 0.01)
    scan._next = due
    scan.once()
    return scan.lateness


def test_simulated_drives_are_checked_before_they_get_more_frames():
    """Whether they are behind is judged by the frames of the previous cycle, not by its own SYNC, which is too recent."""
    wire = Wire()
    wire.drain = lambda: None
    cycle = CanCycle(wire, [])
    cycle.wait_until(0.0)
    assert not cycle.receive()
    wire.behind = lambda: not wire.sent
    cycle.wait_until(0.0)
    cycle.sync()
    assert cycle.receive()
    cycle.wait_until(0.0)
    assert not cycle.receive()


def test_a_bus_off_ends_no_cycle():
    wire = Wire()
    cycle = CanCycle(
        wire,
        [],
        master_id=127,
        heartbeat=0.5,
        guarded={GuardedNode(wire, 5): 0.5},
    )
    wire.fails = True
    cycle.sync()
    cycle.heartbeat()
    cycle.commit()
    wire.now = 5.0
    assert cycle.wait_until(1.0) is None
    assert lateness_of(cycle, due=1.0).worst == 4.0


class Port:
    """A port with frames; ``stops`` are those of its quick stop."""

    asks = True

    def __init__(self, node_id: int, frames=(), stops=((), ()), error: Exception | None = None) -> None:
        self.node = SimpleNamespace(node_id=node_id)
        self.frames, self.stops, self.error = list(frames), stops, error
        self.dropped = self.closed = 0
        self.on_frame = None

    def take_frames(self):
        return self.frames

    def take_requests(self, now: float):
        return [(0x200 + self.node.node_id, 3)] if now == 9.0 else []

    def drop_frames(self) -> None:
        self.dropped += 1

    def close(self) -> None:
        self.closed += 1

    def stop_frames(self):
        if self.error is not None:
            raise self.error
        return self.stops


def test_the_frames_and_sdo_requests_of_all_ports_are_sent():
    wire = Wire()
    ports = [Port(5, [(0x205, b"a"), (0x305, b"b")]), Port(6, [(0x206, b"c")])]
    cycle = CanCycle(wire, ports)
    wire.now = 9.0
    cycle.commit()
    assert [(can_id, data) for _, can_id, data in wire.sent] == [
        (0x205, b"a"),
        (0x305, b"b"),
        (0x206, b"c"),
        (0x205, 3),
        (0x206, 3),
    ]
    wire.fails = True
    cycle.commit()
    assert [port.dropped for port in ports] == [1, 1]
    cycle.close()
    assert [port.closed for port in ports] == [1, 1]


def test_no_frame_is_sent_after_a_quick_stop_during_the_commit():
    """A frame that was stuck must not be followed by one that would enable the drive again."""
    for stop_at in (0x205, 0x305):
        wire = Wire()
        ports = [Port(5, [(0x205, b"a"), (0x305, b"b")]), Port(6, [(0x206, b"c")])]
        ports.append(Port(7))
        cycle = CanCycle(wire, ports)
        send = wire.send

        def stuck(can_id: int, data: bytes, send=send, stop_at=stop_at, cycle=cycle) -> None:
            send(can_id, data)
            if can_id == stop_at:
                cycle.quick_stop_all()

        wire.send = stuck
        wire.now = 9.0
        cycle.commit()
        frames = [can_id for _, can_id, data in wire.sent if isinstance(data, bytes)]
        assert frames == ([0x205] if stop_at == 0x205 else [0x205, 0x305])
        assert not {0x206, 0x207} & {can_id for _, can_id, _ in wire.sent}  # nor is any request sent


@pytest.mark.parametrize(("taken", "well"), [(4, True), (3, False)])
def test_a_quick_stop_is_every_port_s_frames_with_one_sync_between(taken, well):
    wire = Wire()
    sent = []

    def urgent(frames) -> int:
        sent.extend(frames)
        return min(taken, len(sent))

    wire.send_urgent, wire.counters = urgent, SimpleNamespace(errors=[])
    ports = [Port(5, stops=(((0x205, b"q"),), ((0x605, b"s"),))), Port(6, stops=((), ((0x606, b"t"),)))]
    cycle = CanCycle(wire, ports)
    assert cycle.quick_stop_all() is well
    assert sent == [(0x205, b"q"), (0x80, b""), (0x605, b"s"), (0x606, b"t")]


def test_a_port_that_fails_keeps_no_other_from_being_stopped():
    wire = Wire()
    sent = []
    wire.send_urgent, wire.counters = (
        lambda frames: sent.extend(frames) or len(frames),
        SimpleNamespace(errors=[]),
    )
    ports = [Port(5, error=RuntimeError("no")), Port(6, stops=((), ((0x606, b"t"),)))]
    assert not CanCycle(wire, ports).quick_stop_all()
    assert sent == [(0x606, b"t")]
    assert wire.counters.errors == ["stop frames of node 5: no"]
    assert CanCycle(wire, []).quick_stop_all()
    assert not CanCycle(wire, ports[:1]).quick_stop_all()


# TIME.


def test_time_is_sent_in_its_period_and_received_with_the_elapsed_time():
    wire = Wire()
    noon = datetime(2024, 3, 25, 12, 0, tzinfo=UTC)
    producer = TimeProducer(wire, 1.0, wall_clock=lambda: noon)
    for now in (0.0, 0.5, 1.0, 1.75, 2.25, 3.0, 9.0, 9.5, 10.0):
        wire.now = now
        producer.step(now)
    assert [at for at, _, _ in wire.sent] == [0.0, 1.0, 2.25, 3.0, 9.0, 10.0]
    assert {can_id for _, can_id, _ in wire.sent} == {0x100}
    heard = TimeConsumer(wire)
    assert (heard.latest, heard.at(5.0)) == (None, None)
    wire.receiver(wire.sent[0][2], 20.0)
    assert heard.latest[1] == 20.0
    assert heard.at(21.5) == noon + timedelta(seconds=1.5)
    wire.receiver(b"\0", 22.0)
    assert (heard.malformed, heard.latest[1]) == (1, 20.0)
    heard.close()
    assert wire.receiver is None


# How a node shows its state.


@pytest.fixture
def clock() -> HandClock:
    return HandClock()


class Named:
    """A node as ``nmt_by_hand`` sees it; ``numbers`` are its objects, ``answers`` whether it answers guarding."""

    def __init__(
        self,
        clock: HandClock,
        node_id: int = 5,
        numbers: dict[int, int] | None = None,
        answers: NmtState | None = None,
    ) -> None:
        self.node_id, self.clock, self.numbers, self.answers = node_id, clock, numbers or {}, answers
        self.nmt = SimpleNamespace(reports=0, bootups=0, state=UNKNOWN, assumed=False, waited=[])
        self.nmt.wait_report = lambda asked, _: self.nmt.reports > asked
        self.nmt.wait_state = self._wait_state
        self.nmt.assume = lambda state: setattr(self.nmt, "assumed", state)
        self.channel = SimpleNamespace(
            clock=clock, send_remote=self._asked, send=lambda can_id, data: self.sent.append((can_id, data))
        )
        self.sdo = self
        self.sent: list = []
        self.serves_until = math.inf
        self.serves_from = 0.0

    def _asked(self, can_id: int) -> None:
        assert can_id == 0x700 + self.node_id
        if self.answers is not None:
            self.nmt.reports += 1
            self.nmt.state = self.answers

    def _wait_state(self, state: NmtState, timeout: float, after: int) -> bool:
        self.nmt.waited.append((state, timeout, after))
        return self.nmt.state is state

    def upload(self, index: int, timeout: float, tries: int) -> bytes:
        if index not in self.numbers:
            raise SdoTimeout("no answer", node=5, index=index, subindex=0)
        return self.numbers[index].to_bytes(2, "little")

    def answers_sdo(self, _: float) -> bool:
        return self.serves_from <= self.clock.time < self.serves_until


@pytest.mark.parametrize(
    ("numbers", "answers", "way"),
    [
        ({0x1017: 500}, None, NmtConfirmation(Confirmation.HEARTBEAT, None, 0.5)),
        ({0x1017: 0}, STOPPED, NmtConfirmation(Confirmation.GUARDING, STOPPED)),
        ({}, OPERATIONAL, NmtConfirmation(Confirmation.GUARDING, OPERATIONAL)),
        (
            {0x100C: 100, 0x100D: 3},
            OPERATIONAL,
            NmtConfirmation(Confirmation.SDO, None),
        ),  # a request would arm its life guarding
        ({0x100C: 100, 0x100D: 0}, OPERATIONAL, NmtConfirmation(Confirmation.GUARDING, OPERATIONAL)),
        ({}, None, NmtConfirmation(Confirmation.SDO, None)),
    ],
)
def test_how_a_silent_node_can_show_its_state(clock, numbers, answers, way):
    assert nmt_commands.confirmations([Named(clock, 5, numbers, answers)]) == {5: way}
    assert clock.time == pytest.approx(1.2, abs=0.03)


def test_a_node_whose_heartbeat_was_already_received_is_not_listened_for(clock):
    node = Named(clock, 6, {0x1017: 200})
    node.nmt.reports, node.nmt.state = 1, OPERATIONAL
    assert nmt_commands.confirmations([node]) == {
        6: NmtConfirmation(Confirmation.HEARTBEAT, OPERATIONAL, 0.2)
    }
    assert clock.time == 0.0
    assert nmt_commands.confirmations([]) == {}


def outcome(node: Named, wanted: NmtCommand, way: NmtConfirmation, everybody: bool = False):
    [found] = nmt_commands.command(node.channel, [node], wanted, {node.node_id: way}, to_all=everybody)
    return found


@pytest.mark.parametrize(("period", "patience"), [(0.0, 2.0), (0.8, 2.0), (1.0, 2.5), (4.0, 10.0)])
def test_a_heartbeat_is_awaited_two_and_a_half_periods_and_two_seconds_at_least(clock, period, patience):
    node = Named(clock)
    node.nmt.reports = 3
    found = outcome(node, NmtCommand.START, NmtConfirmation(Confirmation.HEARTBEAT, None, period))
    assert node.nmt.waited == [(OPERATIONAL, pytest.approx(patience), 3)]
    assert (found.ok, found.state) == (False, None)
    assert node.sent == [(0, b"\1\5")]
    assert found.text.startswith(
        "SILENT: it answered before the command, and nothing came in 0.0 s after it (expected: its heartbeat)"
    )


def test_an_outcome_in_words(clock):
    node = Named(clock, answers=OPERATIONAL)
    found = outcome(node, NmtCommand.START, NmtConfirmation(Confirmation.GUARDING, STOPPED), everybody=True)
    assert (found.ok, found.state, found.seconds) == (True, OPERATIONAL, 0.0)
    assert found.text == "operational (was stopped), confirmed by its answer to node guarding after 0.00 s"
    assert node.sent == [(0, b"\1\0")]
    still = outcome(
        Named(clock, answers=STOPPED), NmtCommand.START, NmtConfirmation(Confirmation.GUARDING, None)
    )
    assert not still.ok
    assert still.text.startswith("NOT confirmed: it still reports stopped 2.0 s after the command")


@pytest.mark.parametrize(
    ("wanted", "from_", "until", "ok", "seconds"),
    [
        (NmtCommand.START, 0.0, math.inf, True, 0.0),
        (NmtCommand.START, 1.0, math.inf, True, 1.0),
        (NmtCommand.START, 3.0, math.inf, False, 2.0),
        (NmtCommand.STOP, 0.0, 1.0, True, 1.0),
        (NmtCommand.STOP, 0.0, math.inf, False, 2.0),
        (NmtCommand.ENTER_PRE_OPERATIONAL, 0.0, math.inf, True, 0.0),
    ],
)
def test_without_other_confirmation_the_sdo_server_confirms(clock, wanted, from_, until, ok, seconds):
    node = Named(clock)
    node.serves_from, node.serves_until = from_, until
    found = outcome(node, wanted, NmtConfirmation(Confirmation.SDO, None))
    assert found.ok is ok
    assert bool(node.nmt.assumed) is ok
    assert found.seconds == pytest.approx(seconds, abs=0.03)


@pytest.mark.parametrize("wanted", [NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
def test_a_reset_is_confirmed_by_a_boot_up_within_five_seconds(clock, wanted):
    node = Named(clock)
    found = outcome(node, wanted, NmtConfirmation(Confirmation.HEARTBEAT, OPERATIONAL, 0.5))
    assert (found.ok, found.confirmation) == (False, NmtConfirmation(Confirmation.BOOT_UP, OPERATIONAL, 0.5))
    assert found.seconds == pytest.approx(5.0, abs=0.03)
    again = Named(clock)

    def restart(_, __) -> None:
        again.nmt.bootups += 1
        again.nmt.reports += 1
        again.nmt.state = NmtState.PRE_OPERATIONAL

    again.channel.send = restart
    assert outcome(again, wanted, NmtConfirmation(Confirmation.SDO, None)).ok


# Change-over of the bit rate, and lines of candump.


@pytest.mark.parametrize(
    ("changes", "complete"),
    [
        ({"asked": False, "answered": (1,)}, False),
        ({}, False),
        ({"answered": (1,)}, True),
        ({"nodes": (5,)}, True),
        ({"others": True}, True),
        ({"answered": (1,), "silent": (2,)}, False),
        ({"others": True, "silent": (2,)}, False),
    ],
)
def test_when_a_change_over_is_complete(changes, complete):
    assert _commands(Opening("pcan", "x"), 250_000) == ()
    assert ChangedOver(500_000, Opening("virtual", "x").own_rate, **changes).complete is complete


@pytest.mark.parametrize(
    ("line", "frame"),
    [
        ("(1436509052.249713) vcan0 123#112233", (1436509052.249713, 0x123, "112233", False, False, False)),
        ("(1.5) can0 00000123#", (1.5, 0x123, "", True, False, False)),
        ("(1.5) can0 123#R", (1.5, 0x123, "", False, True, False)),
        ("(1.5) can0 123#R3", (1.5, 0x123, "", False, True, False)),
        ("(1.5) can0 123#11.22", (1.5, 0x123, "1122", False, False, False)),
        ("(1.5) can0 20000004#0000000000000000", (1.5, 0x4, "0000000000000000", False, False, True)),
        ("(1.5) can0 123#112", None),
        ("(1.5) can0 123#112233445566778899", None),
        ("  can0  123   [3]  11 22 33", (0.0, 0x123, "112233", False, False, False)),
        (" (0.250)  can0  RX - -  123   [2]  11 22", (0.25, 0x123, "1122", False, False, False)),
        (" (1.2.3)  can0  123   [0]", (0.0, 0x123, "", False, False, False)),
        ("  can0  123   [2]  remote request", (0.0, 0x123, "", False, True, False)),
        ("  can0  123   [2]  11", None),
        ("  can0  20000004   [2]  00 01   ERRORFRAME", (0.0, 0x4, "0001", False, False, True)),
        ("nothing", None),
    ],
)
def test_a_line_of_candump(line, frame):
    found = frame_files.parse(line)
    if frame is None:
        assert found is None
        return
    time, identifier, data, extended, remote, error = frame
    assert (found[0], found[1]) == (time, identifier)
    assert tuple(found)[2:6] == (bytes.fromhex(data), extended, remote, error)


def test_a_channel_is_opened_as_it_was_before():
    with Opening("virtual", "opened-again").open() as opened:
        assert opened.name == "virtual:opened-again"
        assert opened.failure is None


def test_if_another_device_sends_sync_the_cycle_begins_with_it():
    wire = Wire()
    cycle = CanCycle(wire, [], sync_consumer=SimpleNamespace(wait=lambda: 7.5))
    wire.now = 7.75
    assert cycle.wait_until(100.0) == 7.5
    counted = lateness_of(cycle, due=100.0)
    assert (counted.cycles, counted.worst) == (1, 0.25)
