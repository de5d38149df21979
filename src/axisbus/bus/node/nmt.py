"""Network management of one node: what it reports of itself, and commands that are confirmed (CiA 301 7.2.8).

An NMT command has no answer of its own. What confirms it is the next heartbeat; where a node sends none and is guarded, the answer
to a guarding request; where it has neither, that it answers SDO (or, once stopped, no longer does), after which its state is
*assumed*. A node that is not guarded is never asked by a guarding request: the first one would arm its life guarding, and our
silence afterwards would fault it.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from enum import Enum

from axisbus.bus.link.channel import Channel, require_other_thread
from axisbus.cia301 import cob
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.nmt import RESULT, TOGGLE_BIT, NmtCommand, NmtState, is_boot_up
from axisbus.errors import BusOff, NodeRefused, NodeTimeout
from axisbus.wording import counted

CONFIRM_TIMEOUT = 2.0  # longer than the usual heartbeat of 1 s
_TURNS = 3  # reports of two states in turn: no master commands a node so often between two heartbeats
_GUARD_WAIT = 0.1
_CHANCES = 3  # times that a command is sent
_GUARD_TRIES = 2
_CLEARS = "many clear it when they restart: axisbus nmt reset-node"
_ANOTHER_MASTER = "whether another NMT master is on the bus"
_RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)


class Confirmation(Enum):
    """What showed that a node took a command."""

    HEARTBEAT = "its heartbeat"
    BOOT_UP = "its boot-up message"
    GUARDING = "its answer to node guarding"
    SDO = "its SDO server; the state itself is assumed"


class NodeMonitor:
    """What a node said of itself; holds state: last NMT state with its time, latched boot-ups, the watch on its heartbeat.

    Boot-ups are counted, so that none is lost between two looks. Times are seconds of ``time.monotonic()``; ``deadline`` is when
    the next heartbeat or answer is overdue (infinity: none is expected). An answer is expected only while a guarding request is
    unanswered. May be used from any thread; the waiting calls not from the receive thread.
    """

    def __init__(self, channel: Channel, node_id: int) -> None:
        self.node_id = node_id
        self.state = NmtState.UNKNOWN
        self.stamp: float | None = None
        self.assumed = False
        self.reports = 0
        self.bootups = 0
        self.bootup_stamp: float | None = None
        self.asking = False  # while node guarding asks, a report is an answer and no heartbeat
        self.guarded = (
            False  # somebody asks all the time, so a request more arms no life guarding of the node's
        )
        self.toggle_errors = 0
        self.duplicate = ""  # what shows that a second device has this node-ID
        self._turns = (
            0  # reports in a row that say what the one before the last said, and not what the last said
        )
        self._before: NmtState | None = None  # the report before the last
        self._toggle: int | None = None  # of the last answer to guarding
        self._heartbeats = 0
        self._channel = channel
        self._changed = threading.Condition()
        self._watch: float | None = None
        self._watched_since = 0.0
        self._guard_period = 0.0  # seconds between two guarding requests
        self.deadline = math.inf
        channel.subscribe(cob.HEARTBEAT + node_id, self._on_report)
        channel.subscribe(cob.NMT, self._on_command)
        channel.on_failure.append(self._wake)

    # -- what it says -------------------------------------------------------------------------------------------------------------

    def watch(self, timeout: float | None) -> None:
        """Expect a heartbeat every ``timeout`` seconds from now on (None: expect none)."""
        with self._changed:
            self._watched_since = time.monotonic()
            self._watch = timeout
            self._expect()

    def _expect(self) -> None:
        since = max(self.stamp or 0.0, self._watched_since)
        self.deadline = math.inf if self._watch is None or self.guarded else since + self._watch

    @property
    def watched(self) -> float | None:
        """The consumer time in seconds, None where no heartbeat is expected."""
        return self._watch

    @property
    def has_heartbeat(self) -> bool:
        """Whether it has sent a heartbeat since its last boot-up."""
        return self._heartbeats > 0

    def overdue(self, now: float) -> bool:
        """Whether the expected heartbeat is missing at the time ``now``."""
        return now > self.deadline

    def operational(self, now: float) -> bool:
        """Whether its last word was *operational* and its heartbeat is not overdue."""
        return self.state == NmtState.OPERATIONAL and not self.overdue(now)

    def guard(self, timeout: float, period: float) -> None:
        """Expect answers to guarding requests instead of heartbeats, the last one no older than ``timeout`` seconds.

        ``period``: seconds between two requests (``ask``). Before the first request no answer is expected.
        """
        self.guarded = self.asking = True
        self._guard_period = period
        self.watch(timeout)

    def ask(self, now: float) -> None:
        """Send a guarding request (CiA 301 7.2.8.3.2.1), and expect its answer where ``guard`` says so.

        Late requests of our own are no silence of the node: it counts from one period before the first unanswered request.

        Raises:
            AdapterError: as ``Channel.send_remote``.
        """
        self._channel.send_remote(cob.HEARTBEAT + self.node_id)
        with self._changed:
            if self.guarded and self._watch is not None and self.deadline == math.inf:
                self.deadline = max(self.stamp or 0.0, now - self._guard_period) + self._watch

    def describe(self, now: float) -> str:
        """Return state and age in words, for the text of an error."""
        if self.stamp is None:
            return "it has never reported its NMT state"
        kind = "assumed" if self.assumed else f"last reported {now - self.stamp:.2f} s ago"
        return f"NMT state {self.state.text} ({kind}), {counted(self.bootups, 'boot-up')} seen"

    def note_duplicate(self, why: str) -> None:
        """Note what shows that a second device has this node-ID; the first reason stays."""
        self.duplicate = self.duplicate or why

    def assume(self, state: NmtState) -> None:
        """Take ``state`` for the node's, where it cannot say so itself."""
        with self._changed:
            self.state, self.assumed = state, True
            self._changed.notify_all()

    # -- waiting ------------------------------------------------------------------------------------------------------------------

    def wait_state(self, state: NmtState, timeout: float, after: int = -1) -> bool:
        """Wait until the node reports ``state``, in report number ``after`` + 1 or later; return whether it did.

        Raises:
            BusError: the channel failed.
            StateError: called in the receive thread.
        """
        return self._wait(lambda: self.reports > after and self.state == state and not self.assumed, timeout)

    def wait_report(self, after: int, timeout: float) -> bool:
        """Wait until more than ``after`` reports have come; return whether they did (raises as ``wait_state``)."""
        return self._wait(lambda: self.reports > after, timeout)

    def wait_bootup(self, timeout: float, after: int = 0) -> None:
        """Wait until more than ``after`` boot-ups have been seen since this monitor was made.

        Raises:
            NodeTimeout: they have not within ``timeout`` seconds.
            others as ``wait_state``.
        """
        reports = self.reports
        if self._wait(lambda: self.bootups > after, timeout):
            return
        said = "is silent: it sent" if self.reports == reports else "sent"
        raise NodeTimeout(
            f"node {self.node_id} {said} no boot-up message within {timeout:g} s",
            node=self.node_id,
            observed=self.describe(time.monotonic()),
            remedy="check its power, node ID and bitrate; some drives need seconds to restart",
        )

    def close(self) -> None:
        """Stop listening."""
        self._channel.unsubscribe(cob.HEARTBEAT + self.node_id, self._on_report)
        self._channel.unsubscribe(cob.NMT, self._on_command)
        if self._wake in self._channel.on_failure:
            self._channel.on_failure.remove(self._wake)

    def _wait(self, done: Callable[[], bool], timeout: float) -> bool:
        require_other_thread(self._channel, "waiting for a node")
        deadline = time.monotonic() + timeout
        with self._changed:
            while not done():
                self._channel.check()
                left = deadline - time.monotonic()
                if left <= 0:
                    return False
                self._changed.wait(left)
            return True

    # -- receive thread -----------------------------------------------------------------------------------------------------------

    def _on_report(self, data: bytes, stamp: float) -> None:
        if not data:
            self._drop(DropReason.HEARTBEAT, data, stamp)
            return
        value = data[0] & ~TOGGLE_BIT
        with self._changed:
            if self._is_stale(data[0]):
                self._drop(DropReason.TOGGLE, data, stamp)
                return
            if is_boot_up(data):  # boot-up; the node then enters pre-operational by itself
                self.bootups += 1
                self.bootup_stamp = stamp
                self._heartbeats = 0
                value = NmtState.PRE_OPERATIONAL
            elif not self.asking:
                self._heartbeats += 1
            self._look_for_duplicate(NmtState(value))
            self.state, self.stamp, self.assumed = NmtState(value), stamp, False
            self._expect()
            self.reports += 1
            self._changed.notify_all()

    def _look_for_duplicate(self, state: NmtState) -> None:
        """Two devices with one node-ID and different states report them in turn."""
        turns = state is self._before and state is not self.state and not self.asking
        self._turns = self._turns + 1 if turns else 0
        self._before = self.state
        if self._turns >= _TURNS:
            self.note_duplicate(f"its heartbeats say {self.state.text} and {state.text} in turn")

    def _drop(self, fault: DropReason, data: bytes, stamp: float) -> None:
        self._channel.drops.note(fault, self.node_id, stamp, cob.HEARTBEAT + self.node_id, data)

    def _is_stale(self, value: int) -> bool:
        """An answer to guarding whose toggle bit has not changed counts as not received (CiA 301 7.2.8.3.2.1)."""
        if value == NmtState.INITIALISING or not self.asking:
            self._toggle = None
            return False
        toggle = value & TOGGLE_BIT
        if toggle == self._toggle:
            self.toggle_errors += 1
            return True
        self._toggle = toggle
        return False

    def _on_command(self, data: bytes, _: float) -> None:
        """Another master commands this node: where no heartbeat will tell the result, it is assumed."""
        if len(data) < 2 or data[1] not in (0, self.node_id) or self.has_heartbeat:
            return
        if data[0] in NmtCommand.__members__.values():
            self.assume(RESULT[NmtCommand(data[0])])

    def _wake(self, error: object) -> None:
        with self._changed:
            if isinstance(
                error, BusOff
            ):  # what it does meanwhile nobody hears: it counts again when it reports again
                self.state, self.assumed, self._toggle = NmtState.UNKNOWN, False, None
            self._changed.notify_all()


