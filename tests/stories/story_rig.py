"""The stage of the stories: a cell of stand-ins in virtual time, the motors behind it, and the look at whether they stand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

from story_nets import PlantMoves

from axisbus.errors import AxisbusError
from axisbus.machine import direct
from axisbus.machine.machine import Machine
from axisbus.motion.axis import Axis
from axisbus.motion.core import AxisCore
from axisbus.motion.handle import Handle
from axisbus.sim.device import Device
from axisbus.sim.direct import DirectCycle, DirectPort
from axisbus.sim.drive import Drive

SCALE = 100  # increments per degree
GENERIC, MODULE = "builtin:generic-cia402", "builtin:gim6010-8"

# The stand-in's own numbers of its power-stage states (figure of CiA 402-2 7.2).
NOT_READY, SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, REACTION, FAULT = range(8)
OFF = (SWITCH_ON_DISABLED, READY, SWITCHED_ON, FAULT)  # the motor is not energised
STAGE_NAMES = (
    "not ready to switch on",
    "switch on disabled",
    "ready to switch on",
    "switched on",
    "operation enabled",
    "quick stop active",
    "fault reaction active",
    "fault",
)

BUS = """\
[bus]
interface = "{interface}"
{channel}scan_period = "{period}"
heartbeat = "{heartbeat}"
"""
AXIS = """
[nodes.{node}]
eds = "{eds}"
[axes.{name}]
node = {node}
unit = "deg"
scale = {scale}
max_velocity = 400.0
{axis}
[axes.{name}.defaults]
velocity = 100.0
acceleration = 500.0
[axes.{name}.homing]
method = 35
required = false
[axes.{name}.stop]
quick_stop = "ramp"
halt = "slow-ramp"
disable = "slow-ramp"
fault = "ramp"
deceleration = 1000.0
{stop}
"""


def cell_text(
    names: str = "x",
    *,
    interface: str = "sim",
    channel: str = "",
    period: str = "10ms",
    heartbeat: str = "100ms",
    eds: str = GENERIC,
    axis: str = "",
    stop: str = "",
    more: str = "",
) -> str:
    """Return a cell file with one node for each letter of ``names``; ``axis`` and ``stop`` are lines for every axis's tables."""
    channel_line = f'channel = "{channel}"\n' if channel else ""
    text = BUS.format(interface=interface, channel=channel_line, period=period, heartbeat=heartbeat)
    for node, name in enumerate(names, start=1):
        text += AXIS.format(node=node, name=name, eds=eds, scale=SCALE, axis=axis, stop=stop)
        for key in (
            "quick_stop",
            "halt",
            "disable",
            "fault",
        ):  # a line of the story's own replaces the usual one
            if f"\n{key} =" in f"\n{stop}":
                text = _without_first(text, key)
    return text + more


def _without_first(text: str, key: str) -> str:
    """Take the usual line of ``key`` out of the last axis's stop table."""
    head, table, tail = text.rpartition("[axes.")
    lines = tail.splitlines(keepends=True)
    lines.remove(next(line for line in lines if line.startswith(f"{key} =")))
    return head + table + "".join(lines)


