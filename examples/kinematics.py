"""Kinematics of your own: x turns a table, y moves a slide on it. A line, a rounded corner and a stream, in millimetres."""

import math
from pathlib import Path

from axisbus import Machine, wait


class Turntable:
    """Converts joint positions to tool coordinates (mm), and back. If y is at 0, the tool is 100 mm from the centre."""

    def forward(self, joints):
        turn, out = math.radians(joints[0]), 100.0 + joints[1]
        return out * math.cos(turn), out * math.sin(turn)

    def inverse(self, coordinates, near):
        turn = math.degrees(math.atan2(coordinates[1], coordinates[0]))
        turn += 360.0 * round((near[0] - turn) / 360.0)  # the solution nearest to the present angle
        return turn, math.hypot(*coordinates) - 100.0


with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    joints = cell.group("x", "y")
    joints.enable().wait()
    wait(axis.home() for axis in joints)
    tool = joints.with_kinematics(Turntable())
    tool.move_linear((80.0, 60.0), velocity=200.0, acceleration=1500.0).wait()
    tool.move_path([(80.0, 0.0), (120.0, 0.0)], velocity=200.0, acceleration=1500.0, blend=5.0).wait()
    print("tool at", [round(value, 1) for value in tool.tool_position], "mm")
    with tool.stream(period="10ms") as points:  # one full circle, from rest to rest
        for number in range(101):
            angle = math.pi * (1.0 - math.cos(math.pi * number / 100))
            points.push((110.0 + 10.0 * math.cos(angle), 10.0 * math.sin(angle)))
    print(
        "tool back at",
        [round(value, 1) for value in tool.tool_position],
        "mm: x and y at",
        [round(axis.position, 1) for axis in joints],
    )
