"""Test a program for a machine without the machine: simulated drives in virtual time, with faults, for pytest and other frameworks.

The drives are simulated on a simulated CAN wire. The program, the master and the frames are those of the real machine; time passes
only while the program waits, and every run is the same. With pytest, write ``pytest_plugins = ["axisbus.testing"]`` into
``conftest.py``, and mark a test with its cell file::

    @pytest.mark.cell("cell.toml")
    def test_the_gripper_opens(machine, simulation): ...

Without pytest, use ``with simulate("cell.toml") as simulation: ...``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from axisbus.clock import VirtualClock
from axisbus.core.canlink import CanLink
from axisbus.core.core import Core
from axisbus.errors import ArgumentError, StateError
from axisbus.machine.machine import Machine

if TYPE_CHECKING:
    from axisbus.sim.device import Device
    from axisbus.sim.drive import Drive
    from axisbus.sim.fault_injection import DriveFaults, NodeFaults
    from axisbus.sim.virtual_can import VirtualAdapter, WireFaults

__all__ = ["Simulation", "simulate"]


class Simulation:
    """A simulated machine with what a real one does not offer: its drives, faults, and time; holds the planned actions.

    ``machine`` is open. All methods are for the thread that uses the machine.
    """

    machine: Machine

    def __init__(self, machine: Machine) -> None:
        """Use ``simulate`` or the fixtures."""
        core = machine._core
        link = core.runtime.link if isinstance(core, Core) else None
        if not isinstance(link, CanLink) or link.wire is None or not isinstance(link.clock, VirtualClock):
            raise StateError(
                "this machine is not simulated in virtual time", remedy="open it with Machine.simulated"
            )
        self.machine = machine
        self._wire, self._clock = link.wire, link.clock
        self._plan = _Plan(self._clock)

    # -- drives ------------------------------------------------------------------------------------------------------

    def device(self, axis: str) -> Device:
        """Return the simulated node of an axis: its objects, its NMT state, its drives.

        Raises:
            ArgumentError: no such axis, or an axis without a drive.
            StateError: the axis is a module with CAN Simple, which ``machine.simulated_node`` has instead.
        """
        self.drive(axis)
        return self.machine.simulated_node(self._axis(axis)[0]).device

    def drive(self, axis: str) -> Drive:
        """Return the simulated drive of an axis: its true position, velocity and torque, its motor. Raises as ``device``."""
        node, number = self._axis(axis)
        return self.machine.simulated_node(node).drive(number)

    def position(self, axis: str) -> float:
        """Return where the motor of an axis really is, in the axis's unit, whatever its drive reports. Raises as ``device``."""
        units = self.machine._core.session.axes[axis].parameters.units
        drive = self.drive(axis)
        return drive.axis.to_user(drive.axis.motor.position) / units.position.factor

    # -- faults ------------------------------------------------------------------------------------------------------

    def drive_faults(self, axis: str) -> DriveFaults:
        """Return the fault settings of an axis's drive; every field may be changed at any time. Raises as ``device``."""
        return self.drive(axis).dials

    def node_faults(self, axis: str) -> NodeFaults:
        """Return the fault settings of an axis's node: its communication. Raises as ``device``."""
        return self.device(axis).dials

    @property
    def wire_faults(self) -> WireFaults:
        """The fault settings of the CAN wire: loss, duplication, corruption, delay, cut."""
        return self._wire.faults

    def fault(self, axis: str, code: int) -> None:
        """Put the drive of an axis into fault with an error code (603Fh). Raises as ``device``."""
        node, number = self._axis(axis)
        self.machine.simulated_node(node).fault(code, axis=number)

    def unplug_adapter(self) -> None:
        """Let the master's CAN adapter fail as if it was unplugged; ``machine.reconnect`` opens it again."""
        self._adapter.unplug()

    def bus_off(self, off: bool = True) -> None:
        """Make the master's CAN controller bus-off, or let it restart."""
        self._adapter.go_off(off)

    # -- time --------------------------------------------------------------------------------------------------------

    @property
    def now(self) -> float:
        """The virtual time in seconds."""
        return self._clock.now()

    def after(self, seconds: float, action: Callable[[], object]) -> None:
        """Call ``action`` when so many seconds of virtual time have passed, between two cycles; it must not wait.

        Raises:
            ArgumentError: ``seconds`` is not a finite number of 0 or more.
        """
        if not (isinstance(seconds, int | float) and 0 <= seconds < math.inf):
            raise ArgumentError(
                f"after({seconds!r}): not a number of seconds", remedy="give seconds, such as 0.5"
            )
        self._plan.add(self._clock.now() + seconds, action)

    def until(self, happened: Callable[[], bool], limit: float = 60.0) -> float:
        """Let time pass, cycle by cycle, until ``happened()``; return the seconds that it took.

        Raises:
            AssertionError: it has not happened within ``limit`` seconds of virtual time.
        """
        began = self.now
        while not happened():
            if self.now - began >= limit:
                raise AssertionError(f"it has not happened within {limit:g} s of virtual time")
            self.machine.sleep(self.machine.cell.bus.scan_period)
        return self.now - began

    def _axis(self, name: str) -> tuple[int, int]:
        config = self.machine.cell.axes.get(name)
        if config is None or config.virtual:
            drives = ", ".join(self.machine.cell.driven)
            raise ArgumentError(
                f"{name!r} is not an axis with a drive", remedy=f"axes with a drive in this cell: {drives}"
            )
        return config.node, config.drive_axis

    @property
    def _adapter(self) -> VirtualAdapter:
        return self._wire.masters[0]


