"""Move the tool of a SCARA arm along a line and a circle, in millimetres. x is the shoulder, y the elbow."""

from pathlib import Path

from axisbus import Machine, Scara, wait

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    joints = cell.group("x", "y")
    joints.enable().wait()
    wait(axis.home() for axis in joints)
    joints.move_direct((0.0, 60.0)).wait()  # degrees
    arm = joints.with_kinematics(Scara(upper=200.0, fore=150.0))
    print("tool at", [round(value, 1) for value in arm.tool_position], "mm")
    arm.move_linear((300.0, 60.0), velocity=100.0, acceleration=500.0).wait()
    arm.move_circular((300.0, 60.0), centre=(280.0, 60.0), velocity=80.0, acceleration=500.0).wait()
    print("tool at", [round(value, 1) for value in arm.tool_position], "mm")
