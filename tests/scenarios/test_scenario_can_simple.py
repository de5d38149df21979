"""Two CANopen axes and a CAN Simple module in one machine: they move together, and none continues after any fault.

The module is judged by its own shaft: it turns at a velocity, at which it would continue for ever, since it does not
detect the loss of the master. If the safety net of a scenario is removed, it must be found turning.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress

import pytest

from axisbus.cell import reader
from axisbus.cia301.nmt import NmtState
from axisbus.drives.gim6010.core import part
from axisbus.errors import AxisbusError, ScanError, StateError
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess
from axisbus.machine.stop_external import stop_on_bus
from axisbus.motion.states import AxisState
from kit.can_simple.mixed_cell import MODULE, RESTS, served, stay, write
from kit.scenarios.simulated_bus import enable, until

pytestmark = pytest.mark.timeout(120)
BOTH = pytest.mark.parametrize(
    "process",
    [
        "thread",
        pytest.param(
            "own", marks=pytest.mark.skipif(sys.platform != "linux", reason="only there it has its own")
        ),
    ],
)


class Cell:
    """The machine, and the plants behind it; velocities in turns/s of the rotor."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.module = machine.simulated_node(MODULE).module
        self.group = machine.group("all")

    @property
    def speeds(self) -> list[float]:
        drives = (self.machine.simulated_node(node).drive() for node in (40, 41))
        return [self.module.shaft.speed, *(drive.axis.motor.velocity / 16384 for drive in drives)]

    def up(self) -> None:
        for axis in self.machine:
            enable(axis)
            axis.home().wait(5)

    def line(self, factor: float):
        """Begin a long straight line of all three, and wait until they are on it."""
        handle = self.group.move_linear((400.0 * factor, -200.0 * factor, 300.0 * factor), velocity=60.0)
        until(lambda: min(map(abs, self.speeds)) > 0.15)
        return handle

    def rests(self, seconds: float = 3.0) -> bool:
        return stay(lambda: max(map(abs, self.speeds)) < RESTS, seconds)


def _has_been_on(monkeypatch) -> None:
    """Let the module in this process have counted for a while: a gap in a young count may be a restart, on a busy computer too."""
    made = part._module

    def older(cell, node_id):
        module = made(cell, node_id)
        module._talk._life = 100
        return module

    monkeypatch.setattr(part, "_module", older)


@pytest.fixture
def cell(tmp_path, process, monkeypatch, core_in_threads) -> Iterator[Cell]:
    _has_been_on(monkeypatch)
    machine = Machine.open(write(tmp_path, f'interface = "sim"\nprocess = "{process}"'))
    try:
        yield Cell(machine)
    finally:
        with suppress(AxisbusError, ExceptionGroup):  # some scenarios leave it with a node that is lost
            machine.close()


@BOTH
def test_canopen_and_can_simple_axes_move_as_one_and_a_fault_of_the_module_stops_all_and_is_reset(cell):
    assert cell.machine.node(MODULE).events == []
    cell.up()
    cell.group.move_linear((40.0, -20.0, 60.0), velocity=60.0).wait(10)
    assert cell.module.position * 45.0 == pytest.approx(60.0, abs=0.1)
    handle = cell.line(1)
    cell.machine.simulated_node(MODULE).fault(0x20000)
    with pytest.raises((AxisbusError, ExceptionGroup)):
        handle.wait(5)
    assert cell.rests()
    assert not cell.module.energised
    m, node = cell.machine["m"], cell.machine.node(MODULE)
    until(lambda: m.state is AxisState.ERRORSTOP and m.error is not None)
    assert "MOTOR_THERMISTOR_OVER_TEMP" in str(m.error)  # manual v2.2: bit 17 of the motor's word
    assert "let it cool down" in str(m.error)
    until(lambda: bool(node.incidents))
    assert node.incidents[0].ended is None
    cell.machine.simulated_node(MODULE).module.dials.motor_error = 0
    for axis in cell.machine:
        axis.reset().wait(5)
        enable(axis)
    until(lambda: node.incidents[0].ended is not None)
    cell.group.move_direct((0.0, 0.0, 0.0)).wait(15)
    assert cell.module.position * 45.0 == pytest.approx(0.0, abs=0.1)
    _has_no_objects(node)