def send(channel: Channel, command: NmtCommand, node_id: int = 0) -> None:
    """Send an NMT command to one node (1 to 127) or to all (0), without a confirmation.

    Raises:
        AdapterError: it cannot be sent.
    """
    channel.send(cob.NMT, bytes((command, node_id)))


def command(
    channel: Channel,
    monitor: NodeMonitor,
    wanted: NmtCommand,
    *,
    timeout: float = CONFIRM_TIMEOUT,
    answers_sdo: Callable[[], bool] | None = None,
) -> Confirmation:
    """Send an NMT command to one node and wait until it is confirmed; blocks up to ``timeout`` seconds and one SDO transfer.

    A command that the node's heartbeat does not show in a third of that time is sent again, except for the resets; one that neither
    heartbeat nor guarding can show is sent twice, because it may have been lost.

    ``answers_sdo`` tries the node's SDO server once; it serves where a node has neither heartbeat nor guarding.

    Raises:
        NodeRefused: it is there and reports another state; NodeTimeout: nothing confirms it.
        AdapterError: the channel failed.
        StateError: called in the receive thread.
    """
    require_other_thread(channel, "a confirmed NMT command")
    reports, bootups = monitor.reports, monitor.bootups
    send(channel, wanted, monitor.node_id)
    if wanted in _RESETS:
        monitor.wait_bootup(timeout, after=bootups)
        return Confirmation.BOOT_UP
    state = RESULT[wanted]
    if monitor.has_heartbeat:
        if _reported(channel, monitor, wanted, timeout, reports):
            return Confirmation.HEARTBEAT
    elif monitor.guarded and _guarded(channel, monitor, state, timeout):
        return Confirmation.GUARDING
    elif monitor.reports == reports and answers_sdo is not None and answers_sdo() is _serves_sdo(state):
        send(channel, wanted, monitor.node_id)
        monitor.assume(state)
        return Confirmation.SDO
    seen = f"expected {state.text}; {monitor.describe(time.monotonic())}"
    if monitor.reports > reports + 1:  # the first report may have crossed the command
        raise not_obeyed(monitor.node_id, wanted, monitor.state, seen)
    raise _unconfirmed(monitor, wanted, seen, timeout, there=monitor.reports > reports)


