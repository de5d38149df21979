"""Simulated nodes in real time on a CAN bus, by default python-can's virtual bus: one network and one timer thread for all.

Theory of operation
-------------------
The timer thread steps every device about each ``period`` seconds of the monotonic clock and sends the frames that are due. Between
two steps it wakes for each SDO answer that is due, so that a configured delay of 2 ms takes 2 ms. The receive thread of ``canopen``
passes frames to the slaves and sends their answers. One lock separates the two threads; neither sleeps while it holds the lock. If
the process was delayed by more than ``_CATCH_UP``, the simulated time does not advance for the excess, instead of jumping.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from threading import RLock
from types import TracebackType
from typing import Protocol

import can
import canopen
from canopen import objectdictionary as od
from canopen.sdo.exceptions import SdoAbortedError

from axisbus.cia301.datatypes import decode
from axisbus.eds.model import Eds, Object, Variable
from axisbus.errors import AdapterError, SdoAbort
from axisbus.sim.device import Device
from axisbus.sim.node.slave import Slave

_CATCH_UP = 0.1  # s


class ForeignNode(Protocol):
    """A simulated node of another protocol on the same bus: frames in, frames out. Times are seconds of a steady clock."""

    @property
    def node_id(self) -> int:
        """Node ID; two guests with the same node ID do not receive each other's frames, which would collide on a real wire."""

    @property
    def next_answer(self) -> float | None:
        """Time at which the next pending answer is due; None if none is pending."""

    def on_frame(self, can_id: int, data: bytes, now: float, *, remote: bool = False) -> None:
        """Take a frame with an 11-bit identifier; never raises."""

    def step(self, now: float) -> None:
        """Advance the simulation to ``now``."""

    def serve(self, now: float) -> None:
        """Send the answers that are due."""

    def take_frames(self) -> list[tuple[int, bytes]]:
        """Return the frames to be sent and clear them; identifiers above 7FFh have 29 bits."""


class _Listener(can.Listener):
    """Passes every frame to the simulated nodes."""

    def __init__(self, simulated_nodes: SimulatedNetwork) -> None:
        self._simulated_nodes = simulated_nodes

    def on_message_received(self, msg: can.Message) -> None:
        if not (msg.is_error_frame or msg.is_extended_id):
            self._simulated_nodes.receive(msg.arbitration_id, bytes(msg.data), remote=msg.is_remote_frame)

    def stop(self) -> None:
        """Nothing to release."""


class SimulatedNetwork:
    """Simulated nodes on a channel while the ``with`` block runs; holds the timer thread.

    Devices, drives and fault settings may be read and changed from any thread; hold ``lock`` if several values must be consistent.
    """

    def __init__(
        self,
        channel: str,
        devices: Sequence[Device],
        *,
        interface: str = "virtual",
        bitrate: int | None = None,
        bus: can.BusABC | None = None,
        foreign_nodes: Sequence[ForeignNode] = (),
        period: float = 0.002,
    ) -> None:
        """Prepare the nodes; the channel is opened by ``start`` (or ``with``). ``bitrate`` is for adapters that need it.

        ``bus``: a bus that is open already. ``foreign_nodes``: simulated nodes of other protocols; they and the devices receive
        each other's frames. ``period`` is the step of the timer thread in s (1 to 5 ms are sensible).
        """
        self.lock = threading.RLock()
        self.devices = list(devices)
        self.nodes = [SimulatedLocalNode(device, self.lock) for device in self.devices]
        self.foreign_nodes = list(foreign_nodes)
        self.network = canopen.Network(bus)
        self._options: dict[str, str | int] = {"interface": interface, "channel": channel}
        if bitrate is not None:
            self._options["bitrate"] = bitrate
        self._period = period
        self._stop = False
        self._wake = threading.Event()
        self._next_wake = 0.0  # time at which the timer thread wakes, by the monotonic clock
        self._thread = threading.Thread(target=self._run, name=f"simulated drives on {channel}", daemon=True)
        self._lost = 0.0
        self._last = 0.0
        self._error: Exception | None = None

    def __enter__(self) -> SimulatedNetwork:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._shut()
        if error is None:
            self._raise_error()

    def start(self) -> None:
        """Open the channel and power up all nodes; returns at once, the boot-up messages follow.

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
                f"the channel {self._options['channel']!r} of the simulated drives cannot be opened",
                observed=str(error),
                remedy="check interface and channel",
            ) from error
        self._last = time.monotonic()
        self._thread.start()

    def close(self) -> None:
        """Stop the simulation and close the bus; blocks for up to 5 s.

        Raises:
            AdapterError: the simulation had failed before.
        """
        self._shut()
        self._raise_error()

    def behind(self) -> bool:
        """Return whether frames to the nodes are still unread, or the timer thread is late."""
        waiting = getattr(self.network.bus, "queue", None)  # python-can's virtual bus has one
        overdue = time.monotonic() - self._next_wake > self._period
        return overdue or (waiting is not None and not waiting.empty())

    def receive(self, can_id: int, data: bytes, *, remote: bool = False) -> None:
        """Take a frame from the bus (called by the receive thread)."""
        try:
            with self.lock:
                now = self._now()
                for node in self.nodes:
                    if node.slave.listens_to(can_id):
                        node.slave.on_frame(can_id, data, now, remote=remote)
                for foreign_node in self.foreign_nodes:
                    foreign_node.on_frame(can_id, data, now, remote=remote)
                self._send()
                if self._next_answer() < self._next_wake:
                    self._wake.set()
        except Exception as error:  # noqa: BLE001  - a thread has no caller: close() raises it
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
                    self._next_wake = min(due, self._next_answer())
                self._wake.wait(max(0.0, self._next_wake - time.monotonic()))
                self._wake.clear()
        except Exception as error:  # noqa: BLE001 - as in receive
            self._fail(error)

    def _advance(self, stepping: bool) -> None:
        """Step all devices, or only send the answers that are due."""
        now = self._now()
        for node in self.nodes:
            if stepping:
                node.slave.step(now)
            else:
                node.slave.serve(now)
        for foreign_node in self.foreign_nodes:
            if stepping:
                foreign_node.step(now)
            else:
                foreign_node.serve(now)
        self._send()

    def _next_answer(self) -> float:
        """Return the time of the next pending answer, by the monotonic clock."""
        due = [node.slave.next_answer for node in self.nodes] + [
            foreign_node.next_answer for foreign_node in self.foreign_nodes
        ]
        return min((time for time in due if time is not None), default=math.inf) + self._lost

    def _now(self) -> float:
        """Return the simulated time: the monotonic clock minus the delays that were skipped."""
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
                    self._pass_sync_to_nodes(node, can_id, data)
                for foreign_node in self.foreign_nodes:
                    foreign_node.on_frame(can_id, data, self._now())
        for foreign_node in self.foreign_nodes:
            for can_id, data in foreign_node.take_frames():
                self.network.send_message(can_id, data)
                self._pass_to_nodes(foreign_node, can_id, data)

    def _pass_to_nodes(self, sender: ForeignNode, can_id: int, data: bytes) -> None:
        """Pass a guest's frame to the other nodes; their answers are sent with their next frames."""
        now = self._now()
        for node in self.nodes:
            if node.slave.listens_to(can_id):
                node.slave.on_frame(can_id, data, now)
        for foreign_node in self.foreign_nodes:
            if foreign_node.node_id != sender.node_id:
                foreign_node.on_frame(can_id, data, now)

    def _pass_sync_to_nodes(self, producer: SimulatedLocalNode, can_id: int, data: bytes) -> None:
        """Pass a node's SYNC to the other nodes on this channel: the adapter does not return it to this process."""
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
                "the simulated drives stopped unexpectedly",
                observed=f"{type(self._error).__name__}: {self._error}",
                remedy="see the cause below; on a virtual bus it is a defect of the simulated drive",
            ) from self._error


