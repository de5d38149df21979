"""One simulated module behind a relay in virtual time, and what a listener on the other side hears of it."""

from __future__ import annotations

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.orders import TRAPEZOID, Orders
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.settings import HEARTBEAT_BY_LINE, ModuleSettings
from axisbus.drives.gim6010.modbus.can_emulation import Relay
from axisbus.drives.gim6010.sim.modbus.station import Station, StationFaults
from kit.modbus.virtual_wire import VirtualWire, list_of

SETTINGS = ModuleSettings(1, 20.0, 10.0, 40.0, 80.0, 0.02, heartbeat=HEARTBEAT_BY_LINE, relayed=True)
ORDERS = Orders(SETTINGS.node)
STATE = 0x63


class RelayLine:
    """One station behind a relay; its answers go into a ``ModuleFeedback``."""

    def __init__(self, *, listed=True, calibrates=False, **dials):
        self.station = Station(dials=StationFaults(**dials))
        self.wire = VirtualWire(self.station, timeout=0.1)
        self.relay = Relay(self.wire, {1: list_of(self.station) if listed else None}, calibrates=calibrates)
        self.hearing = ModuleFeedback(SETTINGS)
        self.told = []
        self.wire.sleep(0.0)

    @property
    def plant(self):
        return self.station.module

    def give(self, *frames):
        for each in frames:
            self.relay.take(each.can_id, each.data, each.remote)

    def work(self, pieces=1):
        for _ in range(pieces):
            for can_id, data in self.relay.work():
                self.told.append((can_id, data))
                self.hearing.take(CanFrame(self.wire.time, can_id, data), self.wire.time)

    def settle(self):
        for _ in range(50):
            if self.relay.is_idle:
                return
            self.work()

    def until(self, seconds):
        end = self.wire.time + seconds
        while self.wire.time < end:
            self.work()

    def enable(self):
        self.give(
            ORDERS.limits(SETTINGS.velocity_limit, SETTINGS.current_limit),
            ORDERS.velocity(0.0),
            ORDERS.mode(TRAPEZOID),
            ORDERS.closed_loop(),
        )
        self.settle()
        self.until(0.5)

    @property
    def written(self):
        """The writes on the line: address and value, in order."""
        return [
            (int.from_bytes(frame[2:4], "big"), frame[4:6] if frame[1] == 6 else frame[7:])
            for frame in self.station.frames
            if frame[1] in (0x06, 0x10)
        ]

    @property
    def states(self):
        """The states that were asked for."""
        return [int.from_bytes(data, "big") for address, data in self.written if address == STATE]
