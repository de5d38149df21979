"""The bus for the scan: time, the frames of all ports, SYNC, the master's heartbeat, and the quick stop of all axes.

Theory of operation
-------------------
``wait_until`` sleeps to an absolute time, so that periods do not drift and a late cycle does not delay the next one. All frames are
sent by calls of the scan. When the scan stops, SYNC, heartbeat and RPDOs stop with it, and the drives notice.

If another device sends SYNC, ``wait_until`` waits for that SYNC instead. The master then sends none, not even with the quick stop,
because a bus must not have two producers. The drives then accept the stop frames with the next SYNC of that device, and the quick
stop by SDO at once.

``quick_stop_all`` is for a failed scan, which may be stuck in the driver. It needs nothing that the scan may hold: the stop frames
were built when the last frames were committed. ``Channel.send_urgent`` sends them in a thread of its own, and the wait for that
thread is limited.

While the controller is bus-off the cycles continue, so that the axes are informed and can be stopped as soon as the bus is back.
Nothing is sent: the frames of the ports are dropped. If another device sends SYNC, its absence ends the scan, as at any other time.

The same applies while the adapter's transmit queue is full for longer than ``send`` waits: the frames of a cycle that cannot be
sent are dropped. Each cycle then tries its first frame once, without waiting, until the adapter accepts it. SYNC follows the frames
of that cycle, because the values in the drives are those from before.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Protocol

from axisbus.bus.link.channel import SEND_PATIENCE, Channel
from axisbus.bus.node.events import NodeEvents
from axisbus.bus.pdo.rpdo import Frame
from axisbus.bus.sync_and_time import SyncConsumer, TimeProducer
from axisbus.cia301 import cob
from axisbus.cia301.nmt import NmtState
from axisbus.errors import AdapterError, BusOff, TransmitQueueFull

QUICK_STOP_PATIENCE = 0.5  # seconds to wait until the stop frames are accepted
_REPEAT_PERIOD = 0.02  # seconds between two repetitions of the stop frames until the stop is confirmed
_OUR_STATE = bytes((NmtState.OPERATIONAL,))


class FrameOwner(Protocol):
    """The node that the frames belong to."""

    @property
    def node_id(self) -> int:
        """The node's ID."""


class GuardedNode(Protocol):
    """A node without heartbeat that is monitored by node guarding: a ``NodeMonitor``."""

    node_id: int

    def ask(self, now: float) -> None:
        """Send a guarding request."""


class CycleSender(Protocol):
    """Source of frames in a cycle: a ``CanPort`` of an axis, or a ``CanIoPort`` of a node's inputs and outputs."""

    asks: bool

    @property
    def node(self) -> FrameOwner:
        """The node of the frames."""

    def take_frames(self) -> list[Frame]:
        """Return the frames given since the last call, in the order in which they must be sent."""

    def drop_frames(self) -> None:
        """Discard these frames, because the bus cannot carry them."""

    def begin_again(self) -> None:
        """Discard received values and the frames to send: the adapter was opened again."""

    def take_requests(self, now: float) -> list[tuple[int, int]]:
        """Return the TPDOs to request by remote frames now, as COB-ID and data length."""

    def stop_frames(self) -> tuple[tuple[Frame, ...], tuple[Frame, ...]]:
        """Return the frames of a quick stop, by PDO and by SDO."""

    def close(self) -> None:
        """Stop listening."""