class _Plan:
    """The planned actions (``axisbus.clock.EventSource``)."""

    def __init__(self, clock: VirtualClock) -> None:
        self._actions: list[tuple[float, Callable[[], object]]] = []
        clock.add(self)

    def add(self, at: float, action: Callable[[], object]) -> None:
        """Call ``action`` at the time ``at``; those of the same time in the order of their planning."""
        self._actions.append((at, action))
        self._actions.sort(key=lambda each: each[0])

    @property
    def due(self) -> float:
        """As ``EventSource.due``."""
        return self._actions[0][0] if self._actions else math.inf

    def run(self, now: float, until: float) -> None:  # noqa: ARG002  # one at a time
        """As ``EventSource.run``."""
        _, action = self._actions.pop(0)
        action()

    def catch_up(self, now: float) -> None:
        """As ``EventSource.catch_up``: it has no plant."""


@contextmanager
def simulate(cell: str | Path) -> Iterator[Simulation]:
    """Open a simulated machine in virtual time for the ``with`` block, and close it afterwards unless that was done already.

    Raises:
        as ``Machine.simulated``; at the end as ``Machine.close``.
    """
    with Machine.simulated(cell) as machine:
        yield Simulation(machine)


# -- pytest ------------------------------------------------------------------------------------------------------------

try:
    import pytest
except ImportError:  # other frameworks use ``simulate``
    pass
else:

    def pytest_configure(config: pytest.Config) -> None:
        """Register the marker."""
        config.addinivalue_line(
            "markers",
            "cell(file): the cell file that the fixtures machine and simulation open, relative to the test's file",
        )

    @pytest.fixture
    def simulation(request: pytest.FixtureRequest) -> Iterator[Simulation]:
        """The simulated machine of the marker ``cell``. It is closed after the test; a test in which that fails is an error."""
        marker = request.node.get_closest_marker("cell")
        if marker is None or not marker.args:
            raise pytest.UsageError('mark the test with its cell file: @pytest.mark.cell("cell.toml")')
        with simulate(Path(request.path).parent / marker.args[0]) as opened:
            yield opened

    @pytest.fixture
    def machine(simulation: Simulation) -> Machine:
        """The ``machine`` of ``simulation``: as from ``Machine.open``."""
        return simulation.machine
