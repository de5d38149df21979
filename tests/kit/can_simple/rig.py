"""A scan over simulated CAN Simple modules, beside simulated CANopen drives, in virtual time, with a look at the sent frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import SimpleNamespace

from axisbus.cia301.frame import CanFrame
from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.core.inprocess import InProcess
from axisbus.core.scan import Scan
from axisbus.drives.gim6010.can_simple.port import error_words
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings, TorqueSettings
from axisbus.drives.gim6010.sim.module import Module
from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.groups import Group
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.parameters import AxisLimits, AxisParameters, Defaults, HomingParameters, Units
from axisbus.sim.device import Device
from axisbus.units import Scale
from kit.direct.cycle import DirectCycle, DirectPort
from kit.direct.waiting import PumpWaiter
from kit.motion.rig import GENERIC, dictionary_of
from kit.motion.rig import parameters as canopen_parameters

PERIOD = 0.01
STEP = 0.001
COUNTS = 16384
PER_DEGREE = COUNTS * 8 / 360.0  # at the output
SETTINGS = ModuleSettings(
    5,
    velocity_limit=20.0,
    current_limit=20.0,
    velocity_ramp=40.0,
    acceleration=80.0,
    period=PERIOD,
    torque=TorqueSettings(constant=0.097, rated=0.625, ramp=5.0),
)
# The module's own parameters that the settings speak of.
OWN = {"vel_ramp_rate": 40.0, "torque_ramp_rate": 5.0}


def parameters(name: str, port: ModulePort, **changes) -> AxisParameters:
    """An axis in degrees of the output."""
    base = AxisParameters(
        name,
        Units(
            Scale.of(PER_DEGREE, "deg"),
            Scale.of(PER_DEGREE, "deg/s"),
            Scale.of(PER_DEGREE, "deg/s²"),
            ratio_known=True,
            rated_torque=5.0,
        ),
        limits=AxisLimits(velocity=800.0),
        defaults=Defaults(velocity=180.0, acceleration=720.0),
        homing=HomingParameters(method=37),
        objects=port.objects.indices,
        modes=frozenset(
            mode
            for mode, facts in FACTS.items()
            if _known(port, mode) and all(o in port.objects.indices for o in facts.required)
        )
        | {ModeOfOperation.HOMING},
        fault_objects=error_words.ADDRESSES,
        explain_fault=error_words.explain,
        scan_period=PERIOD,
        node=port.settings.node,
    )
    return replace(base, **changes)


def _known(port: ModulePort, mode: ModeOfOperation) -> bool:
    word, _ = port.objects.read(0x6502)
    return bool((word or 0) >> FACTS[mode].supported_bit & 1)


@dataclass
class Sent:
    """A frame of the master, with its time."""

    time: float
    can_id: int
    data: bytes
    remote: bool

    @property
    def command(self) -> int:
        return self.can_id & 0x1F


class ModuleCycle(DirectCycle):
    """A bus in virtual time with modules on it; ``sent`` are the master's frames, ``lose`` says which of either side are lost."""

    def __init__(self, modules: list[tuple[ModulePort, Module]], ports: list[DirectPort]) -> None:
        super().__init__(ports)
        self.modules = modules
        self.sent: list[Sent] = []
        self.states: list[
            tuple[float, int]
        ] = []  # of the first module: when a heartbeat with which state was received
        self.plants: list[list[tuple[float, float, float]]] = [[] for _ in modules]
        self.lose: Callable[[str, int, float], bool] = lambda side, command, now: False  # noqa: ARG005

    def _advance(self, t: float) -> None:
        while t - self._now > 1e-12:
            super()._advance(min(t, self._now + STEP))
            for number, (port, module) in enumerate(self.modules):
                module.step(self._now)
                self.plants[number].append((self._now, module.position, module.shaft.speed))
                self._deliver(port, module)

    def _deliver(self, port: ModulePort, module: Module) -> None:
        for can_id, data in module.take_frames():
            if not self.lose("module", can_id & 0x1F, self._now):
                if can_id & 0x1F == 1 and module is self.modules[0][1]:
                    self.states.append((self._now, data[4]))
                port.receive(CanFrame(self._now, can_id, bytes(data)), self._now)

    def commit(self) -> None:
        super().commit()
        for port, module in self.modules:
            self.send(port, module, port.take_frames())

    def send(self, port: ModulePort, module: Module, frames) -> None:
        """Let frames of the master go to a module."""
        for frame in frames:
            self.sent.append(Sent(self._now, frame.can_id, frame.data, frame.remote))
            if not self.lose("master", frame.can_id & 0x1F, self._now):
                module.on_frame(frame.can_id, frame.data, self._now, remote=frame.remote)
        self._deliver(port, module)

    def quick_stop_all(self) -> bool:
        for port, module in self.modules:
            self.send(port, module, port.stop_frames())
        return super().quick_stop_all()