class BootHeartbeat:
    """The master's heartbeat from the moment at which a first node expects it until the scan sends it; holds its thread.

    A node may start its timer with the write of 1016h, and not with the first received heartbeat (CiA 301 7.5.2.19). May be used
    from any thread.
    """

    def __init__(self, channel: Channel, master_id: int, period: float) -> None:
        """``master_id``: the master's node-ID (1 to 127); ``period`` in seconds, 0 to send none."""
        self._channel = channel
        self._can_id = cob.HEARTBEAT + master_id
        self._period = period
        self._over = channel.clock.event()
        self._lock = channel.clock.lock()
        self._begun = False

    def begin(self) -> None:
        """Send the first heartbeat, then one in each period; no effect when repeated, or after ``end``. Blocks for the frame.

        Raises:
            AdapterError: it cannot be sent.
        """
        with self._lock:
            if self._begun or self._period <= 0 or self._over.is_set():
                return
            self._channel.send(self._can_id, _OUR_STATE)
            self._begun = True
            self._channel.clock.thread(self._run, "axisbus heartbeat").start()

    def end(self) -> None:
        """Stop sending; does not block."""
        self._over.set()

    def _run(self) -> None:
        while not self._over.wait(self._period):
            with suppress(AdapterError):  # booting uses the same adapter, and reports its errors
                self._channel.send(self._can_id, _OUR_STATE)


