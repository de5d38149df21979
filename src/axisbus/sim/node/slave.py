"""Communication of one simulated node as frames in and frames out, without a bus or a clock.

Theory of operation
-------------------
``on_frame`` takes a received frame, ``step`` advances the time; frames to be sent collect in a list that ``take_frames`` empties.
The NMT state decides which frames are accepted: none while initialising, no SDO, SYNC, PDO or EMCY in *stopped*, no PDO in
*pre-operational*. At SYNC the synchronous TPDOs are sampled first, then the waiting RPDOs take effect, so that the answer to a
command is sent with the next SYNC, as on a real bus. If 1005h is configured so, the node sends SYNC itself, and processes its own
SYNC. SDO requests are queued and executed when their delay is over.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from axisbus.cia301.nmt import NmtState
from axisbus.sim.device import RPDO_LATE, Device
from axisbus.sim.drive import Drive
from axisbus.sim.node.pdo import Pdo, apply
from axisbus.sim.node.sdo import SdoServer
from axisbus.sim.node.synchronising import SyncService
from axisbus.sim.settings import AXIS_SPAN, object_key

Frame = tuple[int, bytes]
_HEARTBEAT = 0x700
_OPERATIONAL, _PRE_OPERATIONAL = NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL  # compared for each frame
_HEARTBEAT_KEY = 0x1017_00
_LSS_REQUEST, _LSS_ANSWER = 0x7E5, 0x7E4
_SHORT_PDO = 0x8210
_NO_CHANNEL = 1 << 31
_CONSUMER = 0x8000_0000  # in 1012h
_SIGHTINGS = 2  # TPDOs: a master may see only the second one, if its command came after the first


class TransmitState:
    """Transmission state of one TPDO; ``begun``: it counts SYNCs, because its start value was received or it has none."""

    __slots__ = ("begun", "count", "last", "sampled", "stamp")

    def __init__(self) -> None:
        self.last: bytes | None = None
        self.sampled: bytes | None = None  # at SYNC, for type 252
        self.stamp = -1e9
        self.count = 0
        self.begun = False


class Slave:
    """A node on the wire; holds queues, timers and the frames sent last. Times are seconds of any steady clock."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._servers = {
            number: SdoServer(device.dictionary, device.dials) for number in _sdo_channels(device)
        }
        self.on_routes: Callable[[], None] | None = None  # called when it listens to other identifiers
        self._frames: list[Frame] = []
        self._requests: deque[tuple[float, int, bytes]] = deque()  # when due, SDO channel, frame
        self._pending: dict[int, tuple[Pdo, bytes]] = {}  # RPDOs that wait for SYNC
        self._sent: dict[int, TransmitState] = {}
        self._last_received: dict[int, float] = {}  # RPDO number: time of receipt
        self._late: set[int] = set()
        self._routes: dict[int, Callable[[bytes, float], None]] = {}
        self._timed: list[Pdo] = []  # RPDOs with a deadline
        self._cyclic: list[Pdo] = []  # valid TPDOs by how they are sent
        self._events: list[Pdo] = []
        self._requested: list[Pdo] = []
        self._statusword_drives: dict[
            int, list[Drive]
        ] = {}  # by TPDO number: the drives whose statusword it contains
        self._remote_requestable: dict[int, Pdo] = {}  # TPDOs that answer remote frames, by COB-ID
        self.sync = SyncService(device)
        # milliseconds since midnight, days since 1984, as received by TIME
        self.time_of_day: tuple[int, int] | None = None
        self._version = -1
        self._now: float | None = None
        self._next_heartbeat = 0.0
        self._beat_time = 0.0  # 1017h as last used
        self._boot_ups = 0
        self._nmt = device.nmt
        for number in self._servers:
            for sub in (1, 2):
                device.dictionary.on_write((0x1200 + number) << 8 | sub, self._forget_routes)
        self._index_routes()

    def listens_to(self, can_id: int) -> bool:
        """Whether the node processes frames with this identifier."""
        known = can_id in self._routes or can_id in self._remote_requestable
        return known or _HEARTBEAT < can_id <= _HEARTBEAT + 127 or can_id == _LSS_REQUEST

    @property
    def has_frames(self) -> bool:
        """Whether ``take_frames`` returns any."""
        return bool(self._frames)

    def take_frames(self) -> list[Frame]:
        """Return the frames to be sent, as (identifier, data), and clear them."""
        frames, self._frames = self._frames, []
        return frames

    def on_frame(self, can_id: int, data: bytes, now: float, *, remote: bool = False) -> None:
        """Take a frame received at ``now``; unknown and malformed frames are ignored."""
        device = self.device
        if device.silent:
            return
        if can_id == _LSS_REQUEST and not remote and device.accepts_lss:
            device.lss_request(bytes(data), now)
            self._answer_lss(now)
            self._after(now)
            return
        if device.nmt is NmtState.INITIALISING:
            return
        if remote:
            self._on_remote(can_id, now)
            return
        if _HEARTBEAT < can_id <= _HEARTBEAT + 127:
            device.receive_heartbeat(can_id - _HEARTBEAT)
            return
        handler = self._routes.get(can_id)
        if handler is not None:
            handler(bytes(data), now)
            self._after(now)

    def step(self, now: float) -> None:
        """Advance to ``now``: the device is stepped, timers run, frames collect."""
        dt = 0.0 if self._now is None else now - self._now
        self._now = now
        device = self.device
        device.step(max(0.0, dt))
        if device.silent:
            device.errors.take()
            for drive in device.drives:
                drive.power.stop_waiting_for_tpdos()
            self._version = -1  # so that the drives wait for their TPDOs again when it is back
            return
        if device.lss.busy:
            self._answer_lss(now)
        if self._boot_ups < device.boot_ups:
            self._announce_boot(now)
        if device.nmt is NmtState.INITIALISING:
            return
        if self._requests:
            self.serve(now)
        self._beat(now)
        if self._timed:
            self._watch_deadlines(now)
        if self.sync.enabled:
            self._produce_sync(now)
        self._after(now)

    def _after(self, now: float) -> None:
        """Send the frames that follow from the last change."""
        device = self.device
        if device.nmt is not self._nmt:
            self._on_nmt_change()
        if device.pdos.version != self._version:
            self._index_routes()
        nmt = device.nmt
        if device.errors.queued and (nmt is _OPERATIONAL or nmt is _PRE_OPERATIONAL):
            self._send_emergencies()
        if self._events and nmt is _OPERATIONAL:
            self._send_events(now)

    def _on_nmt_change(self) -> None:
        self._nmt = self.device.nmt
        self._index_routes()  # its node-ID may be another one
        self._sent.clear()
        self._pending.clear()
        self._last_received.clear()
        self._late.clear()
        if self._nmt in (NmtState.STOPPED, NmtState.INITIALISING):
            self._requests.clear()
            for server in self._servers.values():
                server.reset()

    def _index_routes(self) -> None:
        device = self.device
        self._version = device.pdos.version
        self.sync.reload()
        routes: dict[int, Callable[[bytes, float], None]] = {self.sync.cob_id: self._on_sync, 0: self._on_nmt}
        if (time := device.dictionary.get_int(0x1012)) & _CONSUMER:
            routes.setdefault(time & 0x7FF, self._on_time)
        for number in self._servers:
            if (ids := self._sdo_ids(number)) is not None:
                routes[ids[0]] = self._sdo_handler(number)
        for pdo in device.pdos.receive:
            if pdo.valid:
                routes.setdefault(pdo.cob_id, self._rpdo_handler(pdo))
        self._routes = routes
        self._timed = [pdo for pdo in device.pdos.receive if pdo.event_timer > 0.0]
        sent = [pdo for pdo in device.pdos.transmit if pdo.valid and pdo.fields]
        self._cyclic = [pdo for pdo in sent if pdo.synchronous]
        self._events = [pdo for pdo in sent if not pdo.synchronous and not pdo.on_request]
        self._requested = [pdo for pdo in sent if pdo.on_request]
        self._remote_requestable = {pdo.cob_id: pdo for pdo in sent if pdo.rtr}
        if self.on_routes is not None:
            self.on_routes()
        self._index_statuswords(sent)

    def _index_statuswords(self, sent: list[Pdo]) -> None:
        """Find the TPDOs that contain the statusword of each drive; a periodic one must have sent a state twice."""
        self._statusword_drives = {pdo.number: [] for pdo in sent}
        for drive in self.device.drives:
            key = object_key(self.device.dictionary, 0x6041 + drive.axis_number * AXIS_SPAN)
            drive.power.stop_waiting_for_tpdos()
            for pdo in sent:
                if not any(field.key == key for field in pdo.fields):
                    continue
                self._statusword_drives[pdo.number].append(drive)
                repeats = 1 <= pdo.transmission_type <= 240 or (not pdo.on_request and pdo.event_timer > 0.0)
                if repeats and self.device.operational:
                    drive.power.to_be_sent[pdo.number] = _SIGHTINGS

    # NMT, heartbeat, guarding.

    def _on_nmt(self, data: bytes, _now: float) -> None:
        if len(data) >= 2 and data[1] in (0, self.device.node_id):
            self.device.nmt_command(data[0])

    def _announce_boot(self, now: float) -> None:
        while self._boot_ups < self.device.boot_ups:
            self._boot_ups += 1
            self._frames.append((_HEARTBEAT + self.device.node_id, b"\0"))
            self._beat_time = self._heartbeat_time
            self._next_heartbeat = now + self._beat_time

    @property
    def _heartbeat_time(self) -> float:
        value = self.device.dictionary.values.get(_HEARTBEAT_KEY)
        return value / 1000.0 if isinstance(value, int) else 0.0

    def _beat(self, now: float) -> None:
        device = self.device
        time = self._heartbeat_time
        # A new period begins immediately (CiA 301 7.2.8.3.2.2), not at the end of the old one.
        if time != self._beat_time:
            self._beat_time, self._next_heartbeat = time, now
        if time <= 0.0:
            self._next_heartbeat = now
        elif now >= self._next_heartbeat - 1e-9:
            self._next_heartbeat = max(self._next_heartbeat + time, now)
            if not device.dials.heartbeat_stops:
                self._frames.append((_HEARTBEAT + device.node_id, bytes([device.nmt])))

    def _on_remote(self, can_id: int, now: float) -> None:
        device = self.device
        pdo = self._remote_requestable.get(can_id) if device.operational else None
        if pdo is not None:
            state = self._sent.setdefault(pdo.number, TransmitState())
            data = state.sampled if pdo.transmission_type == 252 else pdo.pack()
            if data is not None:
                self._send(pdo, state, data, now)
        if can_id == _HEARTBEAT + device.node_id and device.dictionary.get_int(0x1017) == 0:
            self._frames.append((can_id, device.life_guard.answer(device.nmt, device.time)))

    # LSS.

    def _answer_lss(self, now: float) -> None:
        self._frames += [(_LSS_ANSWER, answer) for answer in self.device.lss.take_answers(now)]

    # SDO.

    @property
    def has_requests(self) -> bool:
        """Whether SDO requests wait for their answers."""
        return bool(self._requests)

    @property
    def next_answer(self) -> float | None:
        """Time at which the next SDO answer is due; None if none is pending, or the node is not running."""
        return self._requests[0][0] if self._requests and self._is_running else None

    def serve(self, now: float) -> None:
        """Answer the SDO requests that are due at ``now``."""
        while self._requests and self._is_running and now >= self._requests[0][0]:
            _, number, data = self._requests.popleft()
            self._answer(number, data, now)

    @property
    def _is_running(self) -> bool:
        return not self.device.silent and self.device.nmt is not NmtState.INITIALISING

    def _forget_routes(self, _value: int) -> None:
        self._version = -1

    def _sdo_ids(self, number: int) -> tuple[int, int] | None:
        """Return request and answer identifier of an SDO channel (0 is the predefined one); None if it is not valid."""
        if number == 0:
            return 0x600 + self.device.node_id, 0x580 + self.device.node_id
        request, answer = (
            self.device.dictionary.get_int(0x1200 + number, sub, _NO_CHANNEL) & 0xFFFF_FFFF for sub in (1, 2)
        )
        valid = not (request | answer) & _NO_CHANNEL and request and answer
        return (request & 0x7FF, answer & 0x7FF) if valid else None

    def _sdo_handler(self, number: int) -> Callable[[bytes, float], None]:
        return lambda data, now: self._on_sdo(number, data, now)

    def _on_sdo(self, number: int, data: bytes, now: float) -> None:
        device = self.device
        dials = device.dials
        if device.nmt is NmtState.STOPPED or dials.sdo_silent or device.deaf or dials.is_sdo_frame_lost():
            return
        if dials.sdo_delay <= 0.0 and not self._requests:
            self._answer(number, data, now)
        else:
            self._requests.append((now + dials.sdo_delay, number, data))

    def _answer(self, number: int, data: bytes, now: float) -> None:
        ids = self._sdo_ids(number)
        for answer in self._servers[number].request(data, now):
            if ids is not None and not self.device.dials.is_sdo_frame_lost():
                self._frames.append((ids[1], answer))

    # PDO and SYNC.

    def _rpdo_handler(self, pdo: Pdo) -> Callable[[bytes, float], None]:
        return lambda data, now: self._on_rpdo(pdo, data, now)

    def _on_rpdo(self, pdo: Pdo, data: bytes, now: float) -> None:
        device = self.device
        if not device.operational or not pdo.valid:
            return
        if len(data) < pdo.size:
            device.errors.report(-1, _SHORT_PDO)
            return
        self._last_received[pdo.number] = now
        if pdo.number in self._late:
            self._late.discard(pdo.number)
            device.communication_restored()
        if pdo.synchronous:
            self._pending[pdo.number] = (pdo, data)
        else:
            apply([(pdo, data)], device.dials.rpdos_in_order)

    def _produce_sync(self, now: float) -> None:
        data = self.sync.due(now)
        if data is not None:
            self._frames.append((self.sync.cob_id, data))
            self._on_sync(data, now)

    def _on_time(self, data: bytes, _now: float) -> None:
        if len(data) >= 6:
            word = int.from_bytes(data[:6], "little")
            self.time_of_day = word & 0xFFF_FFFF, word >> 32

    def _on_sync(self, data: bytes, now: float) -> None:
        if not self.device.operational:
            return
        counter = self.sync.counter(data)
        for pdo in self._cyclic:
            self._sample(pdo, now, counter)
        for pdo in self._requested:
            self._sent.setdefault(pdo.number, TransmitState()).sampled = pdo.pack()
        if self._pending:
            pending, self._pending = self._pending, {}
            apply(list(pending.values()), self.device.dials.rpdos_in_order)
        self.device.sync()

    def _sample(self, pdo: Pdo, now: float, counter: int) -> None:
        """Send a synchronous TPDO: type 0 when it has changed, type n with every n-th SYNC."""
        state = self._sent.get(pdo.number) or self._sent.setdefault(pdo.number, TransmitState())
        if pdo.transmission_type == 0:
            data = pdo.pack()
            if data != state.last:
                self._send(pdo, state, data, now)
            return
        if counter and pdo.sync_start and not state.begun and counter != pdo.sync_start:
            return  # the TPDO counts from the SYNC with this counter on (18xxh:06)
        state.begun = True
        state.count += 1
        if state.count >= pdo.transmission_type:
            state.count = 0
            self._send(pdo, state, pdo.pack(), now)

    def _send_events(self, now: float) -> None:
        """Send the event-driven TPDOs that have changed or whose event timer has expired, but not within their inhibit time."""
        for pdo in self._events:
            state = self._sent.setdefault(pdo.number, TransmitState())
            since = now - state.stamp + 1e-9
            if since < pdo.inhibit_time:
                continue
            data = pdo.pack()
            if data != state.last or (pdo.event_timer > 0.0 and since >= pdo.event_timer):
                self._send(pdo, state, data, now)

    def _send(self, pdo: Pdo, state: TransmitState, data: bytes, now: float) -> None:
        state.last, state.stamp = data, now
        for drive in self._statusword_drives[pdo.number]:
            drive.power.sent(pdo.number)
        if pdo.number + 1 not in self.device.dials.tpdos_stop:
            self._frames.append((pdo.cob_id, data))

    def _watch_deadlines(self, now: float) -> None:
        """Supervise 14xxh:05: an RPDO received once must be received again in time."""
        if not self.device.operational:
            return
        for pdo in self._timed:
            stamp = self._last_received.get(pdo.number)
            if stamp is None or pdo.number in self._late:
                continue
            if now - stamp > pdo.event_timer:
                self._late.add(pdo.number)
                self.device.communication_error(RPDO_LATE)

    # Emergencies.

    def _send_emergencies(self) -> None:
        device = self.device
        for code, register, data in device.errors.take():
            cob_id = device.dictionary.get_int(0x1014, 0, 0x80 + device.node_id) & 0xFFFF_FFFF
            if cob_id & 0x8000_0000 or not cob_id & 0x7FF:
                continue
            message = code.to_bytes(2, "little") + bytes([register]) + data
            self._frames.append((cob_id & 0x7FF, message[:2] if device.dials.emcy_short else message))


def _sdo_channels(device: Device) -> list[int]:
    """Return the numbers of the SDO channels: 0, the predefined one, and those of 1201h to 127Fh that the node has."""
    dictionary = device.dictionary
    return [0, *(number for number in range(1, 128) if dictionary.has(0x1200 + number, 1))]
