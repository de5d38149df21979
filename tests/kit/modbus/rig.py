"""A module on a wire in virtual time: its registers, and the module itself."""

from __future__ import annotations

from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.sim.modbus.station import Station, StationFaults
from kit.modbus.virtual_wire import VirtualWire

RAMP = 20.0  # turns/s² of the module's own ramp, which no register contains
_SETTINGS = {"axis0.controller.config.vel_ramp_rate": RAMP, "axis0.controller.config.torque_ramp_rate": 1.0}


class Rig:
    """One station with a quick ramp, and its wire."""

    def __init__(self, turns: float = 0.0, **dials: object) -> None:
        self.station = Station(dials=StationFaults(**dials))
        for path, value in _SETTINGS.items():
            self.plant.usb_write(path, value)
        self.plant.motor.position = turns * 16384
        self.wire = VirtualWire(self.station)
        self.module = ModbusModule(self.wire, 1)
        self.wire.sleep(0.0)

    @property
    def plant(self):
        """The module itself."""
        return self.station.module

    @property
    def written(self) -> list[str]:
        """The writes, in hex, without the address."""
        return [frame[1:].hex(" ").upper() for frame in self.station.frames if frame[1] in (0x06, 0x10)]

    def rest(self, seconds: float = 0.5) -> None:
        """Let time pass without a word."""
        self.wire.sleep(seconds)
