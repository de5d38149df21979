"""The reports of a node, with a clock of the test: states, boot-ups, overdue heartbeats, guarding and its toggle bit."""

from __future__ import annotations

import math

import pytest

from axisbus.bus.link import detect_other_master
from axisbus.bus.node import nmt
from axisbus.bus.node.nmt import Confirmation, NodeMonitor
from axisbus.cia301.dropped_frames import Drops
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.errors import AdapterError, BusOff, NodeRefused, NodeTimeout, StateError
from kit.manual_clock import HandClock

HEARTBEAT, NMT = 0x705, 0x000


class Line:
    """A channel without a bus: its subscriptions, and its failures."""

    def __init__(self, clock: HandClock) -> None:
        self.clock = clock
        self.receivers: dict[int, list] = {}
        self.on_failure: list = []
        self.name = "line"
        self.in_receive_thread = False
        self.drops = Drops()
        self.asked: list[int] = []

    def subscribe(self, can_id: int, receiver) -> None:
        self.receivers.setdefault(can_id, []).append(receiver)

    def unsubscribe(self, can_id: int, receiver) -> None:
        self.receivers[can_id].remove(receiver)

    def brings(self, can_id: int, data: str, stamp: float = 0.0) -> None:
        for receiver in self.receivers.get(can_id, []):
            receiver(bytes.fromhex(data), stamp)

    def check(self) -> None:
        """Nothing has failed."""

    def send_remote(self, can_id: int) -> None:
        self.asked.append(can_id)

    def fails(self, error: Exception) -> None:
        for told in self.on_failure:
            told(error)


@pytest.fixture
def clock() -> HandClock:
    return HandClock(100.0, passing=True)


@pytest.fixture
def line(clock: HandClock) -> Line:
    return Line(clock)


@pytest.fixture
def node(line: Line) -> NodeMonitor:
    return NodeMonitor(line, 5)


@pytest.mark.parametrize(
    ("byte", "state"),
    [
        ("04", NmtState.STOPPED),
        ("05", NmtState.OPERATIONAL),
        ("7F", NmtState.PRE_OPERATIONAL),
        ("85", NmtState.OPERATIONAL),
        ("00", NmtState.PRE_OPERATIONAL),  # a node enters it automatically after its boot-up
    ],
)
def test_a_report_is_kept_with_its_time(node: NodeMonitor, line: Line, byte: str, state: NmtState) -> None:
    assert (node.state, node.stamp, node.reports, node.has_heartbeat) == (NmtState.UNKNOWN, None, 0, False)
    line.brings(HEARTBEAT, byte, 7.0)
    assert (node.state, node.stamp, node.reports, node.assumed) == (state, 7.0, 1, False)
    assert node.has_heartbeat is (byte != "00")
    assert (node.bootups, node.bootup_stamp) == ((1, 7.0) if byte == "00" else (0, None))
    line.brings(HEARTBEAT, "", 8.0)
    line.brings(0x706, "04", 8.0)
    assert (node.state, node.stamp, node.reports) == (state, 7.0, 1)


def test_boot_ups_are_counted_and_heartbeats_begin_again(node: NodeMonitor, line: Line) -> None:
    for byte, stamp in (("05", 1.0), ("00", 2.0), ("00", 3.0)):
        line.brings(HEARTBEAT, byte, stamp)
    assert (node.bootups, node.bootup_stamp, node.reports, node.has_heartbeat) == (2, 3.0, 3, False)
    line.brings(HEARTBEAT, "7F", 4.0)
    assert node.has_heartbeat
    node.wait_bootup(0.0, after=1)


def test_a_heartbeat_is_overdue_after_its_time_from_the_last_one_or_from_the_beginning(
    node: NodeMonitor, line: Line, clock: HandClock
) -> None:
    line.brings(HEARTBEAT, "05", 50.0)
    assert (node.watched, node.deadline, node.overdue(1e9), node.operational(1e9)) == (
        None,
        math.inf,
        False,
        True,
    )
    node.watch(0.5)
    assert (node.watched, node.deadline) == (0.5, 100.5)
    assert [node.overdue(now) for now in (100.25, 100.5, 100.75)] == [False, False, True]
    line.brings(HEARTBEAT, "05", 101.0)
    assert node.deadline == 101.5
    assert [node.operational(now) for now in (101.5, 101.75)] == [True, False]
    line.brings(HEARTBEAT, "7F", 102.0)
    assert not node.operational(102.0)
    node.watch(None)
    assert not node.overdue(1e9)


def test_a_node_that_never_reported_is_overdue_from_the_beginning_of_the_watch(node: NodeMonitor) -> None:
    node.watch(0.25)
    assert node.deadline == 100.25


