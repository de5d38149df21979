"""A simulated module on Modbus: its answer to each request, and when; bytes in, bytes out, time by ``step``.

Theory of operation
-------------------
``take`` gets received bytes, ``step`` advances the time, ``due`` returns the bytes to be sent. Module, motor and parameters are
those of the simulated CAN Simple module, which sends nothing on CAN while RS485 is its interface. A request for a part of a value
of several registers is rejected (4.3: neither register may be accessed separately), and so is a state that is not in the manual.
``frames`` stores every complete request, for tests.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from axisbus.cia301.tables import rows
from axisbus.drives.gim6010.sim.constants import FACTORY, AxisState, Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.drives.gim6010.sim.parameters import Value


class RegisterAddress(NamedTuple):
    """One value: struct's letter, and the path of its parameter or function in the USB tree; empty if there is none."""

    kind: str
    path: str


FLAGS, RETURN = 0x02, 0x31
NODE_ID, STATE_CONTROL = 0x62, 0x63
ENDPOINT, ENDPOINT_VALUE = 0xA1, 0xA2
POSITION, VELOCITY = 0x0F, 0x11
POSITION_TARGET = 0x66
EMERGENCY_STOP, SAVE = 0x61, 0x80
WRITE_ONLY = (EMERGENCY_STOP, 0x7E, 0x7F, SAVE, ENDPOINT_VALUE)  # read as 0
STATES = (1, 3, 4, 7, 8, 11)
_ROWS = rows(__package__, "station.tsv")
INPUTS, HOLDINGS = (
    {
        int(row["address"], 16): RegisterAddress(row["kind"], row["path"])
        for row in _ROWS
        if row["bank"] == bank
    }
    for bank in ("input", "holding")
)


_READ_HOLDING, _READ_INPUT, _WRITE_ONE, _WRITE_SEVERAL = 0x03, 0x04, 0x06, 0x10
_NO_FUNCTION, _NO_ADDRESS, _NO_VALUE = 1, 2, 3  # exception codes (Modbus application protocol V1.1b3, 7)
_EVERYBODY = 0
_RS485 = 1  # config.comm_intf_mux


class _Refused(Exception):  # becomes an exception answer
    def __init__(self, code: int) -> None:
        self.code = code


