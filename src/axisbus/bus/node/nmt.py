"""Network management of one node: its reported state, and commands with confirmation (CiA 301 7.2.8).

An NMT command has no answer of its own. The next heartbeat confirms it. If a node sends no heartbeat and is guarded, the answer to
a guarding request confirms it. If it has neither, it is confirmed by its SDO server: it must answer (or, once stopped, must not
answer), and its state is then *assumed*. ``command`` sends no guarding request to a node that is not guarded. The first request
would start the node's life guarding, and the missing requests afterwards would put the node into a fault.
"""

from __future__ import annotations

import math
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
    """How a node has shown that it executed a command."""

    HEARTBEAT = "its heartbeat"
    BOOT_UP = "its boot-up message"
    GUARDING = "its answer to node guarding"
    SDO = "its SDO server; the state itself is assumed"


class NodeMonitor:
    """State that a node reports; holds state: last NMT state with its time, latched boot-ups, heartbeat monitoring.

    Boot-ups are counted, so that none is lost between two checks. Times are seconds of the channel's clock. ``deadline`` is the
    time at which the next heartbeat or answer is overdue (infinity: none is expected). An answer is expected only while a guarding
    request is unanswered. May be used from any thread, except that the waiting calls must not be made in the receive thread.
    """

    def __init__(self, channel: Channel, node_id: int) -> None:
        self.node_id = node_id
        self.state = NmtState.UNKNOWN
        self.stamp: float | None = None
        self.assumed = False
        self.reports = 0
        self.bootups = 0
        self.bootup_stamp: float | None = None
        self.asking = False  # during node guarding a report is an answer and not a heartbeat
        # Guarding requests are sent continuously, so another one does not start the node's life guarding.
        self.guarded = False
        self.toggle_errors = 0
        self.duplicate = ""  # evidence that a second device has this node-ID
        # SYNCs sent before its only NMT command *start*; None: there was none, or several.
        self.started: int | None = None
        self._starts = 0
        self._turns = 0  # reports in a row that equal the report before the last, but not the last
        self._before: NmtState | None = None  # the report before the last
        self._toggle: int | None = None  # of the last answer to a guarding request
        self._heartbeats = 0
        self._channel = channel
        self._changed = channel.clock.condition()
        self._watch: float | None = None
        self._watched_since = 0.0
        self._guard_period = 0.0  # seconds between two guarding requests
        self.deadline = math.inf
        channel.subscribe(cob.HEARTBEAT + node_id, self._on_report)
        channel.subscribe(cob.NMT, self._on_command)
        channel.on_failure.append(self._wake)

    # -- reported state -----------------------------------------------------------------------------------------------------------

    def watch(self, timeout: float | None) -> None:
        """Expect a heartbeat every ``timeout`` seconds from now on (None: expect none)."""
        with self._changed:
            self._watched_since = self._channel.clock.now()
            self._watch = timeout
            self._expect()

    def _expect(self) -> None:
        since = max(self.stamp or 0.0, self._watched_since)
        self.deadline = math.inf if self._watch is None or self.guarded else since + self._watch

    @property
    def watched(self) -> float | None:
        """The consumer time in seconds, None if no heartbeat is expected."""
        return self._watch

    @property
    def has_heartbeat(self) -> bool:
        """Whether the node has sent a heartbeat since its last boot-up."""
        return self._heartbeats > 0

    def overdue(self, now: float) -> bool:
        """Whether the expected heartbeat is missing at the time ``now``."""
        return now > self.deadline

    def operational(self, now: float) -> bool:
        """Whether the last reported state is *operational* and the heartbeat is not overdue."""
        return self.state == NmtState.OPERATIONAL and not self.overdue(now)

    def guard(self, timeout: float, period: float) -> None:
        """Expect answers to guarding requests instead of heartbeats, the last one no older than ``timeout`` seconds.

        ``period``: seconds between two requests (``ask``). Before the first request no answer is expected.
        """
        self.guarded = self.asking = True
        self._guard_period = period
        self.watch(timeout)

    def ask(self, now: float) -> None:
        """Send a guarding request (CiA 301 7.2.8.3.2.1), and expect an answer if ``guard`` was called.

        The silence of the node counts from one period before the first unanswered request, so that late requests do not count as
        silence.

        Raises:
            AdapterError: as ``Channel.send_remote``.
        """
        self._channel.send_remote(cob.HEARTBEAT + self.node_id)
        with self._changed:
            if self.guarded and self._watch is not None and self.deadline == math.inf:
                self.deadline = max(self.stamp or 0.0, now - self._guard_period) + self._watch

    def describe(self, now: float) -> str:
        """Return state and age as text for an error."""
        if self.stamp is None:
            return "it has never reported its NMT state"
        kind = "assumed" if self.assumed else f"last reported {now - self.stamp:.2f} s ago"
        return f"NMT state {self.state.text} ({kind}), {counted(self.bootups, 'boot-up')} seen"

    def note_duplicate(self, why: str) -> None:
        """Store the evidence that a second device has this node-ID; the first reason remains."""
        self.duplicate = self.duplicate or why

    def note_start(self, syncs: int) -> None:
        """Record that the NMT command *start* follows, after ``syncs`` SYNCs."""
        self._starts += 1
        self.started = syncs if self._starts == 1 else None

    def forget_heartbeats(self) -> None:
        """Expect no heartbeat as a confirmation until the next one comes: the node may have restarted while it was not heard."""
        with self._changed:
            self._heartbeats = 0

    def assume(self, state: NmtState) -> None:
        """Assume ``state``, because the node cannot report it."""
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
        """Wait until more than ``after`` boot-ups have come since this monitor was made.

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
            observed=self.describe(self._channel.clock.now()),
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
        clock = self._channel.clock
        deadline = clock.now() + timeout
        with self._changed:
            while not done():
                self._channel.check()
                left = deadline - clock.now()
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
            if is_boot_up(data):  # boot-up; the node then enters pre-operational automatically
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
        """Detect two devices with one node-ID and different states, which report their states in turn."""
        turns = state is self._before and state is not self.state and not self.asking
        self._turns = self._turns + 1 if turns else 0
        self._before = self.state
        if self._turns >= _TURNS:
            self.note_duplicate(f"its heartbeats report {self.state.text} and {state.text} alternately")

    def _drop(self, fault: DropReason, data: bytes, stamp: float) -> None:
        self._channel.drops.note(fault, self.node_id, stamp, cob.HEARTBEAT + self.node_id, data)

    def _is_stale(self, value: int) -> bool:
        """Whether an answer to guarding counts as not received, because its toggle bit has not changed (CiA 301 7.2.8.3.2.1)."""
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
        """Assume the result of another master's command if no heartbeat will report it."""
        if len(data) < 2 or data[1] not in (0, self.node_id) or self.has_heartbeat:
            return
        if data[0] in NmtCommand.__members__.values():
            self.assume(RESULT[NmtCommand(data[0])])

    def _wake(self, error: object) -> None:
        with self._changed:
            if isinstance(
                error, BusOff
            ):  # the state during bus-off is unknown; the next report sets it again
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

    If the node's heartbeat does not show the result within a third of that time, the command is sent again, except for the resets.
    If neither heartbeat nor guarding can show it, the command is sent twice, because it may have been lost.

    ``answers_sdo`` tries the node's SDO server once; it is used if a node has neither heartbeat nor guarding.

    Raises:
        NodeRefused: the node reports another state; NodeTimeout: nothing confirms the command.
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
    seen = f"expected {state.text}; {monitor.describe(channel.clock.now())}"
    # The node may have sent the first report before it received the command.
    if monitor.reports > reports + 1:
        raise not_obeyed(monitor.node_id, wanted, monitor.state, seen)
    raise _unconfirmed(monitor, wanted, seen, timeout, there=monitor.reports > reports)


