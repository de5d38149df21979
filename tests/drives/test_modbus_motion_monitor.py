"""Whether a motion over Modbus follows its command, judged by readings only."""

from __future__ import annotations

import math

import pytest

from axisbus.drives.gim6010.modbus.module import StatusRead, look
from axisbus.drives.gim6010.modbus.motion.course import (
    ModbusCommand,
    ModbusControlMode,
    ModbusMotionStatus,
    MoveWatch,
    TurnWatch,
)
from axisbus.drives.gim6010.modbus.motion.ladder import RampHalt, TrapezoidHalt
from kit.modbus.rig import Rig


def seen(position, velocity, at=1.0):
    return StatusRead(at, 8, 0, position, velocity)


def move(**other):
    return MoveWatch(
        **{"start": 0.0, "target": 10.0, "velocity": 4.0, "window": 0.02, "deadline": 5.0, **other}
    )


def test_a_move_has_arrived_when_two_samples_show_standstill_within_its_window():
    watch = move()
    looks = [
        (seen(9.99, 1.0), ModbusMotionStatus.UNDER_WAY),  # it is there, and passes
        (seen(10.01, 1.0), ModbusMotionStatus.UNDER_WAY),
        (seen(9.97, 0.0), ModbusMotionStatus.UNDER_WAY),  # it is at standstill, and not at the target
        (seen(10.01, 0.04), ModbusMotionStatus.UNDER_WAY),  # once
        (seen(10.03, 0.0), ModbusMotionStatus.UNDER_WAY),  # and not again
        (seen(9.985, 0.0), ModbusMotionStatus.UNDER_WAY),
        (seen(10.015, 0.0), ModbusMotionStatus.DONE),
    ]
    assert [watch.judge(look) for look, _ in looks] == [verdict for _, verdict in looks]


@pytest.mark.parametrize(
    ("look", "verdict"),
    [
        (seen(-0.05, -1.0), ModbusMotionStatus.UNDER_WAY),
        (seen(-0.2, -1.0), ModbusMotionStatus.AWAY),
        (seen(20.2, 1.0), ModbusMotionStatus.AWAY),
        (seen(5.0, 5.2), ModbusMotionStatus.UNDER_WAY),
        (seen(5.0, 5.4), ModbusMotionStatus.TOO_FAST),
        (seen(5.0, -5.4), ModbusMotionStatus.TOO_FAST),
        (seen(5.0, 4.0, at=5.0), ModbusMotionStatus.UNDER_WAY),
        (seen(5.0, 4.0, at=5.1), ModbusMotionStatus.LATE),
        (seen(None, 4.0), ModbusMotionStatus.BLIND),
        (seen(5.0, None), ModbusMotionStatus.BLIND),
    ],
)
def test_each_look_at_a_move_has_its_verdict(look, verdict):
    assert move().judge(look) is verdict


def test_a_velocity_is_there_when_it_is_within_two_percent_and_late_when_it_gets_no_nearer():
    watch = TurnWatch(10.0, 10.0)
    looks = [
        (seen(0.0, 0.0, 0.0), ModbusMotionStatus.UNDER_WAY),
        (seen(0.0, 5.0, 1.9), ModbusMotionStatus.UNDER_WAY),
        (seen(0.0, 5.04, 3.8), ModbusMotionStatus.UNDER_WAY),  # no nearer to speak of
        (seen(0.0, 5.04, 4.0), ModbusMotionStatus.LATE),
        (seen(0.0, 9.7, 4.1), ModbusMotionStatus.UNDER_WAY),
        (seen(0.0, 9.81, 4.2), ModbusMotionStatus.DONE),
        (seen(0.0, 12.6, 4.2), ModbusMotionStatus.TOO_FAST),
        (seen(None, 10.0, 4.2), ModbusMotionStatus.BLIND),
    ]
    assert [watch.judge(look) for look, _ in looks] == [verdict for _, verdict in looks]
    assert TurnWatch(0.0, 3.0).judge(seen(0.0, 0.04)) is ModbusMotionStatus.DONE


def test_how_a_running_motion_is_halted_and_when_it_is_too_fast():
    assert ModbusCommand(ModbusControlMode.POSITION).halting is None
    assert ModbusCommand(ModbusControlMode.POSITION, ramp=5.0, target=3.0).halting == TrapezoidHalt(5.0, 3.0)
    assert ModbusCommand(ModbusControlMode.VELOCITY, ramp=5.0, commanded=2.0).halting == RampHalt(5.0, 2.0)
    assert ModbusCommand(ModbusControlMode.TORQUE, ramp=5.0, target=3.0).halting is None
    assert ModbusCommand(ModbusControlMode.TORQUE, fastest=3.0).is_too_fast(-3.1)
    assert not ModbusCommand(ModbusControlMode.TORQUE, fastest=3.0).is_too_fast(2.9)
    assert ModbusCommand(ModbusControlMode.VELOCITY).is_too_fast(0.6)
    assert not ModbusCommand(ModbusControlMode.VELOCITY, fastest=3.0).is_too_fast(-4.0)
    assert math.isclose(RampHalt(5.0, 2.0).longest(10.0), 5.0)


def test_a_position_that_may_be_outdated_is_not_reported():
    rig = Rig(3.25, dead_in_idle=False)
    assert rig.module.read("position_feedback") == 3.25
    assert (look(rig.module, 1).position, look(rig.module, 1).velocity) == (None, None)
    rig.plant.usb_write("axis0.requested_state", 8)
    assert look(rig.module, 1).position == pytest.approx(3.25, abs=0.001)
