"""Tests of a program for a machine, on simulated drives: no hardware, the same in every run, and faults on demand."""

import pytest
from program import enable_and_home, measure

from axisbus import Machine
from axisbus.errors import DriveError, NodeError
from axisbus.testing import Simulation

pytestmark = pytest.mark.cell("../cell.toml")


def test_it_measures_at_each_position(machine: Machine, simulation: Simulation) -> None:
    enable_and_home(machine)
    assert measure(machine, [0.0, 45.0, 90.0]) == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
    assert simulation.position("x") == pytest.approx(90.0, abs=0.1)
    assert simulation.now < 10.0  # seconds of the machine, not of this test


def test_a_drive_that_goes_into_fault_ends_the_measurement(machine: Machine, simulation: Simulation) -> None:
    enable_and_home(machine)
    simulation.after(0.2, lambda: simulation.fault("x", 0x2310))
    with pytest.raises(DriveError, match="0x2310"):
        measure(machine, [90.0])


def test_a_cable_that_breaks_stops_the_other_axes(machine: Machine, simulation: Simulation) -> None:
    enable_and_home(machine)
    turning = machine["y"].move_velocity(20.0)
    simulation.node_faults("x").dead = True
    simulation.until(lambda: not turning.busy, limit=2.0)
    machine.sleep(1.0)
    assert isinstance(machine["x"].error, NodeError)
    assert simulation.drive("y").velocity == 0
    with pytest.raises(DriveError, match="could not be confirmed"):  # nobody can see whether x stands
        machine.close()


def test_a_bus_that_loses_frames_does_not_disturb_it(machine: Machine, simulation: Simulation) -> None:
    enable_and_home(machine)
    simulation.wire_faults.loss = 0.001
    assert measure(machine, [45.0]) == pytest.approx([0.0], abs=0.01)