class Cell:
    """A simulated machine in virtual time with its plant; ``x`` is its first axis."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        cycle = machine.scan.cycle
        assert isinstance(cycle, DirectCycle)
        self.cycle = cycle

    @property
    def x(self) -> Axis:
        return next(iter(self.machine))

    def __getitem__(self, name: str) -> Axis:
        return self.machine[name]

    def device(self, name: str = "x") -> Device:
        """The node behind an axis."""
        return self.machine.stand_in(self.machine.cell.axes[name].node).device

    def drive(self, name: str = "x") -> Drive:
        """The drive behind an axis."""
        return self.device(name).drives[self.machine.cell.axes[name].drive_axis - 1]

    def core(self, name: str = "x") -> AxisCore:
        """What the master thinks of an axis."""
        return self.machine.scan.axes[name]

    def port(self, name: str = "x") -> DirectPort:
        """How an axis reaches its drive."""
        return next(port for port in self.cycle.ports if port.drive is self.drive(name))

    @property
    def now(self) -> float:
        return self.cycle.now()

    # -- time ------------------------------------------------------------------------------------------------------------

    def run(self, seconds: float) -> None:
        """Let time pass for the plant; the scan runs along while it lives."""
        end = self.now + seconds
        while self.now < end - 1e-9:
            if self.machine.scan.ended:
                self.cycle.dials.wait = None
                self.cycle.wait_until(min(end, self.now + 0.01))
            else:
                self.machine.sleep(0.0101)

    def until(self, happened: Callable[[], bool], limit: float = 5.0) -> float:
        """Let time pass until something has happened; return the seconds that it took."""
        start = self.now
        while not happened():
            assert self.now - start < limit, f"it has not happened within {limit} s"
            self.run(0.01)
        return self.now - start

    def end_of(self, handle: Handle, limit: float = 10.0) -> AxisbusError | None:
        """Let time pass until a command has ended; return what ended it badly."""
        self.until(lambda: not handle.busy, limit)
        return handle.exception()

    def failure_of(self, handle: Handle, limit: float = 10.0) -> AxisbusError:
        """As ``end_of``, for a command that must end badly."""
        error = self.end_of(handle, limit)
        assert error is not None, f"{handle!r} ended well"
        return error

    # -- beginnings ------------------------------------------------------------------------------------------------------

    def enabled(self) -> Cell:
        """Enable every axis."""
        for axis in self.machine:
            axis.enable().wait(5)
        return self

    def turning(self, velocity: float = 90.0, names: str | None = None) -> list[Handle]:
        """Enable all and let them turn at constant velocity, which nothing but a stop ends; return their handles."""
        self.enabled()
        handles = [
            axis.move_velocity(velocity) for axis in self.machine if names is None or axis.name in names
        ]
        for handle in handles:
            handle.wait(5)
        for axis in self.machine:
            if names is None or axis.name in names:
                self.must_move(axis.name)
        return handles

    def travelling(self, distance: float = 2000.0, velocity: float = 100.0) -> list[Handle]:
        """Enable all and send them on a way of many seconds; return their handles."""
        self.enabled()
        handles = [axis.move_relative(distance, velocity=velocity) for axis in self.machine]
        self.run(0.5)
        for axis in self.machine:
            self.must_move(axis.name)
        return handles

    # -- looks at the plant ----------------------------------------------------------------------------------------------

    def speed(self, name: str = "x") -> float:
        """The motor's speed in degrees/s."""
        return abs(self.drive(name).axis.motor.velocity) / SCALE

    def where(self, name: str = "x") -> float:
        """The motor's position in degrees."""
        return self.drive(name).axis.motor.position / SCALE

    def stage(self, name: str = "x") -> int:
        """The state of the power stage, by the stand-in's number."""
        return int(self.drive(name).power.stage)

    def must_move(self, name: str = "x", faster_than: float = 20.0) -> None:
        """Make sure that the story begins (or goes on) in motion."""
        assert self.speed(name) > faster_than, f"{name} does not move: {self.speed(name):g} deg/s"

    def must_stand(
        self, name: str = "x", *, within: float, stages: int | tuple[int, ...], for_good: float = 1.0
    ) -> float:
        """Let time pass until the motor stands in one of ``stages``, and ``for_good`` seconds more, in which both must stay so.

        Return the seconds that it took.

        Raises:
            PlantMoves: it does not.
        """
        wanted = (stages,) if isinstance(stages, int) else stages
        start = self.now
        while self.speed(name) > 0.0 or self.stage(name) not in wanted:
            if self.now - start > within:
                raise PlantMoves(f"after {within:g} s: {self.told(name)}")
            self.run(0.01)
        took, place = self.now - start, self.where(name)
        self.run(for_good)
        if self.speed(name) > 0.0 or self.stage(name) not in wanted or abs(self.where(name) - place) > 0.05:
            raise PlantMoves(f"{for_good:g} s after it stood at {place:g}: {self.told(name)}")
        return took

    def must_be(self, stages: int | tuple[int, ...], name: str = "x") -> None:
        """Make sure that the power stage is in one of ``stages`` now.

        Raises:
            PlantMoves: it is not.
        """
        if self.stage(name) not in ((stages,) if isinstance(stages, int) else stages):
            raise PlantMoves(self.told(name))

    def must_have_come(self, name: str, start: float, between: tuple[float, float]) -> None:
        """Make sure that a motor that stands now has braked on a ramp: how far it came from ``start``, in degrees.

        Raises:
            PlantMoves: it stopped with a jolt, or too late.
        """
        if not between[0] <= abs(self.where(name) - start) <= between[1]:
            raise PlantMoves(
                f"{name} came from {start:g} deg to rest at {self.where(name):g} deg, not {between} deg away"
            )

    def told(self, name: str = "x") -> str:
        """The plant of an axis in words."""
        return (
            f"{name} turns at {self.speed(name):g} deg/s at {self.where(name):g} deg, "
            f"{STAGE_NAMES[self.stage(name)]}"
        )


class Stage:
    """Makes cells in a folder; lets them all go at its end."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._cells: list[Machine] = []

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *_: object) -> None:
        for machine in self._cells:
            machine._signals.restore()
            machine.scan.ended = True

    def file(self, text: str) -> Path:
        """Write a cell file."""
        path = self.folder / "cell.toml"
        path.write_text(text, encoding="utf-8")
        return path

    def simulated(
        self,
        names: str = "x",
        *,
        port: Mapping[str, object] | None = None,
        devices: Callable[[], Mapping[int, Device]] | None = None,
        text: str | None = None,
        **changes: str,
    ) -> Cell:
        """Open a simulated cell; ``port``: options of ``DirectPort``, ``changes``: see ``cell_text``."""
        path = self.file(text if text is not None else cell_text(names, **changes))
        with ExitStack() as stack:
            if port:
                stack.enter_context(
                    patch.object(
                        direct,
                        "_port",
                        lambda _, axis, device: DirectPort(device, axis.drive_axis - 1, **port),
                    )
                )
            machine = Machine.simulated(path, devices() if devices else None)
        self._cells.append(machine)
        return Cell(machine)
