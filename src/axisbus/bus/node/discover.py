"""Find the nodes on the bus: request all node-IDs at once, then read details from the nodes that answer.

Theory of operation
-------------------
The scan sends one upload request of 1000h to every node-ID, a frame every 1.5 ms, without waiting for answers. An absent node then
costs only its frame. At this pace a queue of ten frames does not fill even at 125 kbit/s. Heartbeats count too, because a stopped
node answers no SDO. The scan then reads the identities of the nodes that answered in parallel, with one client each.

Before it sends a request, the scan listens for heartbeats of modules that use CAN Simple. For such a module with node ID 48 the
request to CANopen node 2 is an emergency stop, and the request to node 7 a new state. The scan sends no requests to such node-IDs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field

from axisbus.bus.link.channel import Channel, Receiver, require_other_thread
from axisbus.bus.node.node import NodeIdentity, read_identity
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.nmt import NmtState
from axisbus.cia402.device_type import device_kind
from axisbus.clock import sleep_until
from axisbus.drives.foreign_protocols import ForeignProtocols
from axisbus.errors import AxisbusError, SdoError

PACE = 0.0015  # seconds between two frames
LISTEN = 1.4  # seconds to listen in total: long enough for the usual heartbeat period of 1 s
_QUIET = 0.33  # fraction of this time before the first request
DETAIL_TIMEOUT = 0.15
_DETAIL_TRIES = 2
_DETAIL_TOTAL = 1.2
_THREADS = 8
_SEND_PATIENCE = 0.05
_DEVICE_TYPE = b"\x43" + o.DEVICE_TYPE.to_bytes(2, "little") + b"\0"  # an answer with its four bytes


@dataclass(frozen=True, slots=True)
class DiscoveredNode:
    """One node that was found; ``nmt`` is None if it sent no heartbeat during the scan."""

    node_id: int
    answers_sdo: bool
    nmt: NmtState | None = None
    identity: NodeIdentity = field(default_factory=NodeIdentity)

    @property
    def kind(self) -> str:
        """The meaning of its device type as text, empty if the device type was not read."""
        return device_kind(self.identity.device_type)


def scan(
    channel: Channel,
    ids: Iterable[int] = cob.NODE_IDS,
    listen: float = LISTEN,
    listening: ForeignProtocols | None = None,
) -> list[DiscoveredNode]:
    """Find the nodes among ``ids``; blocks ``listen`` seconds, and up to 1.2 s more for details (under 3 s for 127 IDs).

    Call this before nodes are opened on the channel, because it uses their SDO servers. ``listening`` receives every frame
    meanwhile, and afterwards knows the devices that use a protocol other than CANopen.

    Raises:
        AdapterError: the channel failed, or no node acknowledges its frames.
        StateError: called in the receive thread.
    """
    require_other_thread(channel, "a scan of the bus")
    others = ForeignProtocols() if listening is None else listening
    scan_receiver = _ScanReceiver(channel, tuple(ids))
    try:
        with channel.frames_to(others.note):
            _ask(scan_receiver, others, listen)
        channel.check()
    finally:
        scan_receiver.close()
    details = _details(channel, sorted(scan_receiver.answers))
    channel.check()
    return [
        DiscoveredNode(
            node_id,
            node_id in scan_receiver.answers,
            scan_receiver.states.get(node_id),
            details.get(node_id) or NodeIdentity(device_type=scan_receiver.device_type(node_id)),
        )
        for node_id in sorted({*scan_receiver.answers, *scan_receiver.states})
    ]


def _ask(scan_receiver: _ScanReceiver, others: ForeignProtocols, listen: float) -> None:
    clock = scan_receiver.clock
    begin = clock.now()
    quiet = listen * _QUIET
    sleep_until(clock, begin + quiet)
    scan_receiver.ask(_safe(scan_receiver.ids, others))
    sleep_until(clock, begin + (quiet + listen) / 2)
    scan_receiver.ask(
        _safe((node_id for node_id in scan_receiver.ids if node_id not in scan_receiver.answers), others)
    )
    sleep_until(clock, begin + listen)


def _safe(ids: Iterable[int], others: ForeignProtocols) -> list[int]:
    """Return the node-IDs whose request no module takes for a command of another protocol."""
    asked = list(ids)
    taken = others.commands(cob.SDO_RX + node_id for node_id in asked)
    return [node_id for node_id in asked if cob.SDO_RX + node_id not in taken]


class _ScanReceiver:
    """Receiver of SDO answers and heartbeats during a scan; holds state: the newest of each node."""

    def __init__(self, channel: Channel, ids: tuple[int, ...]) -> None:
        self.ids = ids
        self.answers: dict[int, bytes] = {}
        self.states: dict[int, NmtState] = {}
        self.clock = channel.clock
        self._channel = channel
        self._subscriptions: list[tuple[int, Receiver]] = []
        for node_id in ids:
            self._listen(cob.SDO_TX + node_id, self._answer_of(node_id))
            self._listen(cob.HEARTBEAT + node_id, self._heartbeat_of(node_id))

    def device_type(self, node_id: int) -> int | None:
        answer = self.answers.get(node_id, b"")
        whole = len(answer) == 8 and answer[:4] == _DEVICE_TYPE
        return int.from_bytes(answer[4:], "little") if whole else None

    def ask(self, ids: Iterable[int]) -> None:
        request = bytes((0x40, o.DEVICE_TYPE & 0xFF, o.DEVICE_TYPE >> 8, 0, 0, 0, 0, 0))
        for node_id in ids:
            self._channel.send(cob.SDO_RX + node_id, request, _SEND_PATIENCE)
            self.clock.sleep(PACE)

    def close(self) -> None:
        for can_id, receiver in self._subscriptions:
            self._channel.unsubscribe(can_id, receiver)

    def _listen(self, can_id: int, receiver: Receiver) -> None:
        self._channel.subscribe(can_id, receiver)
        self._subscriptions.append((can_id, receiver))

    def _answer_of(self, node_id: int) -> Receiver:
        def receive(data: bytes, _: float) -> None:
            if data[:4] == _DEVICE_TYPE or node_id not in self.answers:
                self.answers[node_id] = data

        return receive

    def _heartbeat_of(self, node_id: int) -> Receiver:
        def receive(data: bytes, _: float) -> None:
            if data:
                self.states[node_id] = NmtState(data[0] & 0x7F)

        return receive


def _details(channel: Channel, ids: list[int]) -> dict[int, NodeIdentity]:
    """Read identities in parallel; nodes that are too slow for the available time are left out."""
    if not ids:
        return {}
    clients = {
        node_id: SdoClient(channel, node_id, timeout=DETAIL_TIMEOUT, tries=_DETAIL_TRIES) for node_id in ids
    }
    found: dict[int, NodeIdentity] = {}

    def read(node_id: int) -> None:
        with suppress(SdoError):
            found[node_id] = read_identity(clients[node_id])

    waiting = deque(ids)

    def work() -> None:
        # None is left; or the channel has failed, which is checked later.
        with suppress(IndexError, AxisbusError):
            while True:
                read(waiting.popleft())

    clock = channel.clock
    threads = [clock.thread(work, f"axisbus details {number}") for number in range(min(_THREADS, len(ids)))]
    until = clock.now() + _DETAIL_TOTAL
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(max(0.0, until - clock.now()))
    finally:
        waiting.clear()
        for client in clients.values():
            client.close()
        for thread in threads:
            thread.join()
    return found
