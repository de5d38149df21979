"""The readers of bytes of the GIM6010-8 beside CANopen: its files, CAN Simple and Modbus, for fuzzing (as ``kit.readers``)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from axisbus.drives.gim6010.can_simple import codec, endpoint_messages, endpoints, error_query, mit
from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.can_simple.heartbeat import Heartbeats
from axisbus.drives.gim6010.modbus import requests as modbus
from axisbus.drives.gim6010.modbus.registers import named as modbus_named
from axisbus.drives.gim6010.modbus.requests import ModbusTimeout, fits
from axisbus.drives.gim6010.modbus.serial_wire import SerialWire, libraries
from axisbus.drives.gim6010.parameters import backup
from axisbus.drives.gim6010.sim.modbus.station import Station, framed
from axisbus.drives.gim6010.sim.module import Module
from kit.frame_readers import Conversations, off_bus, on_bus, reader_of, unshown
from kit.reader_limits import PassedOver, Reader

# -- files -----------------------------------------------------------------------------------------------------------------

_VALUES = {"axis0.config.can.node_id": 1, "axis0.motor.config.current_lim": 10.5, "config.enable_uart": True}


def _backup(_: Path) -> list[bytes]:
    """Return the settings of a GIM6010-8."""
    found = backup.ParameterBackup(
        0x1234, Firmware(0, 5, 13), {**_VALUES, "a.b": float("nan"), "a.c": 1 << 40}
    )
    return [found.text().encode()]


def _restored(path: Path) -> object:
    return backup.differences(
        backup.read(path.read_bytes().decode("utf-8", "replace"), str(path)).values, _VALUES
    )


def _endpoints(_: Path) -> list[bytes]:
    return [json.dumps(Module(1).json()).encode()]


# -- CAN Simple ----------------------------------------------------------------------------------------------------------

_NODE = 1 << 5


def _simple_frames() -> Conversations:
    by_module = [
        (0x01, "0000000008000001"),
        (0x01, "0000000008000002"),
        (0x03, "0000000000000000"),
        (0x05, "0001000004000500"),
        (0x04, "0001000004000500"),
        (0x08, "01800080080000"),
        (0x09, "0000803f00000040"),
        (0x0A, "1000000010000000"),
        (0x14, "0000803f00000040"),
        (0x17, "0000404100000040"),
    ]
    to_module = [
        (0x07, "0800000000000000"),
        (0x0B, "0300000001000000"),
        (0x0C, "0000803f00000000"),
        (0x0D, "0000803f00000000"),
        (0x0E, "0000003f00000000"),
        (0x0F, "0000a0410000a041"),
        (0x08, "8000800800008000"),
        (0x04, "0001000000000000"),
        (0x02, ""),
        (0x18, ""),
        (0x07, "0100000000000000"),
    ]
    return [[on_bus(_NODE | command, data) for command, data in one] for one in (by_module, to_module)]


def _simple(frames: Sequence[bytes]) -> None:
    beats = Heartbeats()
    for frame in map(off_bus, frames):
        for from_module in (True, False):
            codec.decode(
                frame.can_id,
                frame.data,
                from_module=from_module,
                remote=frame.remote,
                extended=frame.extended,
            )
        codec.readings(frame.can_id, frame.data, remote=frame.remote, extended=frame.extended)
        endpoint_messages.answer(frame.can_id, frame.data)
        for which in error_query.ErrorType:
            error_query.read(1, frame.data, which)
        mit.unpack(1, frame.data)
        mit.read(1, frame.data)
        after = beats.after(1, frame.data)
        beats = after if isinstance(after, Heartbeats) else beats


def _simple_module(frames: Sequence[bytes]) -> None:
    module, now = Module(1), 0.0
    for frame in map(off_bus, frames):
        if not frame.extended and not frame.error:
            module.on_frame(frame.can_id, frame.data, now, remote=frame.remote)
        now += 0.002
        module.step(now)
        for sent in module.take_frames():
            assert sent[0] <= 0x7FF
            assert len(sent[1]) in (0, 4, 6, 8)


# -- Modbus --------------------------------------------------------------------------------------------------------------


def _modbus_requests() -> Conversations:
    requests = [
        "010400000001",
        "010400000002",
        "0103 0060 0001",
        "0106 0060 0001",
        "0110 0066 0002 04 00000000",
    ]
    whole = [framed(bytes.fromhex(each)) for each in requests]
    return [whole, [b"".join(whole)], [part for each in whole for part in (each[:3], each[3:])]]


def _modbus_station(frames: Sequence[bytes]) -> None:
    station, now, answers = Station(), 0.0, b""
    for frame in frames:
        station.take(frame, now)
        now += 0.005
        answers += station.due(now)
    if not answers:
        raise PassedOver


class _Port:
    """A serial port that answers each request with the next line of the input."""

    is_open = True

    def __init__(self, answers: Sequence[bytes]) -> None:
        self._answers, self._came = iter(answers), b""

    @property
    def in_waiting(self) -> int:
        return len(self._came)

    def write(self, data: bytes) -> int:
        self._came = next(self._answers, b"")
        return len(data)

    def read(self, size: int) -> bytes:
        found, self._came = self._came[:size], self._came[size:]
        return found


_ASKED = tuple(modbus.read(modbus_named(name)) for name in ("motor_state", "node_id", "position_feedback"))


def _modbus_replies() -> Conversations:
    station, replies, now = Station(), [], 0.0
    for request in _ASKED:
        station.take(framed(request.frame(1)), now)
        now += 0.1
        replies.append(station.due(now))
    return [replies]


def _modbus_client(frames: Sequence[bytes]) -> None:
    """Read three registers; pymodbus decodes the frames, and our wire and requests check the result."""
    wire = SerialWire.__new__(SerialWire)
    serial, make, exceptions = libraries()
    client = make("fuzz", timeout=0.001, retries=0)
    client.socket = _Port(frames)
    wire._stuck, wire._gone = serial.SerialTimeoutException, (serial.SerialException, OSError)
    wire._failures, wire._client = exceptions, client
    wire.port = "fuzz"
    heard = 0
    for request in _ASKED:
        with suppress(ModbusTimeout):
            reply = wire.exchange(1, request)
            heard += 1
            if fits(request, reply) and not reply.exception:
                request.register.value(reply.words)
    if not heard:
        raise PassedOver


READERS: dict[str, Reader] = {
    "backup": Reader(".json", _backup, _restored),
    "endpoints": Reader(".json", _endpoints, lambda path: endpoints.parse(path.read_bytes(), str(path))),
    "CAN Simple": reader_of(_simple_frames, _simple),
    "simulated module": reader_of(_simple_frames, _simple_module),
    "Modbus client": reader_of(_modbus_replies, _modbus_client, errors=(PassedOver,), names=unshown),
    "Modbus station": reader_of(_modbus_requests, _modbus_station, errors=(PassedOver,), names=unshown),
}
