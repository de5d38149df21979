"""One open CAN channel: sending with a limited wait, a receive thread whose failure is reported, and the receivers by COB-ID.

Theory of operation
-------------------
One daemon thread reads the received frames and passes each one to the receivers of its COB-ID, with its monotonic time of
reception. Receivers store and return; they never block and never send. The scan itself reads the frames of every cycle by
``drain``, if the adapter can separate them (``cyclic``).

A failure is *stored*: an exception from the adapter or from a receiver sets ``failure`` and calls ``on_failure``. From then on
every ``send`` and ``check`` raises it. So a master that can no longer receive cannot continue to control drives. Stop frames are
the exception: ``send_urgent`` tries in any state and never raises.

Bus-off is not a final failure, because a controller can be restarted. While it is ``off``, ``send`` and ``check`` raise ``BusOff``,
and no frame is passed to the driver. Linux would accept the frames, keep them in the interface's queue, and send them in a burst at
the restart, old set-points among them. (Frames that the queue accepted before the bus-off was reported cannot be withdrawn: some
milliseconds' worth, which only taking the interface down discards.) ``off`` ends when the restart is reported. ``last_bus_off`` and
``bus_off_count`` remain, so that a short bus-off is not missed. ``on_failure`` is called for a bus-off too.

After a failure or a bus-off, ``reopen`` opens the adapter again; receivers remain, and the nodes count as lost as after a bus-off.

If the adapter's queue stays full, only sending has failed. Frames are still received, so ``check`` raises nothing. The scan reports
refused frames by ``block``. ``off`` is that error until ``unblock``, and each port sees it meanwhile.

The send lock is held for one attempt only, never while waiting for a full queue to drain. ``send_urgent`` waits for the lock no
longer than a few milliseconds, because the thread that holds it may be stuck in the driver for ever.
"""

from __future__ import annotations

import copy
import errno
import math
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import can

from axisbus.bus.link import adapter, controller, failures
from axisbus.bus.link.controller import CanController, CanErrorState, ControllerEvent
from axisbus.bus.link.fork_guard import disown_in_children
from axisbus.bus.link.frame_files import of_message
from axisbus.bus.link.network import CanopenNetwork
from axisbus.bus.link.raw_sockets import (
    CyclicSocket,
    FrameTransmitter,
    RawFrameSource,
    cyclic_socket,
    frame_source_of,
    transmitter_of,
)
from axisbus.cia301 import cob
from axisbus.cia301.dropped_frames import DropReason, Drops
from axisbus.cia301.frame import BusTraffic, CanFrame
from axisbus.cia301.sdo_counts import SdoCounts
from axisbus.cia301.sync import SyncTimes
from axisbus.clock import REAL, Clock
from axisbus.errors import AdapterError, BusError, BusOff, StateError, TransmitQueueFull

Receiver = Callable[[bytes, float], None]
Opener = Callable[[], "tuple[can.BusABC | CallingBus, CyclicSocket | None]"]  # opens an adapter again
FrameHandler = Callable[[CanFrame], None]
_T = TypeVar("_T", bytes, int)  # the data of a frame, or the length that a remote frame requests

RECEIVE_SLICE = 0.05  # seconds; the longest that close() waits for the receive thread
SEND_PATIENCE = 0.005  # seconds that a full queue may take to have room again
SEND_PAUSE = 0.0002
URGENT_LOCK = 0.005  # seconds that a stop frame waits for the send lock
URGENT_TOTAL = 0.1  # seconds that all stop frames together may take
CLOSE_PATIENCE = 1.0
STATE_PERIOD = 0.1  # seconds between two polls of the driver's state, if no error frame reports it
# seconds after which a send that has not returned never will; a slow driver takes some milliseconds
STUCK = 1.0
STUCK_SLICE = 0.02  # seconds; a wait that takes much longer shows that this program does not run
STARVED = 10.0  # seconds that the other thread gets if neither thread runs

_DATA = 8  # bytes of a classic frame
_LINK_GONE = frozenset({errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EBADF})


@dataclass(slots=True)
class Counters:
    """Counters of a channel; ``full`` counts attempts refused by a full queue (the frame went out later, or was given up)."""

    sent: int = 0
    received: int = 0
    octets: int = 0  # data bytes in both directions
    full: int = 0
    error_frames: int = 0
    errors: deque[str] = field(default_factory=lambda: deque(maxlen=16))