class Station:
    """One module on the line; holds the pending answers, and the selected endpoint."""

    def __init__(
        self,
        node_id: int = 1,
        *,
        module: Module | None = None,
        dials: StationFaults | None = None,
        firmware: Firmware = FACTORY,
    ) -> None:
        """``module``: an existing module, with its motor, whose interface must be RS485; by default a new one."""
        self.module = module or Module(node_id, firmware=firmware, comm_intf_mux=_RS485)
        self.dials = dials or StationFaults()
        self.frames: list[bytes] = []
        self._frames = Frames()
        self._answers: list[tuple[float, bytes]] = []
        self._endpoint = 0
        self._now = 0.0
        self._restarts = self.module.restarts
        self._target: float | None = None
        self.address = self._stored_address

    @property
    def broken(self) -> int:
        """Number of received frames with a wrong checksum."""
        return self._frames.broken

    # The line.

    def take(self, data: bytes, now: float) -> None:
        """Take bytes received at ``now`` (s); never raises."""
        self.step(now)
        for frame in self._frames.take(data, now):
            self.frames.append(frame)
            self._hear(frame)

    def step(self, now: float) -> None:
        """Advance to ``now`` (s of any steady clock)."""
        self.module.step(now)
        self._now = now
        if self.module.restarts != self._restarts:
            self._restarts = self.module.restarts
            self._answers.clear()
            self.address = self._stored_address
            self._endpoint = 0

    def due(self, now: float) -> bytes:
        """Return the bytes to be sent until ``now``, and remove them."""
        ready = [data for time, data in self._answers if time <= now + 1e-9]
        self._answers = [each for each in self._answers if each[0] > now + 1e-9]
        return b"".join(ready)

    @property
    def owes(self) -> bool:
        return bool(self._answers)

    # Requests.

    def _hear(self, frame: bytes) -> None:
        everybody = frame[0] == _EVERYBODY
        if (frame[0] != self.address and not everybody) or not self.module.is_awake:
            return
        if self._counted("deaf"):
            return
        answer = self._answer(frame[0], frame[1:])
        if not everybody and self.module.is_awake and not self._counted("silent"):
            self._send(answer)

    def _send(self, answer: bytes) -> None:
        data = framed(answer)
        if self._counted("wrong_checksum"):
            data = data[:-1] + bytes([data[-1] ^ 0x55])
        late = self.dials.late.pop(len(self.frames) - 1, 0.0)
        self._answers.append((self._now + self.dials.delay + late, data))

    def _counted(self, name: str) -> bool:
        """Whether a fault setting that counts down is active; -1 never counts down."""
        left = int(getattr(self.dials, name))
        if left > 0:
            setattr(self.dials, name, left - 1)
        return left != 0

    def _answer(self, address: int, pdu: bytes) -> bytes:
        function = pdu[0]
        act = {
            _READ_HOLDING: self._read,
            _READ_INPUT: self._read,
            _WRITE_ONE: self._write_one,
            _WRITE_SEVERAL: self._write_several,
        }.get(function)
        try:
            if act is None:
                raise _Refused(_NO_FUNCTION)
            return bytes([address, function]) + act(function, pdu[1:])
        except _Refused as refused:
            return bytes([address, function | 0x80, refused.code])

    def _read(self, function: int, data: bytes) -> bytes:
        first, count = struct.unpack(">HH", data)
        places = INPUTS if function == _READ_INPUT else HOLDINGS
        self._require(places, first, count, writes=False)
        value = struct.pack(f">{places[first].kind}", self._value(places, first))
        if self._counted("short"):
            value = value[:-2]
        return bytes([len(value)]) + value

    def _write_one(self, _: int, data: bytes) -> bytes:
        first, word = struct.unpack(">HH", data)
        self._require(HOLDINGS, first, 1, writes=True)
        self._set(first, word)
        return data

    def _write_several(self, _: int, data: bytes) -> bytes:
        first, count, size = struct.unpack_from(">HHB", data)
        values = data[5:]
        if size != 2 * count or len(values) != size:
            raise _Refused(_NO_VALUE)
        self._require(HOLDINGS, first, count, writes=True)
        self._set(first, struct.unpack(f">{HOLDINGS[first].kind}", values)[0])
        return data[:4]

    def _require(self, places: dict[int, RegisterAddress], first: int, count: int, *, writes: bool) -> None:
        """Reject a request that does not access exactly one whole value."""
        code = self.dials.exceptions.get((first, writes))
        if code is not None:
            raise _Refused(code)
        if first not in places or 2 * count != struct.calcsize(f">{places[first].kind}"):
            raise _Refused(_NO_ADDRESS)
        if first == ENDPOINT and not writes and self.dials.number_hidden:
            raise _Refused(_NO_ADDRESS)

    # Values.

    def _value(self, places: dict[int, RegisterAddress], first: int) -> Value:
        module = self.module
        dead = self.dials.dead_in_idle and module.axis.state != AxisState.CLOSED_LOOP
        if places is INPUTS and first in (POSITION, VELOCITY) and dead:
            return 0.0
        own: dict[int, Callable[[], Value]] = {
            FLAGS: self._flags,
            0x17: lambda: module.axis.current_setpoint,
            0x19: lambda: module.axis.current,
            RETURN: lambda: int.from_bytes(module.endpoints.read_bytes(self._endpoint) or bytes(4), "little"),
        }
        if places is HOLDINGS:
            own = {ENDPOINT: lambda: self._endpoint, **{each: lambda: 0 for each in WRITE_ONLY}}
        return own[first]() if first in own else module.usb_read(places[first].path)

    def _flags(self) -> int:
        axis = self.module.axis
        words = axis.motor_error, axis.encoder_error, axis.controller_error, axis.system_error, axis.error
        return sum(bool(word) << bit for bit, word in enumerate(words))

    @property
    def _stored_address(self) -> int:
        return int(self.module.parameters["axis0.config.can.node_id"])

    def _set(self, first: int, value: Value) -> None:
        module = self.module
        if first == EMERGENCY_STOP:
            module.axis.estop()
        elif first == SAVE and not self.dials.save_restarts:
            module.parameters.save()
        elif first == ENDPOINT:
            self._endpoint = int(value)
        elif first == ENDPOINT_VALUE:
            module.endpoints.write_bytes(self._endpoint, int(value).to_bytes(4, "little"))
        elif first == STATE_CONTROL:
            self._state(int(value))
        else:
            module.usb_write(HOLDINGS[first].path, min(value, self.dials.clamps.get(first, value)))
            if first == POSITION_TARGET:
                self._target = float(value)
            if first == NODE_ID and self.dials.node_id_at_once:
                self.address = int(value)

    def _state(self, state: int) -> None:
        if state not in STATES:
            raise _Refused(_NO_VALUE)
        was_closed = self.module.axis.state == AxisState.CLOSED_LOOP
        self.module.usb_write("axis0.requested_state", state)
        closed = self.module.axis.state == AxisState.CLOSED_LOOP
        if closed and not was_closed and self.dials.keeps_target and self._target is not None:
            self.module.usb_write(HOLDINGS[POSITION_TARGET].path, self._target)