class CanCycle:
    """One bus (``axisbus.cia402.port.BusCycle``); holds state: the due time of the heartbeat, and whether all axes were stopped.

    ``quick_stop_all`` may be called from any thread, the other methods only from the scan's.
    """

    def __init__(
        self,
        channel: Channel,
        ports: Sequence[CycleSender],
        *,
        sync_cob_id: int | None = cob.SYNC,
        sync_counter: int = 0,
        sync_consumer: SyncConsumer | None = None,
        time_producer: TimeProducer | None = None,
        master_id: int | None = None,
        heartbeat: float = 0.0,
        boot_heartbeat: BootHeartbeat | None = None,
        guarded: Mapping[GuardedNode, float] | None = None,
        events: Sequence[NodeEvents] = (),
        owns_channel: bool = False,
        spin: float = 0.0,
    ) -> None:
        """Serve ``ports`` on ``channel``.

        Args:
            sync_cob_id: COB-ID of the SYNC that the master sends, None to send none.
            sync_counter: value at which the counter in SYNC restarts with 1 (1019h: 2 to 240), 0 for SYNC without counter.
            sync_consumer: another device's SYNC, which then starts each cycle; None if the master's own clock does.
            time_producer: sends TIME, None to send none.
            master_id: the master's node-ID (1 to 127) for the heartbeat, None to send none.
            heartbeat: its period in seconds, 0 to send none.
            boot_heartbeat: the sender during boot-up; the first heartbeat of the cycle replaces it.
            guarded: nodes without heartbeat that are monitored by node guarding, each with its period in seconds.
            events: detectors of error control events, called in each commit.
            owns_channel: whether ``close`` closes the channel too.
            spin: maximum seconds before a cycle is due in which the clock is polled instead of sleeping: a sleep may end late,
                polling does not.
        """
        self._channel = channel
        self._ports = tuple(ports)
        self._sync_cob_id = sync_cob_id
        self._sync_counter = sync_counter
        self._count = 0
        self._sync_consumer = sync_consumer
        self._time_producer = time_producer
        self._heartbeat_id = cob.HEARTBEAT + master_id if master_id and heartbeat > 0 else None
        self._heartbeat_period = heartbeat
        self._boot_heartbeat = boot_heartbeat
        self._heartbeat_due = float("-inf") if self._heartbeat_id else float("inf")
        self._guarding = dict(guarded or {})
        self._guarding_due = dict.fromkeys(self._guarding, float("-inf"))
        self._events = tuple(events)
        self._owns_channel = owns_channel
        self._clock = channel.clock.now
        self._sleep = channel.clock.sleep
        self._sleep_margin = SleepMargin(spin)
        self._stopped = False
        self._behind = False
        self._blocked = False  # the adapter accepts no frames
        self._sync_held = False  # until the frames of this cycle are sent

    def add(
        self,
        ports: Sequence[CycleSender],
        node: GuardedNode,
        events: NodeEvents,
        guarding: float | None = None,
    ) -> None:
        """Serve the ports of a node that has been booted, and guard it every ``guarding`` seconds (None: not).

        Earlier ports of the same node are closed, and served no more. Only for the scan's thread.
        """
        earlier = [port for port in self._ports if port.node.node_id == node.node_id]
        self._ports = (*(port for port in self._ports if port not in earlier), *ports)
        for port in earlier:
            port.close()
        self._events = (*(each for each in self._events if each is not events), events)
        self._guarding_due = {each: due for each, due in self._guarding_due.items() if each is not node}
        self._guarding = {each: period for each, period in self._guarding.items() if each is not node}
        if guarding is not None:
            self._guarding_due[node] = float("-inf")
            self._guarding[node] = guarding

    def now(self) -> float:
        """Return the time of the channel's clock in seconds."""
        return self._clock()

    def wait_until(self, t: float) -> float | None:
        """Return when ``now() >= t``, as soon after it as the system permits. Blocks by sleeping, and polls the clock at the end.

        If another device sends SYNC, return when its next SYNC has come, whatever ``t`` is, with the time of that SYNC.

        Raises:
            SyncError: that SYNC has stopped.
            BusError: the channel has failed; this is reported before any of its consequences.
        """
        if self._sync_consumer is not None:
            return self._sync_consumer.wait()
        sleep_margin, left = self._sleep_margin, t - self._clock()
        while left > sleep_margin.early:
            ends = left - sleep_margin.early
            self._sleep(ends)
            before, left = left, t - self._clock()
            sleep_margin.note(before - left - ends)
        try:  # noqa: SIM105  # in every cycle: ``suppress`` would cost more than the check
            self._channel.check()
        except BusOff:
            pass  # the ports inform the axes
        if self._channel.behind is not None:
            self._behind = self._channel.behind()
        while left > 0:  # last, so that nothing delays SYNC
            left = t - self._clock()
        return None

    def receive(self) -> bool:
        """As ``BusCycle.receive``: read the frames that the kernel has collected for this cycle, if the adapter separates them."""
        self._channel.drain()
        return self._behind

    def commit(self) -> None:
        """Send the frames given to the ports since the last commit; blocks while the adapter's queue is full, a few ms.

        Raises:
            BusError: the channel failed, or can no longer receive.
        """
        try:
            frames: list[Frame] = []
            for port in self._ports:
                frames += port.take_frames()
            if self._blocked and not self._stopped:
                self._try_first_frame(frames)
            if self._stopped or not self._send(frames):
                return
            for port in self._ports:
                if port.asks:
                    self._ask(port)
            if self._sync_held:
                self._sync_held = False
                self._send_sync()
        except (BusOff, TransmitQueueFull) as error:
            self._block(error)
            for port in self._ports:
                port.drop_frames()
        if self._events:
            now = self._clock()
            for events in self._events:
                events.look(now)

    def _try_first_frame(self, frames: list[Frame]) -> None:
        """Try the first frame of this cycle once and remove it from ``frames``; once it is accepted, the others follow as usual.

        Raises:
            TransmitQueueFull: it is refused.
        """
        if frames:
            self._channel.send(*frames[0], 0.0)
            del frames[0]
        elif self._sync_cob_id is not None:
            self._send_sync(0.0)
            self._sync_held = False
        elif self._heartbeat_id is not None:
            self._channel.send(self._heartbeat_id, _OUR_STATE, 0.0)
        self._blocked = False
        self._channel.unblock()

    def _block(self, error: BusOff | TransmitQueueFull) -> None:
        self._sync_held = False
        if isinstance(error, TransmitQueueFull):
            self._blocked = True
            self._channel.block(error)

    def _send(self, frames: list[Frame]) -> bool:
        """Send the frames in this order; return False if all axes were stopped meanwhile."""
        for can_id, data in frames[self._channel.send_all(frames) :]:
            if self._stopped:  # while the frame before was stuck: this frame may enable the drive again
                return False
            self._channel.send(can_id, data)
        return not self._stopped

    def _ask(self, port: CycleSender) -> None:
        """Request the TPDOs that are sent only on request."""
        for can_id, length in port.take_requests(self._clock()):
            self._channel.send_remote(can_id, length)

    def sync(self) -> None:
        """Send SYNC if the master is its producer (CiA 301 7.2.5), with the counter if the bus has one: 1, 2, ... and 1 again.

        Raises:
            BusError: as ``commit``.
        """
        if self._sync_cob_id is not None:
            if self._blocked:
                self._sync_held = True
                return
            try:
                self._send_sync()
            except (BusOff, TransmitQueueFull) as error:
                self._block(error)

    def _send_sync(self, patience: float = SEND_PATIENCE) -> None:
        count, data = 0, b""
        if self._sync_counter:
            count = self._count % self._sync_counter + 1
            data = self._sync_data(count)
        now = self._clock()
        self._channel.send(self._sync_cob_id, data, patience)  # type: ignore[arg-type]  # the callers have checked this
        self._channel.syncs.note(now)
        self._count = count

    def heartbeat(self) -> None:
        """Send the master's heartbeat, guarding requests and TIME when they are due (CiA 301 7.2.8.3.2, 7.2.6).

        Raises:
            BusError: as ``commit``.
        """
        now = self._clock()
        if self._guarding or self._time_producer is not None or now >= self._heartbeat_due:
            if self._blocked:
                return
            try:
                self._send_due(now)
            except (BusOff, TransmitQueueFull) as error:
                self._block(error)

    def _send_due(self, now: float) -> None:
        if self._guarding:
            self._guard(now)
        if self._time_producer is not None:
            self._time_producer.step(self._clock())
        now = self._clock()
        if self._heartbeat_id is not None and now >= self._heartbeat_due:
            due = self._heartbeat_due + self._heartbeat_period
            self._heartbeat_due = due if due > now else now + self._heartbeat_period
            self._channel.send(self._heartbeat_id, _OUR_STATE)
            if self._boot_heartbeat is not None:
                self._boot_heartbeat.end()
                self._boot_heartbeat = None

    def _guard(self, now: float) -> None:
        for node, period in self._guarding.items():
            if now >= self._guarding_due[node]:
                self._guarding_due[node] = now + period
                node.ask(now)

    def quick_stop_all(self) -> bool:
        """Send a quick stop to every axis that was ever commanded: by RPDO, one SYNC, then by SDO without waiting for an answer.

        Return whether the adapter accepted all frames. Never raises; returns within about half a second even if the adapter is
        stuck. Ends a running ``commit``.
        """
        self._stopped = True
        frames, complete = self._quick_stop_frames()
        if not frames:
            return complete
        taken = send_bounded(self._channel, frames)
        return complete and taken == len(frames)

    @property
    def has_stopped(self) -> bool:
        """Whether ``quick_stop_all`` was called, so that a cycle sends nothing."""
        return self._stopped

    def resume(self) -> None:
        """Send frames again after ``quick_stop_all``, because the adapter was opened again; the scan must not run yet."""
        self._stopped = self._blocked = self._sync_held = False
        for port in self._ports:
            port.begin_again()

    def keep_stopping(self) -> AbstractContextManager[None]:
        """Repeat the quick stops by RPDO, and SYNC, in a thread until the context ends; raises nothing."""
        by_pdo, _, _ = self._stop_frames()
        frames = [*by_pdo, *self._sync_frame(bool(by_pdo))]
        return repeating_frames(self._channel, frames)

    def close(self) -> None:
        """Close the ports, and the channel if this object owns it; harmless when repeated."""
        for port in self._ports:
            port.close()
        if self._owns_channel:
            self._channel.close()

    def _quick_stop_frames(self) -> tuple[list[Frame], bool]:
        """Return the frames, and whether they are those of every port."""
        by_pdo, by_sdo, complete = self._stop_frames()
        return [*by_pdo, *self._sync_frame(bool(by_pdo)), *by_sdo], complete

    def _stop_frames(self) -> tuple[list[Frame], list[Frame], bool]:
        by_pdo: list[Frame] = []
        by_sdo: list[Frame] = []
        complete = True
        for port in self._ports:
            try:
                pdo, sdo = port.stop_frames()
            except Exception as error:  # noqa: BLE001 - no error may keep the other axes from being stopped
                complete = False
                self._channel.counters.errors.append(f"stop frames of node {port.node.node_id}: {error}")
            else:
                by_pdo += pdo
                by_sdo += sdo
        return by_pdo, by_sdo, complete

    def _sync_frame(self, needed: bool) -> Iterable[Frame]:
        """Return one more SYNC, so that synchronous RPDOs take effect; none if another device is the producer."""
        if not needed or self._sync_cob_id is None:
            return ()
        count = self._count % self._sync_counter + 1 if self._sync_counter else 0
        return ((self._sync_cob_id, self._sync_data(count)),)

    def _sync_data(self, count: int) -> bytes:
        return bytes((count,)) if self._sync_counter else b""


