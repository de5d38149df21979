"""A disabled axis whose drive is enabled from outside: it is disabled again, and one enabled for longer is reported."""

from __future__ import annotations

from axisbus.cia402.state import PowerState
from axisbus.motion.states import AxisState
from kit.campaign.pdo_faults import OTHER_MASTER
from kit.cell import Cell, Stage
from kit.plant_probe import OFF


def disabled(stage: Stage) -> Cell:
    cell = stage.simulated().enabled()
    cell.x.disable().wait()
    return cell


def enable_on(cell: Cell) -> None:
    """Enable the drive of x from any state after *switch on disabled*."""
    drive = cell.drive()
    drive.controlword = 0x0F
    drive.evaluate_controlword()


def test_a_moment_of_power_is_ended_without_an_error(tmp_path):
    with Stage(tmp_path) as stage:
        cell = disabled(stage)
        seen = []
        cell.each_cycle(lambda *_: seen.append(cell.core().image.state))
        OTHER_MASTER["other_enables"](cell, "x", 0.0)
        cell.run(0.5)
        assert 0 < seen.count(PowerState.OPERATION_ENABLED) < 20
        assert cell.stage("x") in OFF
        assert cell.core().state is AxisState.DISABLED
        assert cell.x.error is None


def test_a_drive_that_keeps_its_power_after_disable_is_reported_and_stays_reported(tmp_path):
    with Stage(tmp_path) as stage:
        cell = disabled(stage)
        cell.drive().dials.ignore_disable_voltage = True
        OTHER_MASTER["other_enables"](cell, "x", 0.0)
        cell.each_cycle(lambda *_: enable_on(cell))
        took = cell.until(lambda: cell.x.error is not None, 2.0)
        assert 0.2 < took < 0.6
        assert cell.core().state is AxisState.ERRORSTOP
        error = cell.x.error
        assert error.message == "x: its drive was enabled, but not by this program"
        assert error.observed.startswith(
            "the axis is disabled, its drive was seen in state 'operation enabled' again after 0.25 s"
        )
        assert "TREAT THE AXIS AS MOVING" in error.remedy
