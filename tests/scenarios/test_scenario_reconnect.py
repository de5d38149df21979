"""The adapter is unplugged and plugged in again, or is opened again after a bus-off: the machine remains open, nothing is enabled.

Everything is judged by the simulated drives, not by the master's own view.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from axisbus.errors import AdapterError, AxisbusError, BusOff, NodeStateError, ScanError, StateError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.sim.power import Effort
from axisbus.testing import Simulation, simulate
from kit.cell import cell_file

VIRTUAL = '\n[axes.v]\nvirtual = true\nunit = "deg"\nscale = 100\nmax_velocity = 400.0\n[axes.v.defaults]\nvelocity = 100.0\n'
VIRTUAL += "acceleration = 500.0\n"


@contextmanager
def cell(folder: Path, names: str = "xy", more: str = "", **changes: str) -> Iterator[Simulation]:
    """Simulate a cell in virtual time; errors of closing are not of interest here."""
    file = cell_file(folder, names, more=more, **changes)
    with ExitStack() as stack:
        simulation = stack.enter_context(simulate(file))
        closing = stack.pop_all()
        try:
            yield simulation
        finally:
            with suppress(AxisbusError, ExceptionGroup):
                closing.close()


def unplug(simulation: Simulation, seconds: float = 5.0) -> None:
    """Unplug the adapter for some seconds; the channel's next adapter is the one that is plugged in again."""
    simulation.unplug_adapter()
    for handle in [axis.reset() for axis in simulation.machine]:
        with suppress(AxisbusError):
            handle.wait(1)
    simulation._clock.sleep(seconds)


def energised(simulation: Simulation, names: str = "xy") -> list[str]:
    return [name for name in names if simulation.drive(name).power.effort is not Effort.OFF]


def assert_usable(simulation: Simulation, name: str) -> None:
    """The axis is refused until its node is booted; then it is reset, enabled without a jump, and moves as commanded."""
    machine, axis = simulation.machine, simulation.machine[name]
    assert axis.state is AxisState.ERRORSTOP
    assert "the adapter was lost, and has been opened again" in str(axis.error)
    with pytest.raises(NodeStateError):
        axis.reset().wait(5)
    with pytest.raises(StateError):
        axis.enable().wait(5)
    assert energised(simulation, name) == []
    assert machine.node(machine.cell.axes[name].node).boot().ok
    axis.reset().wait(5)
    before = simulation.position(name)
    axis.enable().wait(5)
    machine.sleep(0.5)
    assert simulation.position(name) == pytest.approx(before, abs=0.05)
    axis.move_relative(3.0).wait(10)
    assert simulation.position(name) == pytest.approx(before + 3.0, abs=0.05)


def idle(machine: Machine) -> None:
    """The axes are disabled."""


def enabled(machine: Machine) -> None:
    for axis in machine:
        axis.enable().wait(5)


def moving(machine: Machine) -> None:
    enabled(machine)
    for axis in machine:
        axis.move_velocity(45.0).wait(5)


def gear(machine: Machine) -> None:
    enabled(machine)
    machine["y"].gear_in(machine["x"], 1.0).wait(5)
    machine["x"].move_velocity(45.0).wait(5)


@pytest.mark.parametrize("doing", [idle, enabled, moving, gear], ids=lambda doing: doing.__name__)
@pytest.mark.parametrize("seconds", [0.05, 5.0], ids=["soon", "later"])
def test_an_adapter_that_is_plugged_in_again_serves_the_same_machine(
    tmp_path: Path, doing: Callable[[Machine], None], seconds: float
) -> None:
    with cell(tmp_path) as simulation:
        machine = simulation.machine
        doing(machine)
        machine.sleep(0.5)
        unplug(simulation, seconds)
        assert machine.session.failed
        with pytest.raises(ScanError):
            machine["x"].enable().wait(5)
        stopped = machine.reconnect()
        assert all(each.ok for each in stopped), stopped
        assert not machine.session.ended
        assert not machine.session.failed
        machine.sleep(1.0)
        assert energised(simulation) == []
        for name in "xy":
            assert_usable(simulation, name)


@pytest.mark.parametrize("wait", [0.0, 0.01, 0.02, 0.05])
def test_a_node_may_be_booted_at_once(tmp_path, wait):
    """The last state that was received before the adapter was lost is no reason against it."""
    with cell(tmp_path, heartbeat="10s") as simulation:
        moving(simulation.machine)
        unplug(simulation, 0.05)
        simulation.machine.reconnect()
        simulation.machine.sleep(wait)
        for name in "xy":
            assert_usable(simulation, name)


def test_it_may_be_unplugged_again_and_again(tmp_path):
    with cell(tmp_path) as simulation:
        for _ in range(3):
            simulation.machine.sleep(0.1)
            unplug(simulation)
            simulation.machine.reconnect()
            simulation.machine.sleep(0.5)
            for name in "xy":
                assert_usable(simulation, name)


