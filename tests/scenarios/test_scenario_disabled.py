"""A disabled axis whose drive somebody else enables: it is disabled again, and one that drives its motor for longer is told."""

from __future__ import annotations

from axisbus.motion.states import AxisState
from kit.campaign.wire import OTHER_MASTER
from kit.cell import Cell, Stage
from kit.probe import ENABLED, OFF


def disabled(stage: Stage) -> Cell:
    cell = stage.simulated().enabled()
    cell.x.disable().wait()
    return cell


def test_a_moment_of_power_is_ended_without_an_error(tmp_path):
    with Stage(tmp_path) as stage:
        cell = disabled(stage)
        OTHER_MASTER["other_enables"](cell, "x", 0.0)
        assert cell.stage("x") != ENABLED or cell.until(lambda: cell.stage("x") in OFF, 0.2) < 0.2
        cell.run(0.5)
        assert cell.stage("x") in OFF
        assert cell.core().state is AxisState.DISABLED
        assert cell.x.error is None


def test_a_drive_that_does_not_let_go_of_its_power_is_told_and_stays_told(tmp_path):
    with Stage(tmp_path) as stage:
        cell = disabled(stage)
        cell.drive().dials.ignore_disable_voltage = True
        cell.each_cycle(lambda *_: OTHER_MASTER["other_enables"](cell, "x", 0.0))
        took = cell.until(lambda: cell.x.error is not None, 2.0)
        assert 0.2 < took < 0.6
        assert cell.core().state is AxisState.ERRORSTOP
        error = cell.x.error
        assert error.message == "x: its drive was enabled, but not by this program"
        assert error.observed.startswith(
            "the axis is disabled, its drive was seen in state 'operation enabled' again after 0.25 s"
        )
        assert "TREAT THE AXIS AS MOVING" in error.remedy