# -- A simulated node as a ``canopen.LocalNode``: its objects are the device's, its frames pass through the slave ------
#
# ``LocalNode`` itself would answer SDO while stopped, start its own heartbeat thread, and support neither SYNC nor boot-up.
# Therefore it subscribes to nothing here, and is only used for local access by ``node.sdo[...]`` and as a member of the network.


class SimulatedLocalNode(canopen.LocalNode):
    """One device on a ``canopen.Network``; ``lock`` protects the device against the thread that steps it."""

    def __init__(self, device: Device, lock: RLock, slave: Slave | None = None) -> None:
        """``slave``: its communication, if that exists already."""
        super().__init__(device.node_id, object_dictionary(device.eds, device.node_id))
        self.device = device
        self.slave = slave or Slave(device)
        self._lock = lock

    def associate_network(self, network: canopen.Network) -> None:
        """Join the network without the subscriptions of LocalNode: the slave receives and answers."""
        self.network = network

    def remove_network(self) -> None:
        """Leave the network."""

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """Return an entry's bytes, with the present value of the drive.

        Raises:
            canopen.SdoAbortedError: it does not exist, or (``check_readable``) cannot be read.
        """
        dictionary = self.device.dictionary
        with self._lock:
            try:
                if check_readable:
                    return dictionary.upload(index, subindex)
                return dictionary.raw(index, subindex)
            except SdoAbort as abort:
                raise SdoAbortedError(abort.code) from None

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        """Write an entry; without ``check_writable`` like the drive's own firmware, also read-only ones.

        Raises:
            canopen.SdoAbortedError: it does not exist, or (``check_writable``) the value is rejected.
        """
        dictionary = self.device.dictionary
        with self._lock:
            try:
                if check_writable:
                    dictionary.download(index, subindex, bytes(data))
                    return
                dictionary.raw(index, subindex)  # raises if the entry does not exist
            except SdoAbort as abort:
                raise SdoAbortedError(abort.code) from None
            key = index << 8 | subindex
            dictionary.set(key, decode(bytes(data), dictionary.entries[key].data_type))


def object_dictionary(eds: Eds, node_id: int) -> od.ObjectDictionary:
    """Return the same objects as a ``canopen`` dictionary (names, types, access; the values are those of the device)."""
    dictionary = od.ObjectDictionary()  # type: ignore[no-untyped-call]
    dictionary.node_id = node_id
    for entry in eds:
        dictionary.add_object(_entry(entry))
    return dictionary


def _entry(entry: Object) -> od.ODVariable | od.ODRecord | od.ODArray:
    if not entry.is_record:
        return _variable(entry.subs[0])
    kind = od.ODArray if entry.object_type.name == "ARRAY" else od.ODRecord
    group = kind(entry.name, entry.index)
    for variable in entry.subs.values():
        group.add_member(_variable(variable))
    return group


def _variable(variable: Variable) -> od.ODVariable:
    made = od.ODVariable(variable.name, variable.index, variable.subindex)
    made.data_type = int(variable.data_type)
    made.access_type = variable.access
    made.pdo_mappable = variable.pdo_mapping
    return made
