"""A node dies, restarts or leaves operational in mid-move: the others stop, it stops itself, and the message gives the reason."""

from __future__ import annotations

import pytest

from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.errors import DriveError, NodeError, StateError, Stopped
from axisbus.motion.states import AxisState
from kit.plant_probe import ENABLED, OFF


@pytest.mark.nets("the stop sequence")
def test_when_a_node_dies_in_mid_move_the_others_stop(scenario, golden):
    cell = scenario.simulated("xy")
    lost, other = cell.travelling()
    cell.device("x").dials.dead = True
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    assert isinstance(cell.failure_of(lost), NodeError)
    golden("node_dies", cell.failure_of(lost))
    assert isinstance(cell.failure_of(other), Stopped)
    golden("node_dies_others", cell.failure_of(other))


@pytest.mark.nets("the drive's watchdog")
def test_a_dead_nodes_own_watchdog_stops_it(scenario, golden):
    cell = scenario.simulated("xy")
    lost, _ = cell.turning()
    cell.device("x").dials.dead = True
    cell.must_be_still("x", within=1.0, stages=OFF)
    lost.wait()  # the velocity had been reached before
    cell.run(6.0)
    assert cell["x"].state is AxisState.ERRORSTOP
    golden(
        "node_dead_for_good", cell["x"].error
    )  # its standstill cannot be confirmed, and the message reports so


@pytest.mark.nets("the stop sequence")
def test_a_node_whose_heartbeat_alone_stops_is_stopped(scenario, golden):
    cell = scenario.simulated("xy")
    cell.turning()
    cell.device("x").dials.heartbeat_stops = True
    cell.must_be_still("x", within=1.0, stages=OFF)
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    assert isinstance(cell["x"].error, NodeError)
    golden("heartbeat_stops", cell["x"].error)


@pytest.mark.nets("the stop sequence")
def test_when_a_node_restarts_in_mid_move_the_others_stop(scenario, golden):
    cell = scenario.simulated("xy")
    lost, _ = cell.travelling()
    cell["x"].set_position(0.0)
    cell.nmt(NmtCommand.RESET_NODE, 1)
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    cell.must_be_still("x", within=8.0, stages=OFF)  # its power went with the restart: it coasts
    golden("node_restarts", cell.failure_of(lost))
    assert not cell["x"].homed  # whatever position it has now is not the one that was confirmed


def test_a_restarted_node_cannot_be_reset_into_service(scenario, golden):
    cell = scenario.simulated("x")
    (lost,) = cell.travelling()
    cell.nmt(NmtCommand.RESET_NODE, 1)
    cell.failure_of(lost)
    cell.run(2.0)
    refused = cell.failure_of(cell.x.reset())
    assert isinstance(refused, StateError)
    golden("node_restarted_reset", refused)
    assert isinstance(cell.failure_of(cell.x.enable()), StateError)
    assert cell.stage() in OFF


@pytest.mark.parametrize("enabled", [False, True], ids=["at standstill", "moving"])
def test_a_reset_of_an_axis_whose_node_is_silent_names_the_remedy(scenario, golden, enabled):
    """At standstill each reset reports it; in motion also while the stop sequence still tries to reach the node."""
    cell = scenario.simulated("x")
    if enabled:
        cell.turning()
    cell.device().dials.dead = True
    cell.run(1.0)
    first, second = cell.failure_of(cell.x.reset()), cell.failure_of(cell.x.reset())
    assert str(first) == str(second)
    golden("reset_of_a_lost_node_moving" if enabled else "reset_of_a_lost_node", first)
    cell.run(8.0)
    golden("reset_of_a_lost_node", cell.failure_of(cell.x.reset()))


def test_a_reset_of_an_axis_whose_node_fell_silent_in_pre_operational_reports_the_silence(scenario):
    cell = scenario.simulated("x")
    cell.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)
    cell.run(1.0)
    assert "node 1 is present, but not operational" in str(cell.failure_of(cell.x.reset()))
    cell.device().dials.dead = True
    cell.run(1.0)
    assert "node 1 is lost, so there is no node to reset" in str(cell.failure_of(cell.x.reset()))


@pytest.mark.nets("the stop sequence")
def test_a_node_sent_to_pre_operational_by_another_master_is_stopped_by_sdo(scenario, golden):
    cell = scenario.simulated("xy")
    cell.turning()
    cell.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)  # the drive itself would go on turning
    cell.must_be_still("x", within=1.0, stages=OFF)
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    golden("node_pre_operational", cell["x"].error)
    assert "TREAT" not in str(cell["x"].error)  # its statusword, read by SDO, has confirmed it


@pytest.mark.nets("the stop sequence")
def test_if_another_master_stops_a_node_the_others_stop(scenario, golden):
    cell = scenario.simulated("xy")
    cell.turning()
    cell.nmt(NmtCommand.STOP, 1)
    cell.must_be_still("x", within=1.0, stages=OFF)  # by its 6007h
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    golden("node_stopped", cell["x"].error)


def test_a_node_that_returned_without_a_restart_works_again_after_a_reset(scenario):
    cell = scenario.simulated("x")
    cell.turning()
    cell.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)
    cell.must_be_still(within=1.0, stages=OFF)
    cell.nmt(NmtCommand.START, 1)
    cell.run(0.5)
    assert cell.stage() in OFF  # being back does not enable it
    assert cell.x.state is AxisState.ERRORSTOP
    cell.x.reset().wait(2)
    cell.x.enable().wait(2)
    cell.x.move_relative(5.0).wait(5)
    assert cell.device().nmt is NmtState.OPERATIONAL


def test_a_node_that_returned_in_fault_and_was_reset_is_reported_when_it_is_lost_again(scenario):
    cell = scenario.simulated("x")
    cell.turning()
    cell.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)
    cell.must_be_still(within=1.0, stages=OFF)
    cell.drive().fault(0x8130)
    cell.nmt(NmtCommand.START, 1)
    cell.run(1.0)
    cell.x.reset().wait(2)
    cell.x.enable().wait(2)
    cell.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)
    cell.run(0.1)
    assert isinstance(cell.x.error, NodeError)
    assert "NMT state is pre-operational" in str(cell.x.error)


@pytest.mark.nets("the stop sequence")
def test_a_lost_io_or_resting_axis_stops_the_moving_ones_too(scenario):
    cell = scenario.simulated("xy")
    cell.enabled()
    moving = cell["y"].move_relative(2000.0, velocity=100.0)
    cell.run(0.5)
    cell.must_move("y")
    cell.device("x").dials.dead = True
    cell.must_be_still("y", within=1.5, stages=ENABLED)
    assert isinstance(cell.failure_of(moving), (Stopped, DriveError))