def _reported(channel: Channel, monitor: NodeMonitor, wanted: NmtCommand, timeout: float, after: int) -> bool:
    """Wait for the heartbeat; a command that it does not show is sent again, because NMT frames are not acknowledged."""
    for chance in range(_CHANCES):
        if chance:
            send(channel, wanted, monitor.node_id)
        if monitor.wait_state(RESULT[wanted], timeout / _CHANCES, after=after):
            return True
    return False


def _guarded(channel: Channel, monitor: NodeMonitor, state: NmtState, timeout: float) -> bool:
    """Ask by remote frame until the node says ``state``; give up early if it does not answer at all."""
    deadline = time.monotonic() + timeout
    unanswered = 0
    monitor.asking = True
    try:
        while time.monotonic() < deadline and unanswered < _GUARD_TRIES:
            asked = monitor.reports
            channel.send_remote(cob.HEARTBEAT + monitor.node_id)
            if monitor.wait_state(state, _GUARD_WAIT, after=asked):
                return True
            unanswered = unanswered + 1 if monitor.reports == asked else 0
        return False
    finally:
        monitor.asking = monitor.guarded


def guarding_answer(channel: Channel, monitor: NodeMonitor, timeout: float) -> NmtState | None:
    """Ask a node once for its state by node guarding (CiA 301 7.2.8.3.2.1); blocks up to ``timeout`` seconds.

    Not for a node whose life time is set and that nobody goes on to guard. Returns None where no answer comes.

    Raises:
        AdapterError: the channel failed, or passes no remote frames on.
        StateError: called in the receive thread.
    """
    asked, asking = monitor.reports, monitor.asking
    monitor.asking = True
    try:
        channel.send_remote(cob.HEARTBEAT + monitor.node_id)
        return monitor.state if monitor.wait_report(asked, timeout) else None
    finally:
        monitor.asking = asking


def _serves_sdo(state: NmtState) -> bool:
    return state is not NmtState.STOPPED


def not_obeyed(node_id: int, wanted: NmtCommand, state: NmtState, seen: str) -> NodeRefused:
    """Return the error of a node that reports its state, and another one than it was told to take."""
    return NodeRefused(
        f"node {node_id} does not take the NMT command {_name(wanted)!r}: it is there, and {state.text}",
        node=node_id,
        observed=seen,
        remedy=f"mend and clear the error that it names ({_CLEARS} {node_id}), and see {_ANOTHER_MASTER}",
    )


def _name(wanted: NmtCommand) -> str:
    return wanted.name.lower().replace("_", " ")


def _unconfirmed(
    monitor: NodeMonitor, wanted: NmtCommand, seen: str, timeout: float, *, there: bool
) -> NodeTimeout:
    check = (
        "it is there: check its error register (1001h)" if there else "check its power, node ID and wiring"
    )
    return NodeTimeout(
        f"node {monitor.node_id} did not confirm the NMT command {_name(wanted)!r} within {timeout:g} s",
        node=monitor.node_id,
        observed=seen,
        remedy=f"{check}, and {_ANOTHER_MASTER}",
    )
