"""A scan over a module on RS485 in virtual time: the axis, its port, the relay, a wire, and the simulated station."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

from axisbus.cia301.frame import CanFrame
from axisbus.cia402.modes import ModeOfOperation
from axisbus.core.inprocess import InProcess
from axisbus.core.scan import Scan
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.settings import HEARTBEAT_BY_LINE, ModuleSettings, TorqueSettings
from axisbus.drives.gim6010.modbus.can_emulation import Relay
from axisbus.drives.gim6010.sim.modbus.station import Station, StationFaults
from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.motion.axis.core import AxisCore
from kit.can_simple.rig import ModuleCycle, Rig, parameters
from kit.direct.waiting import PumpWaiter
from kit.modbus.virtual_wire import VirtualWire, list_of

PERIOD = 0.02
TURN = 45.0  # degrees of the output for a turn of the rotor
POSITION, VELOCITY, TORQUE = (
    ModeOfOperation.PROFILE_POSITION,
    ModeOfOperation.PROFILE_VELOCITY,
    ModeOfOperation.PROFILE_TORQUE,
)
_SETTINGS = ModuleSettings(
    1, 20.0, 10.0, 40.0, 80.0, PERIOD, heartbeat=HEARTBEAT_BY_LINE, relayed=True, remote=True
)
_TORQUE = TorqueSettings(constant=0.097, rated=0.625, ramp=5.0)
_ENDPOINT = b"\0\xa1"
_OWN = {
    "axis0.controller.config.vel_ramp_rate": 40.0,
    "axis0.controller.config.torque_ramp_rate": 5.0,
}


class LineCycle(ModuleCycle):
    """The bus of one module: its frames go to a relay, which works on the wire while time passes."""

    def __init__(self, port: ModulePort, station: Station) -> None:
        super().__init__([(port, station.module)], [])
        self.wire = VirtualWire(station, timeout=0.1)
        self.relay = Relay(self.wire, {port.settings.node: list_of(station)})
        self.failure: Exception | None = None
        self._told: list[CanFrame] = []

    def _advance(self, t: float) -> None:
        port, module = self.modules[0]
        self.wire.sleep(0.0)
        while self.wire.time < t:
            self._work()
            self.plants[0].append((self.wire.time, module.position, module.shaft.speed))
        self._now = max(self._now, t)
        for frame in self._told:
            port.receive(frame, min(frame.time, t))
        self._told.clear()

    def _work(self) -> None:
        try:
            told = self.relay.work()
        except Exception as error:  # noqa: BLE001  # as the bus does: stops are still sent
            self.failure = self.failure or error
            return
        if self.failure is None:
            self._told += [CanFrame(self.wire.time, can_id, data) for can_id, data in told]

    def send(self, port, module, frames) -> None:
        for frame in frames:
            self.relay.take(frame.can_id, frame.data, frame.remote)

    def _deliver(self, port, module) -> None:
        pass


class LineRig(Rig):
    """As ``Rig``; ``station`` is the simulated module on the line."""

    station: Station

    @property
    def written(self) -> list[tuple[int, bytes]]:
        """The writes on the line, except the selection of an endpoint: address and value, in order."""
        return [
            (int.from_bytes(frame[2:4], "big"), bytes(frame[4:6] if frame[1] == 6 else frame[7:]))
            for frame in self.station.frames
            if frame[1] in (0x06, 0x10) and frame[2:4] != _ENDPOINT
        ]

    @property
    def velocity(self) -> float:
        """True velocity of the output in deg/s."""
        return self.module.shaft.speed * TURN

    @property
    def is_off(self) -> bool:
        return not self.module.energised


def line_rig(
    mode: ModeOfOperation = POSITION,
    *,
    warm: float = 1.0,
    turns: float = 0.0,
    changes: dict[str, object] | None = None,
    **dials,
) -> LineRig:
    """Build a rig of one module, whose axis ``m`` has ``mode`` and homing; let ``warm`` s pass.

    ``changes`` are other parameters of the axis, ``dials`` the fault settings of the line.
    """
    settings = replace(_SETTINGS, line_mode=mode, torque=_TORQUE if mode is TORQUE else None)
    station = Station(dials=StationFaults(**dials))
    for path, value in _OWN.items():
        station.module.usb_write(path, value)
    station.module.motor.position = turns * 16384
    port = ModulePort(settings)
    cycle = LineCycle(port, station)
    cores = {"m": AxisCore(parameters("m", port, scan_period=PERIOD, **(changes or {})), port.capabilities)}
    scan = Scan(cycle, {"m": port}, cores, PERIOD, {})
    scan.waiter_pump = waiter = PumpWaiter(scan)
    commanding = CommandDispatcher(InProcess(scan, waiter, SimpleNamespace(nodes={}, link=None)))
    axes = {name: Axis(core.parameters, commanding) for name, core in cores.items()}
    made = LineRig(scan, cycle, axes, {}, [])
    made.station = station
    made.run(warm)
    return made