class CallingBus(FrameTransmitter, Protocol):
    """A bus that passes each received frame to its channel by a call, without a receive thread: a simulated wire."""

    @property
    def state(self) -> can.BusState:
        """The state of its controller."""

    @property
    def calling(self) -> bool:
        """Whether the caller runs within such a call."""

    def attach(self, taker: Channel) -> None:
        """Call ``take_frame``, ``take_message`` and ``take_failure`` of ``taker`` from now on."""

    def shutdown(self) -> None:
        """Release it."""


class Channel:
    """One CAN channel; holds state: the adapter, the receive thread, the receivers by COB-ID, the counters and the failure.

    All methods may be called from any thread, unless stated otherwise.
    """

    def __init__(
        self,
        bus: can.BusABC | CallingBus,
        name: str,
        *,
        send_timeout: float | None = None,
        cyclic: CyclicSocket | None = None,
        clock: Clock = REAL,
        opener: Opener | None = None,
    ) -> None:
        """Take over an open python-can bus and start to receive.

        ``send_timeout``: see ``adapter.send_timeout``; ``cyclic``: the source of the frames for ``drain``; ``clock``: the time of
        this channel and of everything that waits for its frames. ``opener`` opens the adapter again, for ``reopen``.
        """
        self.bus = bus
        self.clock = clock
        self.name = name
        self.counters = Counters()
        self.drops = Drops(threading.Lock())
        self.sdo_counts = SdoCounts(threading.Lock())
        self.syncs = SyncTimes()
        self.on_failure: list[Callable[[BusError], None]] = []
        self._failure: BusError | None = None
        self._receivers: dict[int, tuple[Receiver, ...]] = {}
        self._frame_handlers: tuple[FrameHandler, ...] = ()
        self._taps: tuple[FrameHandler, ...] = ()
        self._send_timeout = send_timeout
        self._opener = opener
        self._cyclic = cyclic
        self._cyclic_ids: frozenset[int] = frozenset()
        self._socketcan = name.startswith("socketcan:")
        self._linux_classes = (
            not isinstance(bus, can.BusABC) or name.partition(":")[0] in controller.LINUX_CLASSES
        )
        self.controller = CanController(name)
        self.last_bus_off: BusOff | None = None
        self.bus_off_count = 0
        # Why nothing is sent now: the controller is bus-off, or refuses the frames of the scan.
        self.off: BusOff | TransmitQueueFull | None = None
        self._state_due = 0.0
        self._send_lock = threading.Lock()
        self._state_lock = threading.Lock()
        self._closing = False
        self._inherited = False  # by a forked child
        self.network = CanopenNetwork(self)
        # For simulated drives: returns whether they have not yet received all sent frames.
        self.behind: Callable[[], bool] | None = None
        self._thread: threading.Thread | None = None
        self._source: RawFrameSource | None = None
        self._attach(bus)
        disown_in_children(self)

    def _attach(self, bus: can.BusABC | CallingBus) -> None:
        """Send by ``bus`` from now on, and begin to receive."""
        self.bus = bus
        self.network.bus = bus  # type: ignore[assignment]  # or a simulated wire
        self._calling = None if isinstance(bus, can.BusABC) else bus
        self._transmitter: FrameTransmitter = (
            transmitter_of(bus, self._send_timeout) if isinstance(bus, can.BusABC) else bus
        )
        self._thread_safe = self._transmitter.thread_safe  # without a lock
        if not isinstance(bus, can.BusABC):
            bus.attach(self)
            return
        self._source = frame_source_of(bus)
        self._thread = threading.Thread(
            target=self._receive, args=(self._source,), name=f"axisbus receive {self.name}", daemon=True
        )
        self._thread.start()

    @classmethod
    def open(
        cls,
        interface: str,
        channel: str | int | None,
        bitrate: int | None = None,
        **options: object,
    ) -> Channel:
        """Open an adapter by python-can's interface name; may block as long as its driver does.

        ``bitrate`` is in bit/s; for SocketCAN it is only compared with that of the link. ``options`` are passed to the adapter.

        Raises:
            AdapterError: see ``adapter.open_adapter``.
        """

        def opener() -> tuple[can.BusABC, CyclicSocket | None]:
            bus = adapter.open_adapter(interface, channel, bitrate, options)
            return bus, cyclic_socket(bus, str(channel))

        bus, cyclic = opener()
        timeout = adapter.send_timeout(interface)
        return cls(bus, f"{interface}:{channel}", send_timeout=timeout, cyclic=cyclic, opener=opener)

    @property
    def failure(self) -> BusError | None:
        """The error that made this channel unusable, None while it works."""
        return self._failure

    @property
    def carried(self) -> BusTraffic:
        """The traffic so far, sent and received; with simultaneous sending and receiving a frame may be missing from the count."""
        counters = self.counters
        return BusTraffic(self.clock.now(), counters.sent + counters.received, counters.octets)

    @property
    def in_receive_thread(self) -> bool:
        """Whether the caller runs in the receive thread, or is called by the bus instead, and must not wait for a frame."""
        if self._calling is not None:
            return self._calling.calling
        return threading.current_thread() is self._thread

    def check(self) -> None:
        """Raise the failure, if there is one.

        Raises:
            BusOff: the controller is bus-off now.
            BusError: the channel failed or is closed.
        """
        failure = self._failure
        if failure is not None:
            # A copy each time: an error that is raised repeatedly would collect tracebacks.
            raise copy.copy(failure) from failure
        if self._closing:
            raise AdapterError(f"the CAN channel {self.name} is closed")
        off = self.off
        if isinstance(off, BusOff):
            raise copy.copy(off) from off

    def subscribe(self, can_id: int, receiver: Receiver) -> None:
        """Call ``receiver(data, stamp)`` in the receive thread for each frame of this COB-ID; the receiver must not block.

        ``stamp`` is the time of the clock at reception.
        """
        with self._state_lock:
            receivers = dict(self._receivers)
            receivers[can_id] = (*receivers.get(can_id, ()), receiver)
            self._receivers = receivers

    def unsubscribe(self, can_id: int, receiver: Receiver) -> None:
        """End a subscription; harmless if there is none."""
        with self._state_lock:
            receivers = dict(self._receivers)
            left = tuple(other for other in receivers.get(can_id, ()) if other != receiver)
            receivers[can_id] = left
            if not left:
                del receivers[can_id]
            self._receivers = receivers
            if not left and can_id in self._cyclic_ids:
                self._listen_cyclic(self._cyclic_ids - {can_id})

    def subscribe_cyclic(self, can_id: int, receiver: Receiver) -> None:
        """As ``subscribe``, for frames of every cycle: if the adapter can separate them, ``drain`` reads them."""
        self.subscribe(can_id, receiver)
        if can_id <= cob.ID_MASK_11:
            with self._state_lock:
                self._listen_cyclic(self._cyclic_ids | {can_id})

    def drain(self) -> None:
        """Pass the received frames of ``subscribe_cyclic`` to their receivers, in the calling thread; does not block.

        Does nothing if the receive thread reads these frames. The next ``check`` raises any error.
        """
        if not self._cyclic_ids or self._cyclic is None:
            return
        try:
            counters, receivers = self.counters, self._receivers
            taken = self._cyclic.drain()
            counters.received += len(taken)
            counters.octets += sum([len(data) for _, data, _ in taken])
            for can_id, data, stamp in taken:
                if self._frame_handlers or self._taps:
                    self._notify_handlers(CanFrame(stamp, can_id, data))
                for receiver in receivers.get(can_id, ()):
                    try:
                        receiver(data, stamp)
                    except Exception as error:  # noqa: BLE001 - as ``_hand_over``, without a call more for each frame
                        self.fail(failures.receiver_failed(can_id, data, error))
        except OSError as error:
            if not self._closing:
                self.fail(failures.receive_failed(self.name, error))

    def _listen_cyclic(self, can_ids: frozenset[int]) -> None:
        if self._cyclic is not None and self._cyclic.listen(can_ids):
            self._cyclic_ids = can_ids

    @contextmanager
    def frames_to(self, handler: FrameHandler) -> Iterator[None]:
        """Call ``handler(frame)`` in the receive thread for every received frame, remote frames included, within the block.

        ``handler`` must not block. The frame's time is that of the clock at reception. Error frames go to ``controller``.
        """
        with self._state_lock:
            self._frame_handlers = (*self._frame_handlers, handler)
        try:
            yield
        finally:
            with self._state_lock:
                self._frame_handlers = tuple(other for other in self._frame_handlers if other is not handler)

    def tap(self, handler: FrameHandler) -> None:
        """Call ``handler(frame)`` for every frame, also sent ones, in the thread that handles it; ``handler`` must not block."""
        with self._state_lock:
            self._taps = (*self._taps, handler)

    def untap(self, handler: FrameHandler) -> None:
        """End the calls of ``tap``; harmless if they have ended."""
        with self._state_lock:
            self._taps = tuple(other for other in self._taps if other != handler)

    def send(self, can_id: int, data: bytes, patience: float = SEND_PATIENCE) -> None:
        """Send a data frame; blocks up to ``patience`` seconds while the adapter's queue is full.

        Raises:
            BusOff: the controller is bus-off; the frame was not queued.
            AdapterError: the queue stayed full, or the adapter failed (also if another frame has been stuck in it for a second).
        """
        if not self._thread_safe or self._failure is not None or self._closing or self.off is not None:
            self._send_paced(self._transmitter.send, can_id, data, patience)
            return
        try:
            self._transmitter.send(can_id, data)
        except can.CanError as error:
            self._insist(self._transmitter.send, can_id, data, patience, error)
        counters = self.counters
        counters.sent += 1
        counters.octets += len(data)
        if self._taps:
            self._notify_taps(can_id, data)

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> int:
        """Send data frames with as few calls as possible, without waiting; return how many were accepted. For the scan's thread.

        Send the remaining frames by ``send``, which waits for a full queue and reports the reason.

        Raises:
            BusOff: the controller is bus-off; no frame was queued.
            AdapterError: the channel has failed.
        """
        self.check()
        taken = self._transmitter.send_all(frames)
        counters = self.counters
        counters.sent += taken
        counters.octets += sum([len(data) for _, data in frames[:taken]])
        if self._taps:
            for can_id, data in frames[:taken]:
                self._notify_taps(can_id, data)
        return taken

    def send_remote(self, can_id: int, length: int = 0) -> None:
        """Send a remote frame (for node guarding) with the data length of the requested frame.

        Raises:
            AdapterError: as ``send``.
        """
        self._send_paced(self._transmitter.send_remote, can_id, length, SEND_PATIENCE)

    def send_urgent(self, frames: Iterable[tuple[int, bytes]]) -> int:
        """Send stop frames in any state of the channel; return how many the adapter accepted. Never raises.

        If the queue is full, the frames wait together for about 0.1 s and keep their order; then each is tried once more
        separately. Another failure of one frame does not stop the others. Takes longer only if the driver itself blocks.
        """
        if self._inherited:
            return 0
        deadline = self.clock.now() + URGENT_TOTAL
        locked = self._send_lock.acquire(timeout=URGENT_LOCK)
        try:
            left = list(frames)
            count = len(left)
            while (left := self._try_urgent(left)) and self.clock.now() < deadline:
                self.clock.sleep(SEND_PAUSE)
            return count - len(self._try_urgent(left, in_order=False))
        finally:
            if locked:
                self._send_lock.release()

    def block(self, error: TransmitQueueFull) -> None:
        """Set ``off``: the adapter refuses the scan's frames, until ``unblock`` or a bus-off."""
        with self._state_lock:
            if self.off is None:
                self.off = error

    def unblock(self) -> None:
        """Clear ``off``: the adapter accepts the scan's frames again."""
        with self._state_lock:
            if isinstance(self.off, TransmitQueueFull):
                self.off = None

    def health(self) -> str:
        """Return one line on error frames and controller state, to add to an error about a missing answer; may be empty."""
        counters, condition = self.counters, self.controller.condition
        now = "" if condition is CanErrorState.ACTIVE else f"the CAN controller is {condition.value}"
        if not counters.error_frames:
            return now
        last = counters.errors[-1] if counters.errors else ""
        return f"{counters.error_frames} error frames on {self.name}" + "".join(
            f", {text}" for text in (f"the last: {last}" if last else "", now) if text
        )

    def close(self) -> None:
        """Stop receiving and release the adapter; harmless when repeated; blocks about 50 ms, at most about 1 s."""
        with self._state_lock:
            first, self._closing = not self._closing, True
        if not first:
            return
        self._release()

    def _release(self) -> None:
        """End the receive thread, and release the adapter."""
        self._source = None
        if self._thread is not None and not self.in_receive_thread:
            self._thread.join(CLOSE_PATIENCE)
        if self._cyclic is not None:
            self._cyclic.close()
        try:
            self.bus.shutdown()
        except Exception as error:  # noqa: BLE001 - drivers raise anything; the adapter is gone either way
            self.counters.errors.append(f"on closing: {error}")

    def require_reopenable(self) -> None:
        """Check that the adapter has failed or is bus-off, and that it can be opened again.

        Raises:
            StateError: it works, belongs to another process, or there is no way to open it again.
        """
        if self._opener is None or self._inherited or self._closing:
            raise failures.not_reopened(self.name, "it was not opened by its name, or it is closed")
        if self._failure is None and not isinstance(self.off, BusOff):
            raise failures.not_reopened(self.name, "it works")

    def reopen(self) -> None:
        """Open the adapter again after a failure or a bus-off; may block as long as its driver does.

        Receivers, taps and counters remain. ``bus_off_count`` counts it, so that every node counts as lost until it is heard again.
        No other thread may read cyclic frames (``drain``) meanwhile.

        Raises:
            StateError: as ``require_reopenable``.
            AdapterError: it cannot be opened; the channel has failed, and this may be called again.
        """
        self.require_reopenable()
        assert self._opener is not None
        if self._failure is None:
            self.fail(copy.copy(self.off) if isinstance(self.off, BusOff) else failures.reopened(self.name))
        self._release()
        bus, cyclic = self._opener()
        self._send_lock = threading.Lock()  # a thread may be stuck in the driver with the one before
        self._state_due = 0.0
        cyclic_ids, self._cyclic_ids = self._cyclic_ids, frozenset()
        self._cyclic = cyclic
        self.controller.reopened(self.clock.now())
        self.last_bus_off = failures.reopened(self.name)
        self.bus_off_count += 1
        self.off = self._failure = None
        self._attach(bus)
        with self._state_lock:
            self._listen_cyclic(cyclic_ids)

    def disown(self) -> None:
        """Become unusable in a forked child: it sends nothing, and the parent closes the adapter."""
        self._closing = self._inherited = True
        self._send_lock, self._state_lock = threading.Lock(), threading.Lock()
        self._failure = failures.inherited(self.name)
        if isinstance(self.bus, can.BusABC):
            self.bus._is_shutdown = True  # else python-can would shut the adapter down when the child ends

    def __enter__(self) -> Channel:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- sending ------------------------------------------------------------------------------------------------------------------

    def _send_paced(
        self, send_one: Callable[[int, _T], None], can_id: int, what: _T, patience: float
    ) -> None:
        if self._failure is not None or self._closing or self.off is not None:
            self.check()
        error = self._attempt(send_one, can_id, what)
        if error is not None:  # seldom
            self._insist(send_one, can_id, what, patience, error)
        self.counters.sent += 1
        if isinstance(what, bytes):
            self.counters.octets += len(what)
        if self._taps:
            self._notify_taps(can_id, what)

    def _notify_taps(self, can_id: int, what: bytes | int) -> None:
        """Pass a sent frame to the taps; a number: a remote frame."""
        data = what if isinstance(what, bytes) else b""
        extended, remote = can_id > cob.ID_MASK_11, data is not what
        self._notify_all(self._taps, CanFrame(self.clock.now(), can_id, data, extended, remote))

    def _insist(
        self,
        send_one: Callable[[int, _T], None],
        can_id: int,
        what: _T,
        patience: float,
        error: Exception | None,
    ) -> None:
        """Repeat a send that failed with ``error`` until the adapter accepts the frame."""
        deadline = math.inf
        while error is not None:
            if self._is_final(error):
                self.fail(failures.link_gone(self.name, error))
                self.check()
            self.counters.full += 1
            now = self.clock.now()
            deadline = min(deadline, now + patience)
            if now >= deadline:
                raise failures.refused(self.name, can_id, patience, error) from error
            self.clock.sleep(SEND_PAUSE)
            self.check()
            error = self._attempt(send_one, can_id, what)

    def _attempt(self, send_one: Callable[[int, _T], None], can_id: int, what: _T) -> Exception | None:
        if not self._send_lock.acquire(blocking=False):
            self._acquire_send_lock()
        try:
            send_one(can_id, what)
        except Exception as error:  # noqa: BLE001 - drivers raise anything; the caller decides
            return error
        finally:
            self._send_lock.release()
        return None

    def _acquire_send_lock(self) -> None:
        """Wait for another thread's send.

        If it does not return, the time that this thread ran shows whether the driver is stuck.
        """
        began = before = self.clock.now()
        ran = 0.0
        while not self._send_lock.acquire(timeout=STUCK_SLICE):
            now = self.clock.now()
            ran += min(now - before, 2 * STUCK_SLICE)
            before = now
            if ran >= STUCK or now - began >= STARVED:
                self.fail(
                    failures.stuck(self.name, STUCK)
                    if ran >= STUCK
                    else failures.starved(self.name, now - began)
                )
                self.check()

    def _is_final(self, error: Exception) -> bool:
        """Whether no later attempt can succeed; only SocketCAN's error codes are those of the operating system."""
        code = getattr(error, "error_code", None)
        if not isinstance(error, can.CanError):
            return not failures.is_full(error)
        return self._socketcan and code in _LINK_GONE

    def _try_urgent(
        self, frames: Sequence[tuple[int, bytes]], *, in_order: bool = True
    ) -> list[tuple[int, bytes]]:
        """Try each frame once, and return those not accepted; ``in_order``: try no frame after one that found the queue full."""
        left: list[tuple[int, bytes]] = []
        for number, (can_id, data) in enumerate(frames):
            try:
                self._transmitter.send(can_id, data)
            except Exception as error:  # noqa: BLE001 - no error may keep the next stop frame from being tried
                if in_order and failures.is_full(error):
                    return [*left, *frames[number:]]
                self.counters.errors.append(f"stop frame {can_id:03X}h: {error}")
                left.append((can_id, data))
            else:
                self.counters.sent += 1
                self.counters.octets += len(data)
                if self._taps:
                    self._notify_taps(can_id, data)
        return left

    # -- receiving ----------------------------------------------------------------------------------------------------------------

    def take_frame(self, can_id: int, data: bytes) -> None:
        """Take a data frame with an 11-bit identifier from a ``CallingBus``."""
        stamp = self.clock.now()
        receivers = self._receivers.get(can_id)
        if receivers is None or self._frame_handlers or self._taps or can_id in self.network.subscribers:
            self._handle_data_frame(can_id, data, stamp, stamp)
            return
        self.counters.received += 1
        self.counters.octets += len(data)
        for receiver in receivers:
            try:
                receiver(data, stamp)
            except Exception as error:  # noqa: BLE001 - as ``_hand_over``, without a call more for each frame
                self.fail(failures.receiver_failed(can_id, data, error))

    def take_message(self, message: can.Message) -> None:
        """Take any other frame from a ``CallingBus``."""
        self._dispatch(message, self.clock.now())

    def take_failure(self, error: Exception) -> None:
        """Take the failure of a ``CallingBus``, which receives nothing any more."""
        if not self._closing:
            self.fail(failures.receive_failed(self.name, error))

    def _receive(self, source: RawFrameSource) -> None:
        while self._source is source and not self._closing:
            try:
                taken = source.take(RECEIVE_SLICE)
                now = self.clock.now()
                for item in taken:
                    if isinstance(item, tuple):
                        self._handle_data_frame(*item, now)
                    else:
                        self._dispatch(item, now)
                if now >= self._state_due:
                    self._poll_state(now)
            except Exception as error:  # noqa: BLE001 - any error must be stored and not only end this thread
                if self._source is source and not self._closing:
                    self.fail(failures.receive_failed(self.name, error))
                return

    def _poll_state(self, now: float) -> None:
        """Poll the driver for bus-off; a driver that raises is not polled again."""
        self._state_due = now + STATE_PERIOD
        try:
            off = self.bus.state is can.BusState.ERROR
        except Exception as error:  # noqa: BLE001 - drivers raise anything; receiving still works, which is essential
            self._state_due = math.inf
            self.counters.errors.append(f"on asking for the state: {error}")
            return
        self._follow(self.controller.state(off, now))

    def _dispatch(self, message: can.Message, stamp: float) -> None:
        if message.is_error_frame:
            self._error_frame(message, stamp)
            return
        if self._frame_handlers or self._taps:
            self._pass_to_handlers(message, stamp)
        can_id, unfit = message.arbitration_id, _unfit(message)
        if unfit is None:
            self._handle_frame(can_id, bytes(message.data), message.timestamp, stamp)
        elif can_id in self._receivers:
            self.drops.frame(unfit, can_id, stamp, bytes(message.data))

    def _handle_data_frame(self, can_id: int, data: bytes, came: float, stamp: float) -> None:
        """Handle a data frame with an 11-bit identifier; ``came``: the adapter's own time."""
        if self._frame_handlers or self._taps:
            self._notify_handlers(CanFrame(stamp, can_id, data))
        self._handle_frame(can_id, data, came, stamp)

    def _handle_frame(self, can_id: int, data: bytes, came: float, stamp: float) -> None:
        self.counters.received += 1
        self.counters.octets += len(data)
        has_receiver = self._distribute(can_id, data, stamp)
        if can_id in self.network.subscribers:
            self._hand_over(
                lambda data, _: self.network.notify(can_id, bytearray(data), came), can_id, data, stamp
            )
        elif not has_receiver:
            self.drops.unreceived(can_id, stamp, data)

    def _distribute(self, can_id: int, data: bytes, stamp: float) -> bool:
        """Pass a data frame to its receivers; return whether it has any."""
        receivers = self._receivers.get(can_id, ())
        for receiver in receivers:
            self._hand_over(receiver, can_id, data, stamp)
        return bool(receivers)

    def _pass_to_handlers(self, message: can.Message, stamp: float) -> None:
        self._notify_handlers(of_message(message)._replace(time=stamp))

    def _notify_handlers(self, frame: CanFrame) -> None:
        self._notify_all((*self._frame_handlers, *self._taps), frame)

    def _notify_all(self, handlers: tuple[FrameHandler, ...], frame: CanFrame) -> None:
        for handler in handlers:
            try:
                handler(frame)
            except Exception as error:  # noqa: BLE001 - as ``_hand_over``
                self.fail(failures.receiver_failed(frame.can_id, frame.data, error))

    def _hand_over(self, receiver: Receiver, can_id: int, data: bytes, stamp: float) -> None:
        try:
            receiver(data, stamp)
        except Exception as error:  # noqa: BLE001 - stored with its traceback and raised by every later call
            self.fail(failures.receiver_failed(can_id, data, error))

    def _error_frame(self, message: can.Message, stamp: float) -> None:
        self.counters.error_frames += 1
        error_class = message.arbitration_id if self._linux_classes else 0
        data = bytes(message.data)
        self.counters.errors.append(controller.describe(error_class, data))
        self._follow(self.controller.error_frame(error_class, data, stamp))
        if self._state_due < math.inf:  # if only the driver's state reports bus-off, poll it now
            self._state_due = stamp

    def _follow(self, event: ControllerEvent | None) -> None:
        """Stop sending at a bus-off, and allow it again after a restart."""
        if event is None:
            return
        if (event.condition is CanErrorState.OFF or event.restarted) and not isinstance(self.off, BusOff):
            self.off = self.last_bus_off = failures.bus_off(self.name, event.counters)
            self.bus_off_count += 1
            self._report_failure(self.off)
        if event.condition is not CanErrorState.OFF and isinstance(self.off, BusOff):
            self.off = None

    def fail(self, error: BusError) -> None:
        """Make the channel unusable because of ``error``.

        Also for other threads of this package, so that their errors are noticed.
        """
        with self._state_lock:
            if self._failure is not None:
                return
            self._failure = error
        self._report_failure(error)

    def _report_failure(self, error: BusError) -> None:
        for callback in tuple(self.on_failure):
            try:
                callback(error)
            except Exception as trouble:  # noqa: BLE001 - the failure itself must be reported to all
                self.counters.errors.append(f"on reporting a failure: {trouble}")


def require_other_thread(channel: Channel, what: str) -> None:
    """Check that the caller may wait for a frame.

    Raises:
        StateError: it runs in the receive thread, which would wait for itself.
    """
    if channel.in_receive_thread:
        raise StateError(
            f"{what} was called in the receive thread of {channel.name}, which must receive the answer",
            remedy="store the received data in the receiver, and call this from another thread",
        )


def _unfit(message: can.Message) -> DropReason | None:
    """Return why a frame is not a CANopen data frame, whatever its identifier; None if it is one."""
    if message.is_remote_frame:
        return DropReason.REMOTE
    if message.is_fd or len(message.data) > _DATA:
        return DropReason.FD
    if message.is_extended_id and message.arbitration_id <= cob.ID_MASK_11:
        return DropReason.EXTENDED
    return None
