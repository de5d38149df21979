"""Cells of simulated drives for tests, in virtual time or in real time on a private bus; each is a plant probe."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any

from axisbus.bus.cycle import CanCycle
from axisbus.bus.port import CanPort
from axisbus.cia301.nmt import NmtCommand
from axisbus.clock import Clock, VirtualClock
from axisbus.errors import AxisbusError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.machine.signal_shutdown import EXIT
from axisbus.motion.axis.core import AxisCore
from axisbus.sim.device import Device
from axisbus.sim.drive import Drive
from axisbus.sim.virtual_can import VirtualWire
from kit.bus_faults import BusFaults
from kit.pages import ROOT
from kit.plant_probe import PlantProbe
from kit.value_transport import Travels, transported

SCALE = 100  # increments per degree
GENERIC, MODULE = "builtin:generic-cia402", "builtin:gim6010-8"

BUS = """\
[bus]
interface = "{interface}"
{channel}scan_period = "{period}"
heartbeat = "{heartbeat}"
{bus}"""
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


def with_identity(vendor_id: int, product_code: int) -> str:
    """Return the EDS of the generic drive with this identity in 1018h."""
    text = (ROOT / "eds" / "generic-cia402.eds").read_text(encoding="utf-8")
    for subindex, value in ((1, vendor_id), (2, product_code)):
        at = text.index("DefaultValue=", text.index(f"[1018sub{subindex}]"))
        text = text[:at] + f"DefaultValue={value:#x}" + text[text.index("\n", at) :]
    return text


def cell_text(
    names: str = "x",
    *,
    interface: str = "sim",
    channel: str = "",
    period: str = "10ms",
    heartbeat: str = "100ms",
    eds: str = GENERIC,
    bus: str = "",
    axis: str = "",
    stop: str = "",
    more: str = "",
) -> str:
    """Return a cell file with one node for each letter of ``names``.

    ``bus`` are lines for its table, ``axis`` and ``stop`` for those of every axis.
    """
    channel_line = f'channel = "{channel}"\n' if channel else ""
    text = BUS.format(
        interface=interface,
        channel=channel_line,
        period=period,
        heartbeat=heartbeat,
        bus=f"{bus}\n" if bus else "",
    )
    for node, name in enumerate(names, start=1):
        text += AXIS.format(node=node, name=name, eds=eds, scale=SCALE, axis=axis, stop=stop)
        for key in (
            "quick_stop",
            "halt",
            "disable",
            "fault",
        ):  # a line of the scenario's own replaces the usual one
            if f"\n{key} =" in f"\n{stop}":
                text = _without_first(text, key)
    return text + more


def cell_file(folder: Path, names: str = "x", **changes: str) -> Path:
    """Write the cell file of ``cell_text`` into a folder, and return it."""
    path = folder / "cell.toml"
    path.write_text(cell_text(names, **changes), encoding="utf-8")
    return path


def _without_first(text: str, key: str) -> str:
    """Take the usual line of ``key`` out of the last axis's stop table."""
    head, table, tail = text.rpartition("[axes.")
    lines = tail.splitlines(keepends=True)
    lines.remove(next(line for line in lines if line.startswith(f"{key} =")))
    return head + table + "".join(lines)


