"""The other end of the wire: a python-can bus with failure settings, and a slave written frame by frame after CiA 301."""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable

import can

Frame = tuple[int, bytes]
Handler = Callable[[int, bytes, bool], Iterable[Frame]]


class FakeBus(can.BusABC):
    """A bus in memory: sent frames go to ``peers`` at once, and their answers can be received.

    Fault settings: ``refuse``: exceptions, one for each of the next sends; ``full`` refuses all; ``stuck``: an event that sends
    of threads whose name begins with "stuck" wait for; an exception given to ``fail_receiving`` is raised by ``recv``; ``says`` is
    the driver's state of the controller (or raises).
    """

    def __init__(self) -> None:
        super().__init__(channel="fake")
        self.channel_info = "fake"
        self.inbox: queue.Queue[can.Message | Exception] = queue.Queue()
        self.sent: list[Frame] = []
        self.remote: list[int] = []
        self.peers: list[Handler] = []
        self.refuse: deque[Exception] = deque()
        self.full = False
        self.stuck: threading.Event | None = None
        self.is_open = True
        self.says: can.BusState | Exception = can.BusState.ACTIVE

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.stuck is not None and threading.current_thread().name.startswith("stuck"):
            self.stuck.wait(10)
        if self.refuse:
            raise self.refuse.popleft()
        if self.full:
            raise can.CanOperationError("Transmit buffer full")
        data = bytes(msg.data)
        if msg.is_remote_frame:
            self.remote.append(msg.arbitration_id)
        else:
            self.sent.append((msg.arbitration_id, data))
        for peer in self.peers:
            for can_id, answer in peer(msg.arbitration_id, data, msg.is_remote_frame):
                self.inject(can_id, answer)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            item = self.inbox.get(timeout=timeout)
        except queue.Empty:
            return None, False
        if isinstance(item, Exception):
            raise item
        return item, False

    def inject(self, can_id: int, data: bytes | str) -> None:
        """Have a frame arrive; ``data`` may be hex digits."""
        raw = bytes.fromhex(data) if isinstance(data, str) else data
        self.inbox.put(can.Message(arbitration_id=can_id, data=raw, is_extended_id=False))

    def inject_error_frame(self, error_class: int, data: str = "00 00 00 00 00 00 00 00") -> None:
        raw = bytes.fromhex(data)
        self.inbox.put(
            can.Message(arbitration_id=error_class, is_error_frame=True, data=raw, is_extended_id=False)
        )

    @property
    def state(self) -> can.BusState:
        if isinstance(self.says, Exception):
            raise self.says
        return self.says

    def fail_receiving(self, error: Exception) -> None:
        self.inbox.put(error)

    def frames(self, can_id: int) -> list[bytes]:
        """The data of all frames sent on a COB-ID."""
        return [data for sent_id, data in self.sent if sent_id == can_id]

    def shutdown(self) -> None:
        super().shutdown()
        self.is_open = False


