"""Interpolated position mode over a bus in real time: its set-points have an RPDO, and come with the targets."""

from __future__ import annotations

import pytest

from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.cell import Stage
from kit.plant_probe import ENABLED, OFF
from kit.sim.interpolated import write_eds


def test_a_trajectory_and_a_halt(scenario: Stage) -> None:
    cell = scenario.real("x", eds=write_eds(scenario.folder), axis="rated_torque = 10.0").enabled()
    cell.x.follow(TrapezoidalTrajectory(0.0, 60.0, 100.0, 400.0)).wait(10)
    assert cell.drive().mode_display == 7
    assert cell.where() == pytest.approx(60.0, abs=0.05)
    assert cell.device().read(0x1603, 1) == 0x60C1_0120
    cell.x.move_relative(5.0).wait(10)
    cell.x.follow(TrapezoidalTrajectory(cell.x.position, 200.0, 100.0, 400.0))
    cell.run(0.5)
    cell.x.halt().wait(5)
    cell.must_be_still(within=1.0, stages=ENABLED)
    cell.machine.close()
    assert cell.stage() in OFF