def _has_no_objects(node: NodeAccess) -> None:
    assert node.nmt is NmtState.OPERATIONAL
    for look in (
        lambda: node.sdo[0x1018, 1],
        lambda: node.sdo["Profile velocity"],
        lambda: node.measure("voltage"),
        lambda: node.canopen,
    ):
        with pytest.raises(StateError, match="uses CAN Simple"):
            look()
    assert node.error_history() is None
    assert node.pdos() == []


@BOTH
def test_a_module_that_restarts_in_motion_is_a_lost_node_and_the_others_stop(cell):
    cell.up()
    handle = cell.line(1)
    cell.module.restart()
    with pytest.raises((AxisbusError, ExceptionGroup)):
        handle.wait(5)
    assert cell.rests()
    m = cell.machine["m"]
    until(lambda: m.state is AxisState.ERRORSTOP)
    node = cell.machine.node(MODULE)
    until(lambda: node.nmt is NmtState.PRE_OPERATIONAL)
    assert any("has restarted" in str(event) for event in node.events)
    with pytest.raises(AxisbusError):  # its limits and its home are gone: the machine has to be opened again
        m.reset().wait(5)
        m.enable().wait(5)
    assert not cell.module.energised


@BOTH
def test_a_module_that_falls_silent_stops_the_others_and_closing_names_it(cell):
    cell.up()
    handle = cell.line(1)
    cell.module.dials.dead = True
    with pytest.raises((AxisbusError, ExceptionGroup)):
        handle.wait(5)
    until(lambda: max(map(abs, cell.speeds[1:])) < RESTS)
    node = cell.machine.node(MODULE)
    until(lambda: any("is lost" in str(event) for event in node.events))
    with pytest.raises((AxisbusError, ExceptionGroup)) as caught:
        cell.machine.close()
    assert "m" in str(caught.value)


def test_a_scan_that_fails_leaves_the_module_without_power_and_closing_reports_it(tmp_path, monkeypatch):
    _has_been_on(monkeypatch)
    machine = Machine.open(write(tmp_path, 'interface = "sim"\nprocess = "thread"'))
    cell = Cell(machine)
    cell.up()
    machine["m"].move_velocity(90.0).wait(5)
    sender = machine._core.runtime.link._others.of(MODULE)._senders[MODULE]
    sender.port.read = None  # whatever a bug may be: the next cycle raises
    assert cell.rests()
    assert stay(lambda: not cell.module.energised, 3.0)
    with pytest.raises(ScanError) as caught:
        machine.close()
    assert "m: stands, without power" in str(caught.value)
    assert not cell.module.energised


@pytest.mark.parametrize("stop", ['quick_stop = "ramp"', 'quick_stop = "ramp-hold"'])
def test_a_stop_beside_a_running_master_persists(tmp_path, stop, monkeypatch):
    _has_been_on(monkeypatch)
    with served(tmp_path, "thread", stop) as plants, Machine.open(plants.file) as machine:
        for axis in machine:
            enable(axis)
        machine["x"].move_relative(1e5, velocity=90.0)
        machine["m"].move_velocity(90.0).wait(10)
        found = {each.axis: each for each in stop_on_bus(reader.load(plants.file))}
        assert all(each.ok for each in found.values()), found
        assert plants.rest(1.0)
        until(lambda: machine["x"].state is AxisState.ERRORSTOP)
        assert plants.rest(1.0)
        held = "hold" in stop
        assert held or not plants.module.energised
        assert ("can move it again" in found["m"].text) is held
        with suppress(AxisbusError, ExceptionGroup):  # errors of nodes that were stopped
            machine.close()
