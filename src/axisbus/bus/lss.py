"""LSS on a CAN channel (CiA 305): run the dialogues of ``axisbus.cia305`` in real time, never on a bus in operation.

Theory of operation
-------------------
The receive thread puts each frame of 7E4h with its time into an inbox. ``_exchange`` sends a request, collects the answers of the
expected kind until its wait is over, and passes them to the dialogue. An answer to the last request that comes after that is late;
its delay is passed on, so that the waits grow. However a dialogue ends, every slave is switched back to *waiting*: a slave left in
*configuration* would obey the next master's requests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import TypeVar

from axisbus.bus.link.channel import Channel, require_other_thread
from axisbus.bus.link.detect_other_master import bus_activity
from axisbus.bus.link.frame_queue import UnboundedQueue
from axisbus.bus.node import discover, nmt
from axisbus.bus.node.nmt import NodeMonitor
from axisbus.cia301 import cob
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia305 import master
from axisbus.cia305.dialogue import AdaptiveLssTimeout, Dialogue, LssReplies, LssReply, LssRequest, LssTiming
from axisbus.cia305.fastscan import FastScan
from axisbus.cia305.master import Inquired, NodeIdSet
from axisbus.cia305.scan_result import KnownIdentity, Scanned
from axisbus.cia305.services import (
    UNCONFIGURED,
    LssAddress,
    LssState,
    bit_timing_index,
    require_node_id,
    switch_global,
)
from axisbus.clock import sleep_until
from axisbus.errors import ArgumentError, BusError, NodeTimeout, StateError

T = TypeVar("T")
Progress = Callable[[int, int], None]  # slaves found, bits of the next one's address (0 to 128)

LISTEN = 1.1  # s: long enough for the usual heartbeat period of 1 s
BOOT_WAIT = 3.0  # s; some drives need seconds to restart
_SLICE = 0.05  # s between two checks of the channel's failure
_SEND_PATIENCE = 0.05


@dataclass(frozen=True, slots=True)
class NodeIdGiven:
    """Result of setting a node-ID; ``booted``: whether its boot-up message was seen under it, None if it is not due yet."""

    set: NodeIdSet
    booted: bool | None


class LssMaster:
    """The LSS master of a channel; holds received answers in an inbox, and the timing learnt from the slaves.

    Every call blocks, may raise the exceptions of its dialogue, and ``AdapterError`` if the channel fails. Make calls from one
    thread at a time, not from the receive thread (``StateError``). The first call listens for ``LISTEN`` s and raises
    ``StateError`` if the bus is in operation, unless ``beside_operation``.
    """

    def __init__(
        self,
        channel: Channel,
        timing: LssTiming | None = None,
        *,
        on_progress: Progress | None = None,
        beside_operation: bool = False,
    ) -> None:
        """Prepare; nothing is sent. ``on_progress`` is called in the caller's thread."""
        self.pace = AdaptiveLssTimeout(timing)
        self._channel = channel
        self._on_progress = on_progress
        self._quiet = beside_operation
        self._inbox: UnboundedQueue[tuple[bytes, float]] = UnboundedQueue(channel.clock)
        self._next: tuple[bytes, float] | None = None  # taken from the inbox, but not evaluated yet
        self._last_request = (0, 0.0)  # the last service with an answer, and the time of the request

    # -- services -----------------------------------------------------------------------------------------------------------------

    def find(self, known: KnownIdentity | None = None, most: int = len(cob.NODE_IDS)) -> Scanned:
        """Find all slaves without a node-ID by fast scan; changes nothing in them.

        Takes about 1 s for the first slave, 1 s for each slave with a very different address, and 0.6 s at the end, when no slave
        answers any more. A slave that continues to answer after it was found (against CiA 305) costs some seconds: its address is
        read from it, and it is excluded. ``Scanned`` reports that, and remaining uncertainties. Slaves with a node-ID do not take
        part (``axisbus.bus.node.discover.scan`` finds those).

        Raises:
            LssTimeout, LssError: a slave went silent, or the answers contradict each other again and again.
        """
        return self.run(FastScan(self.pace, known, most).run())

    def inquire(self, address: LssAddress | None) -> Inquired:
        """Return a slave's identity and node-ID; None means the only LSS slave on the bus.

        Raises:
            LssTimeout, LssError: no slave has this identity, or several answer.
        """
        return self.run(master.inquire(self.pace, address))

    def set_node_id(
        self, address: LssAddress | None, node_id: int, *, store: bool = False, reset: bool = False
    ) -> NodeIdGiven:
        """Give a slave a node-ID that no other node has; wait until it boots with it, if that is due.

        A slave without a node-ID boots at once. If it does not, ``reset`` sends NMT *reset communication* to the new node-ID, with
        which some slaves accept it. A slave with a node-ID always needs *reset communication*; ``reset`` sends it to the old
        node-ID (it stops a drive that moves). A slave that does not report its node-ID is not reset. 255 removes the node-ID.
        Blocks for up to about 6 s.

        Raises:
            ArgumentError: the node-ID cannot be assigned.
            StateError: another node has it.
            LssRefused: the slave does not accept or store it; LssTimeout, LssError: as ``inquire``.
        """
        require_node_id(node_id)
        before = self.inquire(address)
        if node_id not in (before.node_id, UNCONFIGURED):
            self._require_free(node_id)
        with closing(NodeMonitor(self._channel, node_id)) as monitor:
            done = self.run(master.set_node_id(self.pace, before.address, node_id, store=store))
            if reset and before.configured and before.node_id is not None:
                nmt.send(self._channel, NmtCommand.RESET_COMMUNICATION, before.node_id)
            elif before.configured:
                return NodeIdGiven(done, None)
            if node_id == UNCONFIGURED:
                return NodeIdGiven(done, None)
            booted = _boots(monitor)
            if reset and not booted and done.at_once:  # no other node has this node-ID
                nmt.send(self._channel, NmtCommand.RESET_COMMUNICATION, node_id)
                booted = _boots(monitor)
            # If a slave does not report its node-ID, it is unknown whether a boot-up is due now.
            return NodeIdGiven(done, None if before.node_id is None and not booted else booted)

    def set_bit_rate(
        self, addresses: Sequence[LssAddress] | None, bitrate: int, *, store: bool = False
    ) -> None:
        """Set the bit rate (bit/s) that slaves (None: all at once) change to at ``activate``, or at a restart after storing.

        Raises:
            ArgumentError: CiA 305 has no such rate, or ``addresses`` is empty.
            LssRefused: a slave does not accept or store it; LssTimeout, LssError: as ``inquire``.
        """
        bit_timing_index(bitrate)
        _require_some(addresses)
        self.run(master.set_bit_rate(self.pace, addresses, bitrate, store=store))

    def activate(self, addresses: Sequence[LssAddress] | None, delay: float) -> None:
        """Make slaves (None: all) change to the configured bit rate; blocks until they have (twice ``delay`` s).

        Every node that does not change loses the bus, and so does the master: ``bitrate_change.change_over`` changes its adapter
        too.

        Raises:
            ArgumentError: the delay is not 0.01 to 65.535 s, or ``addresses`` is empty.
            LssTimeout: a slave in ``addresses`` does not answer; nothing was activated.
        """
        sent = self.start_activation(addresses, delay)
        sleep_until(self._channel.clock, sent + 2 * delay)

    def start_activation(self, addresses: Sequence[LssAddress] | None, delay: float) -> float:
        """As ``activate``, without waiting. Return the time at which the command was passed to the adapter (clock, s).

        From then on the slaves use the old rate for ``delay`` s, change the rate, and are silent for another ``delay`` s.
        """
        _require_some(addresses)
        self.run(master.activate(self.pace, addresses, delay), leave=False)
        return self._channel.clock.now()

    @property
    def channel(self) -> Channel:
        """The channel of this master."""
        return self._channel

    def store(self, address: LssAddress | None) -> None:
        """Make a slave store its node-ID and bit rate; blocks up to 15 s if it is silent.

        Raises:
            LssRefused: it cannot; LssTimeout, LssError: as ``inquire``.
        """
        self.run(master.store(self.pace, address))

    def identify(self, low: LssAddress, high: LssAddress) -> bool:
        """Return whether a slave has revision and serial number in these ranges, with or without a node-ID.

        Raises:
            ArgumentError: the two differ in vendor-ID or product code.
        """
        return self.run(master.identify(self.pace, low, high))

    def any_unconfigured(self) -> bool:
        """Return whether any slave has no node-ID, by a separate service that not every slave supports."""
        return self.run(master.any_unconfigured(self.pace))

    # -- running a dialogue -------------------------------------------------------------------------------------------------------

    def run(self, dialogue: Dialogue[T], *, leave: bool = True) -> T:
        """Run a dialogue to its end; ``leave`` switches all slaves to *waiting* after it.

        Raises:
            StateError: the bus is in operation, or called in the receive thread.
            AdapterError: the channel failed; and the exceptions of the dialogue.
        """
        require_other_thread(self._channel, "an LSS service")
        self._require_quiet()
        self._channel.subscribe(cob.LSS_TX, self._receive)
        try:
            return self._drive(dialogue)
        except BaseException:
            leave = True
            raise
        finally:
            if leave:
                with suppress(BusError):  # the failure is being reported already
                    self._channel.send(cob.LSS_RX, switch_global(LssState.WAITING), _SEND_PATIENCE)
            self._channel.unsubscribe(cob.LSS_TX, self._receive)

    def _drive(self, dialogue: Dialogue[T]) -> T:
        try:
            request = next(dialogue)
            while True:
                if self._on_progress is not None:
                    self._on_progress(request.found, request.bits)
                request = dialogue.send(self._exchange(request))
        except StopIteration as end:
            result: T = end.value
            return result
        finally:
            dialogue.close()

    def _exchange(self, request: LssRequest) -> LssReplies:
        late: list[float] = []
        before = self._channel.clock.now()
        while (item := self._take(before)) is not None:
            self._note_late(item, late)
        sent = self._channel.clock.now()
        self._channel.send(cob.LSS_RX, request.frame, _SEND_PATIENCE)
        answers: list[LssReply] = []
        until = sent + request.wait
        while (item := self._take(until)) is not None:
            data, stamp = item
            if request.expects is None:
                self._note_late(item, late)
            elif data[:1] == bytes((request.expects,)):
                until = until if answers else stamp + request.settle
                answers.append(LssReply(data, stamp - sent))
            else:
                self._drop(item)
        if request.expects is not None:
            self._last_request = request.expects, sent
        return LssReplies(tuple(answers), tuple(late))

    def _note_late(self, item: tuple[bytes, float], late: list[float]) -> None:
        """Record the delay of an answer to the last request that has one; other frames are only counted."""
        self._drop(item)
        data, stamp = item
        expected, sent = self._last_request
        if data[:1] == bytes((expected,)):
            late.append(stamp - sent)

    def _drop(self, item: tuple[bytes, float]) -> None:
        data, stamp = item
        self._channel.drops.note(DropReason.LSS, None, stamp, cob.LSS_TX, data)

    def _take(self, until: float) -> tuple[bytes, float] | None:
        """Return the next frame that came by the time ``until``, None if there is none; a waiting frame is returned even later.

        Frames that came later stay in the inbox, so that a slave that sends continuously does not prolong a wait.
        """
        while True:
            self._channel.check()
            now = self._channel.clock.now()
            item = self._next = self._next or self._inbox.take(min(until, now + _SLICE))
            if item is not None and item[1] <= until:
                self._next = None
                return item
            if item is not None or now >= until:
                return None

    def _receive(self, data: bytes, stamp: float) -> None:
        self._inbox.put((data, stamp))

    # -- preconditions ------------------------------------------------------------------------------------------------------------

    def _require_quiet(self) -> None:
        if self._quiet:
            return
        signs = bus_activity(self._channel, LISTEN)
        if signs:
            raise StateError(
                "the bus is in operation: LSS would change node-IDs and bit rates under a running machine",
                observed=", ".join(signs),
                remedy="end the program that runs the machine, or stop its nodes (axisbus stop cell.toml), and try again",
            )
        self._quiet = True

    def _require_free(self, node_id: int) -> None:
        if discover.scan(self._channel, ids=(node_id,)):
            raise StateError(
                f"node-ID {node_id} is in use: another node answers with it",
                observed="two nodes with one node-ID would answer each other's requests",
                remedy="give a free one (axisbus scan shows those in use)",
            )


def _boots(monitor: NodeMonitor) -> bool:
    try:
        monitor.wait_bootup(BOOT_WAIT)
    except NodeTimeout:
        return False
    return True


def _require_some(addresses: Sequence[LssAddress] | None) -> None:
    if addresses is not None and not addresses:
        raise ArgumentError("no LSS slave is named", remedy="give the identity of each slave")