def send_bounded(channel: Channel, frames: Sequence[Frame]) -> int:
    """Send stop frames in any state of the channel, and return how many the adapter accepted; raises nothing.

    Returns within about half a second even if the driver blocks: the frames are sent in a thread of their own.
    """
    taken: list[int] = []

    def send() -> None:
        taken.append(channel.send_urgent(frames))

    thread = channel.clock.thread(send, "axisbus quick stop")
    try:
        thread.start()
    except RuntimeError:  # the interpreter is ending and starts no more threads
        send()
    else:
        thread.join(QUICK_STOP_PATIENCE)
    return sum(taken)


@contextmanager
def repeating_frames(
    channel: Channel, frames: Sequence[Frame], period: float = _REPEAT_PERIOD
) -> Iterator[None]:
    """Send ``frames`` every ``period`` seconds in a thread until the context ends; raises nothing.

    A stop by synchronous RPDO takes effect with SYNC, and a single frame may be lost: so both are repeated until the stop is
    confirmed.
    """
    over = channel.clock.event()

    def send() -> None:
        while frames and not over.is_set():
            channel.send_urgent(frames)
            over.wait(period)

    thread = channel.clock.thread(send, "axisbus stop frames")
    try:
        thread.start()
    except RuntimeError:  # the interpreter is ending and starts no more threads
        channel.send_urgent(frames)
        yield
        return
    try:
        yield
    finally:
        over.set()
        thread.join(QUICK_STOP_PATIENCE)


