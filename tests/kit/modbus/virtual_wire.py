"""A wire in virtual time: simulated modules answer, and a late answer arrives during a later request."""

from __future__ import annotations

import json
from collections.abc import Callable

from axisbus.drives.gim6010.can_simple.endpoints import Firmware, parse
from axisbus.drives.gim6010.modbus.requests import ModbusRequest, ModbusTimeout, Reply
from axisbus.drives.gim6010.sim.modbus.station import Station, checksum, framed

_TURN = 0.002  # s from a request to its answer
_STEP = 0.001


class VirtualWire:
    """Carries bytes between a client and stations; holds the time, and the losses and actions at each request.

    ``before``: called with each request before it is sent; may raise or change settings. ``broken``: neither direction carries.
    ``mute``: answers do not return.
    """

    def __init__(self, *stations: Station, timeout: float = 0.2) -> None:
        self.stations = stations
        self.timeout = timeout
        self.time = 0.0
        self.asked: list[ModbusRequest] = []
        self.before: Callable[[ModbusRequest], None] = lambda _: None
        self.broken = self.mute = False
        self.closed = False

    def exchange(self, device: int, request: ModbusRequest) -> Reply:
        self.before(request)
        self.asked.append(request)
        self._collect()
        if not self.broken:
            for station in self.stations:
                station.take(framed(request.frame(device)), self.time)
        end = self.time + self.timeout
        self._pass(_TURN)
        while True:
            came = b"" if self.broken or self.mute else self._collect()
            reply = _reply(came, device)
            if reply is not None:
                return reply
            if self.time >= end:
                raise ModbusTimeout
            self._pass(_STEP if self._busy else 0.02)

    def drain(self, seconds: float) -> None:
        self._pass(seconds)
        self._collect()

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self._pass(seconds)

    def close(self) -> None:
        self.closed = True

    @property
    def _busy(self) -> bool:
        return any(station.owes for station in self.stations)

    def _collect(self) -> bytes:
        return b"".join(station.due(self.time) for station in self.stations)

    def _pass(self, seconds: float) -> None:
        self.time += seconds
        for station in self.stations:
            station.step(self.time)


def _reply(data: bytes, device: int) -> Reply | None:
    """The first frame as a value, by the rules of Modbus; None without a correct one."""
    if len(data) < 5 or data[0] != device:
        return None
    function = data[1]
    size = 5 if function & 0x80 else 5 + data[2] if function in (3, 4) else 8
    frame = data[:size]
    if len(frame) < size or checksum(frame[:-2]) != frame[-2:]:
        return None
    words = tuple(int.from_bytes(frame[at : at + 2], "big") for at in range(3, size - 2, 2))
    if function & 0x80:
        return Reply(function, exception=frame[2])
    if function in (3, 4):
        return Reply(function, words)
    address, last = (int.from_bytes(frame[at : at + 2], "big") for at in (2, 4))
    return Reply(function, (last,), address) if function == 6 else Reply(function, (), address, last)


def list_of(station: Station):
    """The list of endpoints of a station's firmware, and the version that it is for."""
    text = json.dumps(station.module.json())
    return parse(text, "list.json"), Firmware(*station.module.firmware)
