"""Stand-ins in real time on a CAN bus, by default python-can's virtual one: one network and one timer thread for all.

Theory of operation
-------------------
The timer thread steps every device about each ``period`` seconds of the monotonic clock and sends what is due; between two steps it
wakes for SDO answers whose time has come, so that a delay of 2 ms is one of 2 ms. The receive thread
of ``canopen`` hands frames to the slaves and sends their answers. One lock keeps the two apart; nothing sleeps under it. When the
process was held up for longer than ``_CATCH_UP``, the plants stand still for the rest instead of catching up in one jump.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Protocol

import can
import canopen

from axisbus.errors import AdapterError
from axisbus.sim.device import Device
from axisbus.sim.node.node import StandInNode

_CATCH_UP = 0.1  # s


class Guest(Protocol):
    """A stand-in beside the CANopen ones, of another protocol: frames in, frames out. Times are seconds of a steady clock."""

    @property
    def node_id(self) -> int:
        """Two with the same one do not hear each other: on a wire their frames would collide."""

    @property
    def next_answer(self) -> float | None:
        """When an answer that waits is due."""

    def on_frame(self, can_id: int, data: bytes, now: float, *, remote: bool = False) -> None:
        """Take a frame of 11 bits; whatever it is, nothing is raised."""

    def step(self, now: float) -> None:
        """Let time pass."""

    def serve(self, now: float) -> None:
        """Answer what is due."""

    def take_frames(self) -> list[tuple[int, bytes]]:
        """Return what is to be sent; identifiers above 7FFh have 29 bits."""


class _Listener(can.Listener):
    """Hands every frame to the stand-ins."""

    def __init__(self, stand_ins: StandIns) -> None:
        self._stand_ins = stand_ins

    def on_message_received(self, msg: can.Message) -> None:
        if not (msg.is_error_frame or msg.is_extended_id):
            self._stand_ins.receive(msg.arbitration_id, bytes(msg.data), remote=msg.is_remote_frame)

    def stop(self) -> None:
        """Nothing to release."""


class StandIns:
    """Drives that answer on a channel while the ``with`` block runs; holds the thread that moves them.

    Devices, drives and dials may be read and turned from any thread; take ``lock`` where several values must fit together.
    """

    def __init__(
        self,
        channel: str,
        devices: Sequence[Device],
        *,
        interface: str = "virtual",
        bitrate: int | None = None,
        bus: can.BusABC | None = None,
        guests: Sequence[Guest] = (),
        period: float = 0.002,
    ) -> None:
        """Prepare; nothing is opened before ``start`` (or ``with``). ``bitrate`` is for adapters that want one.

        ``bus``: one that is open already. ``guests``: stand-ins of other protocols, which hear the devices, and they them.
        ``period`` is the step of the timer thread in s (1 to 5 ms are sensible).
        """
        self.lock = threading.RLock()
        self.devices = list(devices)
        self.nodes = [StandInNode(device, self.lock) for device in self.devices]
        self.guests = list(guests)
        self.network = canopen.Network(bus)
        self._options: dict[str, str | int] = {"interface": interface, "channel": channel}
        if bitrate is not None:
            self._options["bitrate"] = bitrate
        self._period = period
        self._stop = False
        self._wake = threading.Event()
        self._alarm = 0.0  # when the timer thread means to wake, by the monotonic clock
        self._thread = threading.Thread(target=self._run, name=f"stand-ins on {channel}", daemon=True)
        self._lost = 0.0
        self._last = 0.0
        self._error: Exception | None = None

    def __enter__(self) -> StandIns:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._shut()
        if error is None:
            self._raise_error()

    def start(self) -> None:
        """Open the channel and power all nodes on; returns at once, boot-up messages follow.

        Raises:
            AdapterError: the channel cannot be opened.
        """
        for node in self.nodes:
            self.network.add_node(node)
        self.network.NOTIFIER_CYCLE = 0.05
        self.network.listeners.append(_Listener(self))  # type: ignore[arg-type]  # any listener will do
        try:
            self.network.connect(**self._options)
        except (can.CanError, OSError, ValueError) as error:
            raise AdapterError(
                f"the stand-ins' channel {self._options['channel']!r} cannot be opened",
                observed=str(error),
                remedy="check interface and channel",
            ) from error
        self._last = time.monotonic()
        self._thread.start()

    def close(self) -> None:
        """Stop the drives' time and leave the bus; blocks for up to a second.

        Raises:
            AdapterError: sending had failed meanwhile.
        """
        self._shut()
        self._raise_error()

    def behind(self) -> bool:
        """Return whether the drives have not yet taken all that was sent to them, or are late in what they do by themselves."""
        waiting = getattr(self.network.bus, "queue", None)  # that of python-can's virtual bus
        overdue = time.monotonic() - self._alarm > self._period
        return overdue or (waiting is not None and not waiting.empty())

    def receive(self, can_id: int, data: bytes, *, remote: bool = False) -> None:
        """Take a frame from the bus (the receive thread calls this)."""
        try:
            with self.lock:
                now = self._now()
                for node in self.nodes:
                    if node.slave.listens_to(can_id):
                        node.slave.on_frame(can_id, data, now, remote=remote)
                for guest in self.guests:
                    guest.on_frame(can_id, data, now, remote=remote)
                self._send()
                if self._next_answer() < self._alarm:
                    self._wake.set()
        except Exception as error:  # noqa: BLE001 - a thread has nobody to raise to: close() hands it on
            self._fail(error)

    def _run(self) -> None:
        due = time.monotonic()
        try:
            while not self._stop:
                with self.lock:
                    stepping = time.monotonic() >= due
                    if stepping:
                        due = max(due + self._period, time.monotonic())
                    self._advance(stepping)
                    self._alarm = min(due, self._next_answer())
                self._wake.wait(max(0.0, self._alarm - time.monotonic()))
                self._wake.clear()
        except Exception as error:  # noqa: BLE001 - as in receive
            self._fail(error)

    def _advance(self, stepping: bool) -> None:
        """Step all devices, or only answer what is due."""
        now = self._now()
        for node in self.nodes:
            if stepping:
                node.slave.step(now)
            else:
                node.slave.serve(now)
        for guest in self.guests:
            if stepping:
                guest.step(now)
            else:
                guest.serve(now)
        self._send()

    def _next_answer(self) -> float:
        """Return when the next SDO answer is due, by the monotonic clock."""
        due = [node.slave.next_answer for node in self.nodes] + [guest.next_answer for guest in self.guests]
        return min((time for time in due if time is not None), default=math.inf) + self._lost

    def _now(self) -> float:
        """Return the plants' time: the monotonic clock without what was lost."""
        now = time.monotonic()
        late = now - self._last - _CATCH_UP
        if late > 0.0:
            self._lost += late
        self._last = now
        return now - self._lost

    def _send(self) -> None:
        for node in self.nodes:
            for can_id, data in node.slave.take_frames():
                self.network.send_message(can_id, data)
                if node.slave.sync.produces and can_id == node.slave.sync.cob_id:
                    self._hand_over_sync(node, can_id, data)
                for guest in self.guests:
                    guest.on_frame(can_id, data, self._now())
        for guest in self.guests:
            for can_id, data in guest.take_frames():
                self.network.send_message(can_id, data)
                self._hand_over(guest, can_id, data)

    def _hand_over(self, sender: Guest, can_id: int, data: bytes) -> None:
        """What a guest sends reaches its neighbours, whose answers go with what they send next."""
        now = self._now()
        for node in self.nodes:
            if node.slave.listens_to(can_id):
                node.slave.on_frame(can_id, data, now)
        for guest in self.guests:
            if guest.node_id != sender.node_id:
                guest.on_frame(can_id, data, now)

    def _hand_over_sync(self, producer: StandInNode, can_id: int, data: bytes) -> None:
        """A stand-in's SYNC reaches its neighbours on this channel, which the adapter does not give back to us."""
        for node in self.nodes:
            if node is not producer and node.slave.sync.cob_id == can_id:
                node.slave.on_frame(can_id, data, self._now())
                for answer, values in node.slave.take_frames():
                    self.network.send_message(answer, values)

    def _fail(self, error: Exception) -> None:
        self._error = self._error or error
        self._stop = True
        self._wake.set()

    def _shut(self) -> None:
        self._stop = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)
        self.network.disconnect()

    def _raise_error(self) -> None:
        if self._error is not None:
            raise AdapterError(
                "the stand-ins stopped before their time",
                observed=f"{type(self._error).__name__}: {self._error}",
                remedy="see the cause below; on a virtual bus it is a defect of the stand-in",
            ) from self._error