@dataclass
class Rig:
    """The scan and its modules; the first module is ``module``, its axis ``axis``."""

    scan: Scan
    cycle: ModuleCycle
    axes: dict[str, Axis]
    groups: dict[str, Group]
    devices: list[Device] = field(default_factory=list)
    rough: bool = False  # something from outside jolts the rotor

    @property
    def port(self) -> ModulePort:
        return self.cycle.modules[0][0]

    @property
    def module(self) -> Module:
        return self.cycle.modules[0][1]

    @property
    def axis(self) -> Axis:
        return next(iter(self.axes.values()))

    @property
    def core(self) -> AxisCore:
        return self.scan.axes[self.axis.name]

    @property
    def now(self) -> float:
        return self.cycle.now()

    @property
    def degrees(self) -> float:
        """The true position of the first module's output, relative to its rotor at construction."""
        return self.module.position * 45.0

    def run(self, seconds: float) -> None:
        """Let time pass with the scan."""
        end = self.now + seconds
        while self.now < end and not self.scan.ended:
            self.scan.waiter_pump.run_cycle()

    def until(self, done, limit: float = 10.0) -> float:
        """Let time pass until ``done()``; return the seconds."""
        start = self.now
        while not done():
            assert self.now - start < limit, f"not within {limit} s"
            self.scan.waiter_pump.run_cycle()
        return self.now - start

    def commands(self, since: float = 0.0, *, questions: bool = False) -> list[int]:
        """The commands that the master has sent since."""
        return [
            each.command for each in self.cycle.sent if each.time >= since and (questions or not each.remote)
        ]

    def enabled(self) -> Rig:
        """Enable every axis."""
        for axis in self.axes.values():
            axis.enable().wait(5)
        return self

    def must_be_smooth(self, hardest: float, since: float = 0.0) -> None:
        """No plant of a module exceeded its velocity, or changed it harder than ``hardest`` turns/s²."""
        for plant in self.cycle.plants:
            for (t, x, v), (t2, x2, v2) in pairwise(each for each in plant if each[0] >= since):
                dt = t2 - t
                assert abs(x2 - x) <= max(abs(v), abs(v2)) * dt + 0.5 * hardest * dt * dt + 1e-5, (
                    t,
                    x,
                    x2,
                    v,
                    v2,
                )
                assert abs(v2 - v) <= hardest * dt + 0.02, (t, v, v2)


def judge(rig: Rig) -> None:
    """Check the invariants of all frames of a master to a module, by numbers of the test's own (manual v2.2, 4.1.2)."""
    allowed = {0x02, 0x03, 0x07, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x11, 0x12, 0x14, 0x18}
    asked_for_idle = 0.0
    for each in rig.cycle.sent:
        assert each.command in allowed, hex(each.command)
        assert len(each.data) == (0 if each.remote else 8)
        first = int.from_bytes(each.data[:4], "little")
        if each.command == 0x07:
            assert first in (1, 8)
            asked_for_idle = each.time if first == 1 else asked_for_idle
        if each.command == 0x0B:
            modes = (first, int.from_bytes(each.data[4:], "little"))
            assert modes in {(3, 5), (3, 3), (2, 2), (1, 6)}, modes
        if each.command == 0x0C:
            told = [state for time, state in rig.cycle.states if asked_for_idle < time <= each.time]
            assert told, "a position before any heartbeat"
            assert told[-1] == 8, "a position to a module that is not in closed loop, by its heartbeat"


def rig(
    canopen: str = "",
    *,
    settings: ModuleSettings = SETTINGS,
    module: Module | None = None,
    groups: dict[str, list[str]] | None = None,
    warm: float = 0.3,
    **changes,
) -> Rig:
    """Build a rig: one module as axis ``m``, and a CANopen simulated drive for each letter of ``canopen``; let ``warm`` s pass."""
    module = module or Module(settings.node, **OWN)
    port = ModulePort(settings)
    dictionary = dictionary_of(GENERIC)
    devices = [Device(dictionary, number + 1) for number in range(len(canopen))]
    direct = {name: DirectPort(device) for name, device in zip(canopen, devices, strict=True)}
    cycle = ModuleCycle([(port, module)], list(direct.values()))
    cores = {"m": AxisCore(parameters("m", port, **changes), port.capabilities)}
    cores |= {
        name: AxisCore(canopen_parameters(name, dictionary, node=number + 1), each.capabilities)
        for number, (name, each) in enumerate(direct.items())
    }
    scan = Scan(cycle, {"m": port, **direct}, cores, PERIOD, groups or {})
    scan.waiter_pump = waiter = PumpWaiter(scan)
    commanding = CommandDispatcher(InProcess(scan, waiter, SimpleNamespace(nodes={}, link=None)))
    axes = {name: Axis(core.parameters, commanding) for name, core in cores.items()}
    fronts = {
        name: Group(name, {each: axes[each] for each in members}, commanding)
        for name, members in (groups or {}).items()
    }
    made = Rig(scan, cycle, axes, fronts, devices)
    made.run(warm)
    return made