def test_a_drive_without_a_watchdog_that_still_turns_is_stopped_at_once(tmp_path):
    with cell(tmp_path, heartbeat="10s") as simulation:
        moving(simulation.machine)
        unplug(simulation, 1.0)
        assert abs(simulation.drive("x").axis.motor.velocity) > 1000
        stopped = simulation.machine.reconnect()
        assert [(each.axis, each.ok) for each in stopped] == [("x", True), ("y", True)]
        for name in "xy":
            assert simulation.drive(name).axis.motor.velocity == pytest.approx(0.0, abs=1.0)
        simulation.machine.sleep(0.5)
        assert energised(simulation) == []
        for name in "xy":
            assert_usable(simulation, name)


def test_a_node_that_is_gone_is_reported_and_the_other_one_is_usable(tmp_path):
    with cell(tmp_path) as simulation:
        moving(simulation.machine)
        simulation.unplug_adapter()
        simulation.machine.simulated_node(2).switch_off()
        unplug(simulation)
        stopped = {each.axis: each.ok for each in simulation.machine.reconnect()}
        assert stopped == {"x": True, "y": False}
        simulation.machine.sleep(1.0)
        assert_usable(simulation, "x")
        simulation.machine.simulated_node(2).switch_on()
        simulation.machine.sleep(1.0)
        assert_usable(simulation, "y")


def test_nothing_of_before_remains(tmp_path):
    with cell(tmp_path) as simulation:
        machine = simulation.machine
        enabled(machine)
        machine["x"].home().wait(10)
        machine["x"].set_override(0.5).wait(5)
        machine["x"].move_absolute(200.0)
        queued = machine["x"].move_relative(5.0, buffer="buffered")
        machine.sleep(0.2)
        unplug(simulation)
        assert isinstance(queued.exception(), AxisbusError)
        machine.reconnect()
        machine.sleep(0.5)
        assert not machine["x"].homed
        assert_usable(simulation, "x")
        assert machine["x"].override == 1.0
        before = simulation.position("x")
        machine.sleep(2.0)
        assert simulation.position("x") == pytest.approx(before, abs=0.05)


def test_a_virtual_axis_ends_its_motion_and_needs_only_a_reset(tmp_path):
    with cell(tmp_path, more=VIRTUAL) as simulation:
        machine = simulation.machine
        machine["v"].enable().wait(5)
        machine["v"].move_velocity(45.0).wait(5)
        unplug(simulation)
        machine.reconnect()
        machine.sleep(1.0)
        assert machine["v"].state is AxisState.ERRORSTOP
        machine["v"].reset().wait(5)
        position = machine["v"].position
        machine.sleep(1.0)
        assert machine["v"].position == position
        machine["v"].enable().wait(5)
        machine["v"].move_relative(3.0).wait(10)


# -- refusals and failures -------------------------------------------------------------------------------------------------


def test_an_adapter_that_works_is_not_opened_again(tmp_path):
    with cell(tmp_path) as simulation:
        moving(simulation.machine)
        with pytest.raises(StateError, match="it works"):
            simulation.machine.reconnect()
        assert simulation.drive("x").axis.motor.velocity > 1000


def test_an_adapter_that_is_still_away_may_be_tried_again(tmp_path):
    with cell(tmp_path) as simulation:
        machine = simulation.machine
        channel = machine._core.scan.cycle._channel
        plugged = channel._opener

        def away() -> None:
            raise AdapterError("the CAN adapter cannot be opened")

        unplug(simulation)
        channel._opener = away
        for _ in range(2):
            with pytest.raises(AdapterError, match="cannot be opened"):
                machine.reconnect()
            assert machine.session.failed
        channel._opener = plugged
        machine.reconnect()
        machine.sleep(0.5)
        assert_usable(simulation, "x")


def test_a_scan_that_has_failed_for_another_reason_is_not_revived(tmp_path):
    with cell(tmp_path) as simulation:
        simulation.machine._core.scan.fail(RuntimeError("a mistake"))
        with pytest.raises(ScanError):
            simulation.machine.reconnect()


# -- bus-off ---------------------------------------------------------------------------------------------------------------


def test_after_a_bus_off_the_adapter_is_opened_again_while_the_scan_continues(tmp_path):
    with cell(tmp_path) as simulation:
        machine = simulation.machine
        moving(machine)
        simulation._adapter.go_off(True)
        machine.sleep(3.0)
        assert isinstance(machine["x"].error, BusOff)
        cycles = machine.cycle_jitter.cycles
        assert machine.reconnect() == []
        machine.sleep(1.0)
        assert machine.cycle_jitter.cycles > cycles
        assert energised(simulation) == []
        assert machine["x"].state is AxisState.ERRORSTOP
        for node, name in ((1, "x"), (2, "y")):
            assert machine.node(node).boot().ok
            machine[name].reset().wait(5)
            machine[name].enable().wait(5)
            machine[name].move_relative(3.0).wait(10)