def _reported(channel: Channel, monitor: NodeMonitor, wanted: NmtCommand, timeout: float, after: int) -> bool:
    """Wait for the heartbeat; repeat the command until it shows the result, because NMT frames are not acknowledged."""
    for chance in range(_CHANCES):
        if chance:
            send(channel, wanted, monitor.node_id)
        if monitor.wait_state(RESULT[wanted], timeout / _CHANCES, after=after):
            return True
    return False


def _guarded(channel: Channel, monitor: NodeMonitor, state: NmtState, timeout: float) -> bool:
    """Send remote frames until the node reports ``state``; give up early if it does not answer at all."""
    deadline = channel.clock.now() + timeout
    unanswered = 0
    monitor.asking = True
    try:
        while channel.clock.now() < deadline and unanswered < _GUARD_TRIES:
            asked = monitor.reports
            channel.send_remote(cob.HEARTBEAT + monitor.node_id)
            if monitor.wait_state(state, _GUARD_WAIT, after=asked):
                return True
            unanswered = unanswered + 1 if monitor.reports == asked else 0
        return False
    finally:
        monitor.asking = monitor.guarded


def guarding_answer(channel: Channel, monitor: NodeMonitor, timeout: float) -> NmtState | None:
    """Request a node's state once by node guarding (CiA 301 7.2.8.3.2.1); blocks up to ``timeout`` seconds.

    Do not use this for a node whose life time is set and that is not guarded continuously. Returns None if no answer comes.

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
    """Return the error of a node that reports a state other than the commanded one."""
    return NodeRefused(
        f"node {node_id} does not execute the NMT command {_name(wanted)!r}: it answers, and is {state.text}",
        node=node_id,
        observed=seen,
        remedy=f"remove the cause of its error and clear the error ({_CLEARS} {node_id}), and check {_ANOTHER_MASTER}",
    )


def _name(wanted: NmtCommand) -> str:
    return wanted.name.lower().replace("_", " ")


def _unconfirmed(
    monitor: NodeMonitor, wanted: NmtCommand, seen: str, timeout: float, *, there: bool
) -> NodeTimeout:
    check = "it answers: check its error register (1001h)" if there else "check its power, node ID and wiring"
    return NodeTimeout(
        f"node {monitor.node_id} did not confirm the NMT command {_name(wanted)!r} within {timeout:g} s",
        node=monitor.node_id,
        observed=seen,
        remedy=f"{check}, and {_ANOTHER_MASTER}",
    )
