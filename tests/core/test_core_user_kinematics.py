"""A path by a program's own kinematics is followed by a core in a process of its own, which has none of its code."""

from __future__ import annotations

import math

import pytest

from axisbus.errors import Interrupted
from axisbus.machine.machine import Machine
from kit.scenarios.core_process import OWN_PROCESS, own_cell

pytestmark = [OWN_PROCESS, pytest.mark.timeout(60)]


def test_a_path_is_followed_halted_and_resumed(tmp_path, core_in_threads):
    here = 100.0

    class Turntable:  # which no other process could have
        def forward(self, joints):
            turn = math.radians(joints[0])
            return (here + joints[1]) * math.cos(turn), (here + joints[1]) * math.sin(turn)

        def inverse(self, coordinates, near):
            turn = math.degrees(math.atan2(coordinates[1], coordinates[0]))
            return turn + 360.0 * round((near[0] - turn) / 360.0), math.hypot(*coordinates) - here

    with Machine.open(own_cell(tmp_path, "xy", axis="max_acceleration = 2000.0")) as machine:
        tool = machine.group("x", "y", kinematics=Turntable())
        tool.enable().wait(20)
        path = tool.move_path([(80.0, 60.0), (80.0, -60.0)], velocity=80.0, acceleration=400.0, blend=5.0)
        machine.sleep(0.8)
        tool.halt().wait(20)
        with pytest.raises(Interrupted):
            path.wait(20)
        tool.resume().wait(20)
        assert tool.tool_position == pytest.approx((80.0, -60.0), abs=0.1)