class Cell(PlantProbe):
    """A simulated machine with its plant, in virtual time or in real time on a private bus; ``x`` is its first axis."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.is_virtual = not machine._core.realtime
        self._faults: BusFaults | None = None
        for name, axis in machine.cell.driven.items():
            module = (
                machine.cell.nodes[axis.node].module is not None
            )  # it has no drive of CiA 402 to be looked at
            if not module and any(axis.name == name for axis in machine):
                self.record(name)

    @property
    def cycle(self) -> CanCycle:
        """The master's bus."""
        cycle = self.machine._core.scan.cycle
        assert isinstance(cycle, CanCycle)
        return cycle

    @property
    def clock(self) -> Clock:
        """The source of the time."""
        return self.machine._core.runtime.link.clock

    @property
    def wire(self) -> VirtualWire:
        """The simulated wire of a cell in virtual time."""
        wire = self.cycle._channel.bus.wire  # type: ignore[union-attr]
        assert isinstance(wire, VirtualWire)
        return wire

    @property
    def faults(self) -> BusFaults:
        """The faults of the bus of a cell in virtual time."""
        if self._faults is None:
            self._faults = BusFaults(self.cycle, self.clock, self.wire)
        return self._faults

    def nmt(self, command: NmtCommand, node_id: int) -> None:
        """Let a node execute an NMT command that no frame has brought."""
        self.machine.simulated_node(node_id).device.nmt_command(command)

    @property
    def x(self) -> Axis:
        return next(iter(self.machine))

    def __getitem__(self, name: str) -> Axis:
        return self.machine[name]

    def device(self, name: str = "x") -> Device:
        """The node behind an axis."""
        return self.machine.simulated_node(self.machine.cell.axes[name].node).device

    def drive(self, name: str = "x") -> Drive:
        """The drive behind an axis."""
        return self.device(name).drives[self.machine.cell.axes[name].drive_axis - 1]

    def core(self, name: str = "x") -> AxisCore:
        """The master's core of an axis."""
        return self.machine._core.scan.axes[name]

    def port(self, name: str = "x") -> CanPort:
        """How an axis reaches its drive."""
        node = self.machine.cell.axes[name].node
        port = self.machine._core.runtime.link.ports(node)[name]
        assert isinstance(port, CanPort)
        return port

    def hold_back(self, *values: str, name: str = "x") -> None:
        """Let the master get no newer ones of these values of an axis (names of ``Inputs``)."""
        port: Any = self.port(name)
        read = port.read
        last = {value: getattr(read(self.now), value) for value in values}
        port.read = lambda now: read(now)._replace(**last)

    def lose(self, *values: str, name: str = "x") -> None:
        """Let the master know these values of an axis no more (names of ``Inputs``)."""
        port: Any = self.port(name)
        read = port.read
        port.read = lambda now: read(now)._replace(**dict.fromkeys(values))

    def scale_of(self, name: str) -> float:
        """Increments per unit of an axis."""
        return self.machine._core.scan.axes[name].parameters.units.position.factor

    @property
    def lock(self) -> AbstractContextManager[object]:
        """The lock that stops the plants meanwhile."""
        return next(iter(self.machine._core.simulated_nodes.values())).lock

    @property
    def now(self) -> float:
        """Virtual seconds, or those of the monotonic clock."""
        return self.clock.now()

    @property
    def scan_runs(self) -> bool:
        """Whether the machine's scan continues."""
        return not self.machine._core.scan.ended

    def each_cycle(self, call: Callable[..., object]) -> None:
        """Let ``call`` be called after each cycle, in the scan's thread, with the time and the snapshot of each axis."""
        self.machine._core.scan.observers.append(call)

    def ctrl_c(self, limit: float) -> list[AxisbusError]:
        """Request the stop as Ctrl-C does, and let time pass until its end; return its failures."""
        scan = self.machine._core.scan
        scan.request_stop("Ctrl-C")
        self.until(lambda: scan.has_stopped, limit)
        return scan.stop_failures()

    # -- time ------------------------------------------------------------------------------------------------------------

    def run(self, seconds: float) -> None:
        """Let time pass for the plant; the scan runs along while it lives."""
        if not self.is_virtual:
            time.sleep(seconds)
            return
        end = self.now + seconds
        while self.now < end - 1e-9:
            if self.machine._core.scan.ended:
                self.clock.sleep(min(end - self.now, 0.01))
            else:
                self.machine.sleep(0.0101)

    def after(self, seconds: float, action: Callable[[], object]) -> None:
        """Call a function when so much of virtual time has passed."""
        due = self.now + seconds
        observers = self.machine._core.scan.observers

        def look(now: float, _: object) -> None:
            if now >= due:
                observers.remove(look)
                action()

        observers.append(look)

    def until(self, happened: Callable[[], bool], limit: float = 5.0) -> float:
        """Let time pass until something has happened; return the seconds that it took."""
        start = self.now
        while not happened():
            assert self.now - start < limit, f"it has not happened within {limit} s"
            self.run(0.01)
        return self.now - start

    def end_of(self, handle: Handle, limit: float = 10.0) -> AxisbusError | None:
        """Let time pass until a command has ended; return its error."""
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


class Stage:
    """Makes cells in a folder; lets them all go at its end."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._cells: list[Machine] = []

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *_: object) -> None:
        for machine in self._cells:
            if not machine._core.realtime:
                EXIT.part(machine.session)
                machine._core.scan.ended = True
                clock = machine._core.runtime.link.clock
                assert isinstance(clock, VirtualClock)
                clock.close()
            else:
                with suppress(Exception):  # a scenario has checked it
                    machine.close()

    def file(self, text: str) -> Path:
        """Write a cell file."""
        path = self.folder / "cell.toml"
        path.write_text(text, encoding="utf-8")
        return path

    def simulated(
        self,
        names: str = "x",
        *,
        port: Travels | None = None,
        devices: Callable[[], Mapping[int, Device]] | None = None,
        text: str | None = None,
        **changes: str,
    ) -> Cell:
        """Open a simulated cell; ``changes``: see ``cell_text``.

        ``port``: how values travel, as ``kit.value_transport``.
        """
        path = self.file(text if text is not None else cell_text(names, **changes))
        with transported(port or {}):
            machine = Machine.simulated(path, devices() if devices else None)
        self._cells.append(machine)
        return Cell(machine)

    def real(self, names: str = "x", *, text: str | None = None, **changes: str) -> Cell:
        """Open a cell whose simulated drives run in real time on a private virtual bus; ``changes``: see ``cell_text``."""
        machine = Machine.open(self.file(text if text is not None else cell_text(names, **changes)))
        self._cells.append(machine)
        return Cell(machine)