def test_guarding_is_a_watch_and_its_answers_are_no_heartbeats(node: NodeMonitor, line: Line) -> None:
    node.guard(0.5, 0.25)
    assert (node.guarded, node.asking, node.watched) == (True, True, 0.5)
    line.brings(HEARTBEAT, "05", 101.0)
    line.brings(HEARTBEAT, "85", 101.25)
    assert (node.reports, node.has_heartbeat, node.toggle_errors) == (2, False, 0)
    line.brings(HEARTBEAT, "84", 101.5)  # the toggle bit has not changed: that is no answer
    assert (node.reports, node.state, node.stamp, node.toggle_errors) == (2, NmtState.OPERATIONAL, 101.25, 1)
    line.brings(HEARTBEAT, "04", 101.75)
    assert (node.reports, node.state) == (3, NmtState.STOPPED)
    line.brings(HEARTBEAT, "00", 102.0)  # a boot-up restarts the toggle
    line.brings(HEARTBEAT, "7F", 102.25)
    assert (node.reports, node.bootups, node.toggle_errors) == (5, 1, 1)


def test_a_guarded_node_is_overdue_as_soon_as_one_with_a_heartbeat(node: NodeMonitor, line: Line) -> None:
    node.guard(0.375, 0.125)
    line.brings(
        HEARTBEAT, "05", 100.0
    )  # the answer to a command of boot-up, long before the first request of the scan
    assert node.deadline == math.inf
    node.ask(105.0)
    assert (line.asked, node.deadline) == ([HEARTBEAT], 105.25)
    line.brings(HEARTBEAT, "85", 105.0625)
    assert not node.overdue(1e9)
    for now in (105.125, 105.25, 105.375):  # the first request without an answer counts
        node.ask(now)
        assert node.deadline == 105.0625 + 0.375
    assert [node.operational(now) for now in (105.4375, 105.5)] == [True, False]
    line.brings(HEARTBEAT, "05", 106.0)
    assert not node.overdue(1e9)


def test_late_requests_of_our_own_are_no_silence_of_a_guarded_node(node: NodeMonitor, line: Line) -> None:
    node.guard(0.375, 0.125)
    node.ask(100.0)
    line.brings(HEARTBEAT, "05", 100.0)
    node.ask(103.0)
    assert node.deadline == 103.0 - 0.125 + 0.375


def test_a_heartbeat_has_no_toggle_bit(node: NodeMonitor, line: Line) -> None:
    for _ in range(3):
        line.brings(HEARTBEAT, "05", 1.0)
    assert (node.reports, node.toggle_errors) == (3, 0)
    node.guard(1.0, 0.5)
    line.brings(HEARTBEAT, "05", 2.0)  # the first answer, whatever a heartbeat had
    assert node.reports == 4


@pytest.mark.parametrize(
    ("data", "state"),
    [
        ("01 05", NmtState.OPERATIONAL),
        ("02 00", NmtState.STOPPED),
        ("80 05", NmtState.PRE_OPERATIONAL),
        ("81 05", NmtState.INITIALISING),
        ("82 05", NmtState.INITIALISING),
        ("01 06", NmtState.UNKNOWN),
        ("01", NmtState.UNKNOWN),
        ("", NmtState.UNKNOWN),
        ("03 05", NmtState.UNKNOWN),
    ],
)
def test_a_node_without_heartbeat_is_assumed_in_the_state_that_another_master_commands(
    node: NodeMonitor, line: Line, data: str, state: NmtState
) -> None:
    line.brings(NMT, data)
    assert (node.state, node.assumed) == (state, state is not NmtState.UNKNOWN)
    assert node.reports == 0


def test_of_one_with_a_heartbeat_nothing_is_assumed(node: NodeMonitor, line: Line) -> None:
    line.brings(HEARTBEAT, "05", 1.0)
    line.brings(NMT, "02 05")
    assert (node.state, node.assumed) == (NmtState.OPERATIONAL, False)


def test_an_assumed_state_is_not_a_reported_one(node: NodeMonitor, line: Line) -> None:
    node.assume(NmtState.OPERATIONAL)
    assert node.operational(0.0)
    assert not node.wait_state(NmtState.OPERATIONAL, 0.0)
    assert not node.wait_report(0, 0.0)
    line.brings(HEARTBEAT, "05", 1.0)
    assert not node.wait_state(NmtState.OPERATIONAL, 0.0, after=1)
    assert node.wait_state(NmtState.OPERATIONAL, 0.0, after=0)
    assert not node.wait_state(NmtState.STOPPED, 0.0)
    assert node.wait_report(0, 0.0)
    line.brings(HEARTBEAT, "05", 1.0)
    assert not node.assumed