# -- Learn from earlier sleeps how long before a deadline a sleep must end, so that it does not end late ---------------


_MARGIN = 5e-6  # seconds, added to the delay of the sleeps
_MARGIN_FACTOR = 1.15  # factor on that delay
_SAMPLES = 50  # sleeps; the delay in one block is also used for the next one


class SleepMargin:
    """Holds ``early``, the seconds that a sleep must end before its deadline; never above ``most``, its initial value.

    The rest of the time is spent polling the clock, so each surplus microsecond costs a microsecond of a processor in every cycle.
    ``early`` follows the maximum delay of the last fifty to a hundred sleeps, at once if one was later than all of those.
    """

    __slots__ = ("_before", "_count_seen", "_longest", "early", "most")

    def __init__(self, most: float) -> None:
        self.early = self.most = most
        self._before = self._longest = 0.0
        self._count_seen = 0

    def note(self, late: float) -> None:
        """Record that a sleep ended ``late`` seconds after its requested end."""
        if late > self._longest:
            self._longest = late
            self.early = max(self.early, self._needed())
        self._count_seen += 1
        if self._count_seen == _SAMPLES:
            self.early = self._needed()
            self._before, self._longest, self._count_seen = self._longest, 0.0, 0

    def _needed(self) -> float:
        return min(self.most, _MARGIN_FACTOR * max(self._longest, self._before) + _MARGIN)
