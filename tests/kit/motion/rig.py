"""A rig for motion tests: simulated drives on direct ports in virtual time, with axes, groups and the scan on top."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

from axisbus import eds
from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.core.inprocess import InProcess
from axisbus.core.scan import Scan
from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.groups import Group
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.parameters import AxisLimits, AxisParameters, Defaults, HomingParameters, Units
from axisbus.sim.device import Device
from axisbus.sim.motor import MotorParams
from axisbus.units import Scale
from kit.direct.cycle import DirectCycle, DirectPort
from kit.direct.waiting import PumpWaiter

GENERIC = Path(__file__).parents[3] / "eds" / "generic-cia402.eds"
SCALE = 1000.0  # increments per degree
PERIOD = 0.01
BLIND = 10**9  # a following error that is never noticed, for the monitoring after it
MODE = ModeOfOperation


def parameters(name: str, dictionary, **changes) -> AxisParameters:
    """An axis in degrees with everything set; ``changes`` replace fields."""
    scale = Scale.of(SCALE, "deg")
    objects = frozenset(index for index in dictionary.objects)
    base = AxisParameters(
        name,
        Units(
            scale, Scale.of(SCALE, "deg/s"), Scale.of(SCALE, "deg/s²"), ratio_known=True, rated_torque=10.0
        ),
        limits=AxisLimits(velocity=400.0),
        defaults=Defaults(velocity=100.0, acceleration=500.0),
        homing=HomingParameters(method=37),
        objects=objects,
        modes=frozenset(mode for mode, facts in FACTS.items() if all(o in objects for o in facts.required)),
        scan_period=PERIOD,
        node=1,
    )
    return replace(base, **changes)


@dataclass
class Rig:
    """A scan over simulated drives; ``axis`` and ``drive`` are the first."""

    scan: Scan
    axes: dict[str, Axis]
    groups: dict[str, Group]
    devices: list[Device]
    cycle: DirectCycle
    ports: dict[str, DirectPort]
    session: InProcess
    log: list = field(default_factory=list)

    @property
    def axis(self) -> Axis:
        return next(iter(self.axes.values()))

    @property
    def device(self) -> Device:
        return self.devices[0]

    @property
    def drive(self):
        return self.devices[0].drives[0]

    @property
    def core(self) -> AxisCore:
        return self.scan.axes[self.axis.name]

    @property
    def now(self) -> float:
        return self.cycle.now()

    def drive_of(self, name: str):
        """The simulated drive of an axis."""
        return self.devices[list(self.axes).index(name)].drives[0]

    def run(self, seconds: float) -> None:
        """Let time pass with the scan running."""
        end = self.cycle.now() + seconds
        while self.cycle.now() < end and not self.scan.ended:
            self.scan.waiter_pump.run_cycle()

    def until(self, done, limit: float = 10.0) -> float:
        """Let time pass until ``done()``; return the seconds it took."""
        start = self.now
        while not done():
            assert self.now - start < limit, f"not within {limit} s of virtual time"
            self.scan.waiter_pump.run_cycle()
        return self.now - start

    def enabled(self) -> Rig:
        """Enable every axis."""
        for axis in self.axes.values():
            axis.enable().wait(5)
        return self

    def group(self, *names: str) -> Group:
        """Make a group that no fault policy knows."""
        title = "+".join(names)
        self.scan.add_group(title, list(names))
        axes = {name: self.axes[name] for name in names}
        return Group(title, axes, self.axis._commanding)


@cache
def dictionary_of(file: Path) -> eds.model.Eds:
    """An EDS is read once for all tests; simulated drives do not change it."""
    return eds.load(file)


def rig(
    names: str = "x",
    *,
    port: dict | None = None,
    file: Path = GENERIC,
    motor: MotorParams | None = None,
    groups: dict[str, list[str]] | None = None,
    each: dict[str, dict] | None = None,
    **changes,
) -> Rig:
    """Build a rig with one simulated drive per letter of ``names``.

    ``port`` are DirectPort options, ``changes`` axis parameters (``each``: of single axes), ``motor`` the plant of every drive,
    ``groups`` those that the fault policy knows (by default one of all).
    """
    dictionary = dictionary_of(file)
    devices = [Device(dictionary, number + 1, params=motor) for number in range(len(names))]
    ports = {name: DirectPort(device, **(port or {})) for name, device in zip(names, devices, strict=True)}
    cycle = DirectCycle(list(ports.values()))
    cores = {
        name: AxisCore(
            parameters(name, dictionary, **({"node": number + 1} | changes | (each or {}).get(name, {}))),
            ports[name].capabilities,
        )
        for number, name in enumerate(names)
    }
    if groups is None:
        groups = {"all": list(names)} if len(names) > 1 else {}
    scan = Scan(cycle, ports, cores, PERIOD, groups)
    waiter = PumpWaiter(scan)
    scan.waiter_pump = waiter
    commanding = CommandDispatcher(session := InProcess(scan, waiter, SimpleNamespace(nodes={}, link=None)))
    axes = {name: Axis(core.parameters, commanding) for name, core in cores.items()}
    fronts = {
        name: Group(name, {axis: axes[axis] for axis in members}, commanding)
        for name, members in groups.items()
    }
    waiter.run_cycle()
    return Rig(scan, axes, fronts, devices, cycle, ports, session)