def test_state_and_age_in_words(node: NodeMonitor, line: Line) -> None:
    assert node.describe(5.0) == "it has never reported its NMT state"
    line.brings(HEARTBEAT, "00", 1.0)
    line.brings(HEARTBEAT, "05", 2.0)
    assert node.describe(4.5) == "NMT state operational (last reported 2.50 s ago), 1 boot-up seen"
    node.assume(NmtState.STOPPED)
    assert node.describe(4.5) == "NMT state stopped (assumed), 1 boot-up seen"


def test_at_a_bus_off_nothing_is_known_any_more_and_at_other_failures_it_is(
    node: NodeMonitor, line: Line
) -> None:
    node.guard(1.0, 0.5)
    line.brings(HEARTBEAT, "05", 1.0)
    line.fails(AdapterError("gone"))
    assert node.state is NmtState.OPERATIONAL
    node.assume(NmtState.OPERATIONAL)
    line.fails(BusOff("off"))
    assert (node.state, node.assumed) == (NmtState.UNKNOWN, False)
    line.brings(HEARTBEAT, "05", 2.0)  # the same toggle bit as before: it may have been asked in between
    assert (node.state, node.toggle_errors) == (NmtState.OPERATIONAL, 0)


def test_a_closed_node_monitor_receives_nothing(node: NodeMonitor, line: Line) -> None:
    node.close()
    line.brings(HEARTBEAT, "05", 1.0)
    line.brings(NMT, "01 05", 1.0)
    assert (node.state, node.reports) == (NmtState.UNKNOWN, 0)
    assert line.on_failure == []
    assert not any(line.receivers.values())


@pytest.mark.parametrize(
    ("can_id", "data", "told"),
    [
        (0x080, "", ["SYNC is sent"]),
        (0x705, "05", ["node 5 is operational"]),
        (0x705, "85", ["node 5 is operational"]),
        (0x705, "7F", []),
        (0x705, "", []),
        (0x1FF, "00", ["node 127 sends PDOs"]),
        (0x181, "00", ["node 1 sends PDOs"]),
        (0x200, "00", []),
        (None, "", []),
    ],
)
def test_frames_that_show_a_running_machine(
    line: Line, can_id: int | None, data: str, told: list[str]
) -> None:
    looks: list[int] = []

    def check() -> None:
        looks.append(1)
        if len(looks) == 1 and can_id is not None:
            line.brings(can_id, data)

    line.check = check
    assert detect_other_master.bus_activity(line, 0.05) == told
    assert not any(line.receivers.values())  # no subscription remains


def test_a_sign_of_a_master_ends_the_listening(line: Line, clock: HandClock) -> None:
    line.check = lambda: line.brings(0x80, "")
    assert detect_other_master.bus_activity(line, 5.0) == ["SYNC is sent"]
    assert clock.time == pytest.approx(100.05)


def test_listening_in_the_receive_thread_is_refused(line: Line) -> None:
    line.in_receive_thread = True
    with pytest.raises(StateError, match="listening to the bus"):
        detect_other_master.bus_activity(line, 0.05)
    assert line.receivers == {}


# Commands to a node that is guarded.


def guarded(node: NodeMonitor, line: Line, clock: HandClock, *answers: str) -> list[float]:
    """Let a guarded node give one of these answers to each request ("": none); return when it is asked."""
    left, asked = list(answers), []

    def send_remote(can_id: int) -> None:
        assert can_id == HEARTBEAT
        asked.append(clock.time - 100.0)
        answer = left.pop(0) if left else ""
        if answer:
            line.brings(HEARTBEAT, answer, clock.time)

    line.send, line.send_remote = lambda *_: None, send_remote
    node.guard(1.0, 0.5)
    return asked


def test_a_guarded_node_that_answers_twice_with_another_state_is_not_asked_further(
    node: NodeMonitor, line: Line, clock: HandClock
) -> None:
    asked = guarded(node, line, clock)
    with pytest.raises(NodeTimeout):
        nmt.command(line, node, NmtCommand.START)
    assert asked == pytest.approx([0.0, 0.1])
    assert node.asking


def test_with_each_answer_a_guarded_node_has_two_tries_again(
    node: NodeMonitor, line: Line, clock: HandClock
) -> None:
    asked = guarded(node, line, clock, "", "7F", "", "85")
    assert nmt.command(line, node, NmtCommand.START) is Confirmation.GUARDING
    assert asked == pytest.approx([0.0, 0.1, 0.2, 0.3])


def test_a_guarded_node_that_keeps_its_state_is_polled_until_the_timeout(
    node: NodeMonitor, line: Line, clock: HandClock
) -> None:
    asked = guarded(node, line, clock, *["7F", "FF"] * 9)
    with pytest.raises(NodeRefused, match="it answers, and is pre-operational"):
        nmt.command(line, node, NmtCommand.START, timeout=0.25)
    assert asked == pytest.approx([0.0, 0.1, 0.2])