# ----------------------------------------------------------------------------------------------------------------------
# Fault settings of a simulated module on RS485, and behaviour that the manual leaves open; may be changed at any time.


@dataclass(slots=True)
class StationFaults:
    """Fault settings of one module on the line; those of the module itself are its ``ModuleFaults``.

    ``silent``: so many requests (-1: all) are executed but not answered; ``deaf``: so many are not even executed.
    ``wrong_checksum``: so many answers have a wrong checksum. ``delay`` in s: of each answer. ``late``: by number of a request,
    from 0, the additional delay in s of its answer. ``exceptions``: by first address and whether it is a write, the exception code
    of all such requests. ``short``: so many answers to reads have one register too few.

    ``dead_in_idle``: position and velocity are 0 except in closed loop, as over CAN. ``keeps_target``: when it enters closed loop,
    the module moves to the last set-point, which no firmware should do. ``node_id_at_once``: a new node ID takes effect when it is
    written, otherwise with the restart. ``save_restarts``: saving restarts the module. ``number_hidden``: A1h cannot be read.
    ``clamps``: by address, the highest value that is stored.
    """

    silent: int = 0
    deaf: int = 0
    wrong_checksum: int = 0
    delay: float = 0.0
    late: dict[int, float] = field(default_factory=dict)
    exceptions: dict[tuple[int, bool], int] = field(default_factory=dict)
    short: int = 0
    dead_in_idle: bool = True
    keeps_target: bool = False
    node_id_at_once: bool = True
    save_restarts: bool = True
    number_hidden: bool = False
    clamps: dict[int, float] = field(default_factory=dict)


# -- RTU frames: their checksum, and their end in the received bytes (Modbus over serial line V1.02, 2.5) --------------


_SHORTEST = 4  # address, function, checksum
_REQUEST = 8  # length of reads, and of a write of one register
_COUNT_AT = 6  # position of the byte count of a write
_GAP = 0.02  # s of silence that end a frame; longer than 3.5 characters, because a computer may pause


def checksum(data: bytes) -> bytes:
    """Return the two bytes of the checksum, lowest first."""
    found = 0xFFFF
    for byte in data:
        found ^= byte
        for _ in range(8):
            odd = found & 1
            found >>= 1
            if odd:
                found ^= 0xA001
    return found.to_bytes(2, "little")


def framed(data: bytes) -> bytes:
    """Return a frame: address, function and data, with their checksum."""
    return data + checksum(data)


class Frames:
    """Splits received bytes into frames; holds an incomplete frame."""

    def __init__(self) -> None:
        self._waiting = b""
        self._last = 0.0
        self.broken = 0  # frames with a wrong checksum

    def take(self, data: bytes, now: float) -> list[bytes]:
        """Take bytes received at ``now`` (s); return the complete and correct frames, without their checksum."""
        if self._waiting and now - self._last > _GAP:
            self._waiting = b""
        self._waiting += data
        self._last = now
        found = []
        while (size := _size(self._waiting)) and len(self._waiting) >= size:
            frame, self._waiting = self._waiting[:size], self._waiting[size:]
            if checksum(frame[:-2]) == frame[-2:]:
                found.append(frame[:-2])
            else:
                self.broken += 1
                self._waiting = b""  # the begin of the next frame is unknown until the line was silent
        return found


def _size(data: bytes) -> int:
    """Return the length of the request that begins here; 0: not known yet."""
    if len(data) < 2:
        return 0
    function = data[1]
    if function in (_READ_HOLDING, _READ_INPUT) or function == _WRITE_ONE:
        return _REQUEST
    if function == _WRITE_SEVERAL:
        return _COUNT_AT + 1 + data[_COUNT_AT] + 2 if len(data) > _COUNT_AT else 0
    return max(_SHORTEST, len(data))  # unknown function: all bytes received together
