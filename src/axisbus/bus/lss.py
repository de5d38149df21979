"""LSS on a CAN channel (CiA 305): runs the dialogues of ``cia301`` in real time, never beside a bus in operation.

Theory of operation
-------------------
The receive thread puts each frame of 7E4h with its time into an inbox. ``_exchange`` sends a request, takes the answers of its kind
until its wait is over, and hands them to the dialogue. An answer to the last request that comes after that was too late; its delay
is told, so that the waits grow. However a dialogue ends, every slave is switched back to *waiting*: a slave
left in *configuration* would obey the next master's requests.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import TypeVar

from axisbus.bus.link.bus_activity import bus_activity
from axisbus.bus.link.channel import Channel, require_other_thread
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
from axisbus.errors import ArgumentError, BusError, NodeTimeout, StateError

T = TypeVar("T")
Progress = Callable[[int, int], None]  # slaves found, bits of the next one's address (0 to 128)

LISTEN = 1.1  # s: the usual heartbeat of 1 s fits in
BOOT_WAIT = 3.0  # s; some drives need seconds to restart
_SLICE = 0.05  # s between two looks at the channel's failure
_SEND_PATIENCE = 0.05


@dataclass(frozen=True, slots=True)
class NodeIdGiven:
    """What became of a node-ID: ``booted`` when the boot-up message under it was seen, None where it is not due yet."""

    set: NodeIdSet
    booted: bool | None


class LssMaster:
    """The LSS master of a channel; holds the answers that wait in an inbox, and the pace learnt from the slaves.

    Every call blocks, may raise what its dialogue raises and ``AdapterError`` when the channel fails, and is to be made from one
    thread at a time, not from the receive thread (``StateError``). The first call listens for ``LISTEN`` s and raises
    ``StateError`` when the bus is in operation, unless ``beside_operation``.
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
        self._inbox: UnboundedQueue[tuple[bytes, float]] = UnboundedQueue()
        self._next: tuple[bytes, float] | None = None  # taken from the inbox, and not looked at yet
        self._asked = (0, 0.0)  # the last service that has an answer, and when it was sent

    # -- what it does -------------------------------------------------------------------------------------------------------------

    def find(self, known: KnownIdentity | None = None, most: int = len(cob.NODE_IDS)) -> Scanned:
        """Find all slaves without a node-ID by fast scan; changes nothing about them.

        Takes about 1 s for the first and one more for each that differs much; 0.6 s more at the end, when nobody answers any more.
        A slave that goes on answering after it was found (against CiA 305) costs some seconds: its address is read from it, and it
        is excluded; ``Scanned`` says so, and what could not be found out. Slaves with a node-ID do not take part
        (``axisbus.bus.node.discover.scan`` finds those).

        Raises:
            LssTimeout, LssError: a slave went silent, or the answers go on contradicting each other.
        """
        return self.run(FastScan(self.pace, known, most).run())

    def inquire(self, address: LssAddress | None) -> Inquired:
        """Return a slave's identity and node-ID; None means the only LSS slave on the bus.

        Raises:
            LssTimeout, LssError: nobody has this identity, or several answer.
        """
        return self.run(master.inquire(self.pace, address))

    def set_node_id(
        self, address: LssAddress | None, node_id: int, *, store: bool = False, reset: bool = False
    ) -> NodeIdGiven:
        """Give a slave a node-ID that nobody else has; wait until it boots under it, where that is due.

        A slave without a node-ID boots at once; if it does not, ``reset`` sends NMT *reset communication* to the new node-ID, with
        which some slaves take it. One with a node-ID needs *reset communication* always, which ``reset`` sends to its old node-ID
        (it stops a drive that moves); a slave that does not tell its node-ID is not reset. 255 takes the node-ID away. Blocks for
        up to about 6 s.

        Raises:
            ArgumentError: the node-ID cannot be given.
            StateError: another node has it.
            LssRefused: the slave does not take or store it; LssTimeout, LssError: as ``inquire``.
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
            # Of a slave that does not tell its node-ID, nobody knows whether it is to boot now.
            return NodeIdGiven(done, None if before.node_id is None and not booted else booted)

    def set_bit_rate(
        self, addresses: Sequence[LssAddress] | None, bitrate: int, *, store: bool = False
    ) -> None:
        """Tell slaves (None: all at once) the bit rate (bit/s) that ``activate``, or a restart after storing, brings into force.

        Raises:
            ArgumentError: CiA 305 has no such rate, or nobody is named.
            LssRefused: a slave does not take or store it; LssTimeout, LssError: as ``inquire``.
        """
        bit_timing_index(bitrate)
        _require_some(addresses)
        self.run(master.set_bit_rate(self.pace, addresses, bitrate, store=store))

    def activate(self, addresses: Sequence[LssAddress] | None, delay: float) -> None:
        """Have slaves (None: all) change to the bit rate that they were told; blocks until they have (twice ``delay`` s).

        Every node that does not change loses the bus, and so do we: ``changeover.change_over`` takes our adapter along.

        Raises:
            ArgumentError: the delay is not 0.01 to 65.535 s, or nobody is named.
            LssTimeout: a slave named does not answer; nothing was activated.
        """
        sent = self.start_activation(addresses, delay)
        time.sleep(max(0.0, sent + 2 * delay - time.monotonic()))

    def start_activation(self, addresses: Sequence[LssAddress] | None, delay: float) -> float:
        """Do as ``activate``, but return when the command was given to the adapter (monotonic clock, s), and do not wait.

        The slaves are at the old rate for ``delay`` s from then on, change over, and are silent for as long again.
        """
        _require_some(addresses)
        self.run(master.activate(self.pace, addresses, delay), leave=False)
        return time.monotonic()

    @property
    def channel(self) -> Channel:
        """The channel that it works on."""
        return self._channel

    def store(self, address: LssAddress | None) -> None:
        """Have a slave store its node-ID and bit rate; blocks up to 15 s where it is silent.

        Raises:
            LssRefused: it cannot; LssTimeout, LssError: as ``inquire``.
        """
        self.run(master.store(self.pace, address))

    def identify(self, low: LssAddress, high: LssAddress) -> bool:
        """Return whether a slave with revision and serial number in these ranges is there, with or without a node-ID.

        Raises:
            ArgumentError: the two differ in vendor-ID or product code.
        """
        return self.run(master.identify(self.pace, low, high))

    def any_unconfigured(self) -> bool:
        """Return whether a slave without a node-ID is there (by its own service, which not every slave has)."""
        return self.run(master.any_unconfigured(self.pace))

    # -- how it runs --------------------------------------------------------------------------------------------------------------

    def run(self, dialogue: Dialogue[T], *, leave: bool = True) -> T:
        """Run a dialogue to its end; ``leave`` switches all slaves to *waiting* behind it.

        Raises:
            StateError: the bus is in operation, or called in the receive thread.
            AdapterError: the channel failed; and what the dialogue raises.
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
                with suppress(BusError):  # what failed is being told already
                    self._channel.send(cob.LSS_RX, switch_global(LssState.WAITING), _SEND_PATIENCE)
            self._channel.unsubscribe(cob.LSS_TX, self._receive)

    def _drive(self, dialogue: Dialogue[T]) -> T:
        try:
            ask = next(dialogue)
            while True:
                if self._on_progress is not None:
                    self._on_progress(ask.found, ask.bits)
                ask = dialogue.send(self._exchange(ask))
        except StopIteration as end:
            result: T = end.value
            return result
        finally:
            dialogue.close()

    def _exchange(self, ask: LssRequest) -> LssReplies:
        late: list[float] = []
        before = time.monotonic()
        while (item := self._take(before)) is not None:
            self._note_late(item, late)
        sent = time.monotonic()
        self._channel.send(cob.LSS_RX, ask.frame, _SEND_PATIENCE)
        answers: list[LssReply] = []
        until = sent + ask.wait
        while (item := self._take(until)) is not None:
            data, stamp = item
            if ask.expects is None:
                self._note_late(item, late)
            elif data[:1] == bytes((ask.expects,)):
                until = until if answers else stamp + ask.settle
                answers.append(LssReply(data, stamp - sent))
            else:
                self._drop(item)
        if ask.expects is not None:
            self._asked = ask.expects, sent
        return LssReplies(tuple(answers), tuple(late))

    def _note_late(self, item: tuple[bytes, float], late: list[float]) -> None:
        """Take the delay of an answer to the last request that has one; what else comes says nothing."""
        self._drop(item)
        data, stamp = item
        expected, sent = self._asked
        if data[:1] == bytes((expected,)):
            late.append(stamp - sent)

    def _drop(self, item: tuple[bytes, float]) -> None:
        data, stamp = item
        self._channel.drops.note(DropReason.LSS, None, stamp, cob.LSS_TX, data)

    def _take(self, until: float) -> tuple[bytes, float] | None:
        """Return the next frame that came by the time ``until``, None when there is none; one that waits is taken even then.

        What came later stays where it is, so that a slave that talks without a pause ends no wait late.
        """
        while True:
            self._channel.check()
            now = time.monotonic()
            item = self._next = self._next or self._inbox.take(min(until, now + _SLICE))
            if item is not None and item[1] <= until:
                self._next = None
                return item
            if item is not None or now >= until:
                return None

    def _receive(self, data: bytes, stamp: float) -> None:
        self._inbox.put((data, stamp))

    # -- what it asks of the bus --------------------------------------------------------------------------------------------------

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
                f"node-ID {node_id} is taken: another node answers under it",
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
        raise ArgumentError("no LSS slave is named", remedy="give the identity of each")