def eventually(condition: Callable[[], object], seconds: float = 5.0) -> None:
    """Wait for an action of another thread; generous, because the computer may be busy."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "did not happen in time"
        time.sleep(0.001)


class Slave:
    """A CANopen slave: SDO server (expedited and segmented), the PDO parameter rules, NMT. By CiA 301, not from the library.

    Settings: ``ignore`` requests get no answer; with ``hold`` they wait until ``release``; ``abort_on`` maps (index, subindex) to
    the abort code of a write; ``flip_toggle`` spoils the toggle bit of that many segments; ``fixed_mapping`` refuses any change of
    a map, ``fixed_communication`` any of the communication parameters.
    """

    def __init__(self, node_id: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        self.node_id = node_id
        self.objects: dict[tuple[int, int], bytes] = {
            (0x1000, 0): (0x00020192).to_bytes(4, "little"),
            (0x1001, 0): b"\0",
            **(objects or {}),
        }
        self.ignore = 0
        self.hold = False
        self.held: list[Frame] = []
        self.abort_on: dict[tuple[int, int], int] = {}
        self.flip_toggle = 0
        self.fixed_mapping = False
        self.fixed_communication = False
        self.answers_guarding = False
        self.nmt_state = 127
        self.writes: list[tuple[int, int, bytes]] = []
        self.aborts_received: list[tuple[int, int, int]] = []
        self.commands: list[int] = []
        self._upload: tuple[bytes, int] | None = None
        self._download: tuple[int, int, bytearray] | None = None
        self._toggle = 0

    def __call__(self, can_id: int, data: bytes, remote: bool) -> list[Frame]:
        if remote:
            return self._guard(can_id)
        if can_id == 0 and data[1] in (0, self.node_id):
            return self._command(data[0])
        if can_id != 0x600 + self.node_id or self.nmt_state == 4:
            return []
        answers = [(0x580 + self.node_id, answer) for answer in self._sdo(data)]
        if self.ignore and data[0] != 0x80:
            self.ignore -= 1
            return []
        if self.hold:
            self.held += answers
            return []
        return answers

    def release(self) -> list[Frame]:
        """Return the answers that were held back, and answer at once from now on."""
        held, self.held, self.hold = self.held, [], False
        return held

    def number(self, index: int, subindex: int = 0) -> int:
        return int.from_bytes(self.objects[index, subindex], "little")

    # -- NMT

    def _command(self, command: int) -> list[Frame]:
        self.commands.append(command)
        if command in (129, 130):
            self.nmt_state = 127
            return [(0x700 + self.node_id, b"\0")]
        self.nmt_state = {1: 5, 2: 4, 128: 127}.get(command, self.nmt_state)
        return []

    def heartbeat(self) -> Frame:
        return 0x700 + self.node_id, bytes([self.nmt_state])

    def _guard(self, can_id: int) -> list[Frame]:
        if can_id != 0x700 + self.node_id or not self.answers_guarding:
            return []
        self._guard_toggle = getattr(self, "_guard_toggle", 0x80) ^ 0x80
        return [(can_id, bytes([self.nmt_state | self._guard_toggle]))]

    # -- SDO server

    def _sdo(self, data: bytes) -> list[bytes]:
        command = data[0]
        index, subindex = int.from_bytes(data[1:3], "little"), data[3]
        if command == 0x80:
            self.aborts_received.append((index, subindex, int.from_bytes(data[4:8], "little")))
            self._upload = self._download = None
            return []
        if command == 0x40:
            return [self._start_upload(index, subindex)]
        if command & 0xE0 == 0x20:
            return [self._start_download(command, index, subindex, data)]
        if command & 0xE0 == 0x60:
            return [self._upload_segment(command)]
        if command & 0xE0 == 0x00:
            return [self._download_segment(command, data)]
        return [_abort(index, subindex, 0x0504_0001)]

    def _start_upload(self, index: int, subindex: int) -> bytes:
        mux = index.to_bytes(2, "little") + bytes([subindex])
        value = self.objects.get((index, subindex))
        if value is None:
            known = any(key[0] == index for key in self.objects)
            return _abort(index, subindex, 0x0609_0011 if known else 0x0602_0000)
        if 1 <= len(value) <= 4:
            return bytes([0x43 | (4 - len(value)) << 2]) + mux + value.ljust(4, b"\0")
        self._upload, self._toggle = (value, 0), 0
        return b"\x41" + mux + len(value).to_bytes(4, "little")

    def _upload_segment(self, command: int) -> bytes:
        assert self._upload is not None, "segment without a transfer"
        value, position = self._upload
        assert command & 0x10 == self._toggle
        part = value[position : position + 7]
        last = position + 7 >= len(value)
        toggle = self._toggle
        if self.flip_toggle:
            self.flip_toggle -= 1
            toggle ^= 0x10
        answer = bytes([toggle | (7 - len(part)) << 1 | last]) + part.ljust(7, b"\0")
        self._upload, self._toggle = (None if last else (value, position + 7)), self._toggle ^ 0x10
        return answer

    def _start_download(self, command: int, index: int, subindex: int, data: bytes) -> bytes:
        mux = data[1:4]
        if command & 0x02:
            count = 4 - (command >> 2 & 3) if command & 1 else 4
            code = self._write(index, subindex, data[4 : 4 + count])
            return _abort(index, subindex, code) if code else b"\x60" + mux + bytes(4)
        self._download, self._toggle = (index, subindex, bytearray()), 0
        return b"\x60" + mux + bytes(4)

    def _download_segment(self, command: int, data: bytes) -> bytes:
        assert self._download is not None, "segment without a transfer"
        index, subindex, value = self._download
        if command & 0x10 != self._toggle:
            return _abort(index, subindex, 0x0503_0000)
        value += data[1 : 8 - (command >> 1 & 7)]
        answer = bytes([0x20 | self._toggle]) + bytes(7)
        self._toggle ^= 0x10
        if command & 1:
            self._download = None
            code = self._write(index, subindex, bytes(value))
            return _abort(index, subindex, code) if code else answer
        return answer

    def _write(self, index: int, subindex: int, value: bytes) -> int:
        self.writes.append((index, subindex, value))
        if (index, subindex) in self.abort_on:
            return self.abort_on[index, subindex]
        if (index, subindex) not in self.objects:
            return 0x0602_0000
        if len(value) != len(self.objects[index, subindex]) and 0x1400 <= index < 0x1C00:
            return 0x0607_0010
        code = self._pdo_rules(index, subindex, value)
        if not code:
            self.objects[index, subindex] = value
        return code

    def _pdo_rules(self, index: int, subindex: int, value: bytes) -> int:
        """CiA 301 7.5.2.36: a map changes only while its PDO is off and its count is 0; a valid PDO keeps its parameters."""
        for communication, mapping in ((0x1400, 0x1600), (0x1800, 0x1A00)):
            if communication <= index < communication + 0x200:
                return self._communication_rules(index, subindex, value)
            if mapping <= index < mapping + 0x200:
                return self._mapping_rules(index, index - mapping + communication, subindex, value)
        return 0

    def _communication_rules(self, index: int, subindex: int, value: bytes) -> int:
        if self.fixed_communication:
            return 0x0601_0002
        valid = not self.number(index, 1) & 1 << 31
        if subindex == 1 and valid and value[3] & 0x80 == 0 and value[:2] != self.objects[index, 1][:2]:
            return 0x0609_0030
        return 0x0609_0030 if subindex in (2, 3) and valid and index >= 0x1800 else 0

    def _mapping_rules(self, index: int, communication: int, subindex: int, value: bytes) -> int:
        if self.fixed_mapping:
            return 0x0601_0002
        if not self.number(communication, 1) & 1 << 31:
            return 0x0601_0000
        if subindex:
            return 0x0601_0000 if self.number(index, 0) else 0
        bits = sum(self.number(index, sub) & 0xFF for sub in range(1, value[0] + 1))
        return 0x0604_0042 if bits > 64 else 0


def _abort(index: int, subindex: int, code: int) -> bytes:
    return b"\x80" + index.to_bytes(2, "little") + bytes([subindex]) + code.to_bytes(4, "little")


def pdo_objects(
    communication: int,
    mapping: int,
    cob_id: int,
    transmission: int,
    entries: Iterable[int],
    *,
    inhibit: int | None = None,
    event: int | None = None,
    slots: int = 8,
) -> dict[tuple[int, int], bytes]:
    """Return the objects of one PDO of a slave (``slots`` mapping entries, unused ones 0)."""
    entries = list(entries)
    objects = {
        (communication, 0): b"\x05",
        (communication, 1): cob_id.to_bytes(4, "little"),
        (communication, 2): bytes([transmission]),
        (mapping, 0): bytes([len(entries)]),
    }
    if inhibit is not None:
        objects[communication, 3] = inhibit.to_bytes(2, "little")
    if event is not None:
        objects[communication, 5] = event.to_bytes(2, "little")
    for number in range(slots):
        value = entries[number] if number < len(entries) else 0
        objects[mapping, number + 1] = value.to_bytes(4, "little")
    return objects
