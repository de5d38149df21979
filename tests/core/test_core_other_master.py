"""Axes that another master commands are stopped hard, others by the policy, and one that it enables again leaves operational."""

from __future__ import annotations

import pytest

from axisbus.cia301.nmt import NmtState
from axisbus.errors import SecondMasterError
from axisbus.motion.parameters import HoldsLoad
from axisbus.motion.states import AxisState
from axisbus.motion.stop.stop_sequence import StopLevel
from kit.motion.rig import rig
from kit.plant_probe import ENABLED, OFF


def error() -> SecondMasterError:
    return SecondMasterError("another master commands the drives", observed="RPDOs to node 1 (201h)")


def turning(made, velocity=90.0):
    made.enabled()
    for axis in made.axes.values():
        axis.move_velocity(velocity).wait(5)
    return made


def speed(made, name="x"):
    return abs(made.drive_of(name).axis.motor.velocity)


def test_the_axis_is_quick_stopped_and_its_group_with_it():
    made = turning(rig("xy"))
    made.scan.intrude(error(), ["x"])
    took = made.until(lambda: speed(made, "x") < 1.0 and speed(made, "y") < 1.0, 1.0)
    assert took < 0.5
    made.run(1.0)
    assert made.axes["x"].state is AxisState.ERRORSTOP
    assert isinstance(made.axes["x"].error, SecondMasterError)
    assert made.axes["y"].state is AxisState.STANDSTILL
    assert int(made.drive_of("x").power.stage) in OFF


def test_a_running_halt_becomes_a_quick_stop():
    made = turning(rig("x"))
    made.axis.halt()
    made.run(0.02)
    assert made.core.stop_sequence.level is StopLevel.HALT
    made.scan.intrude(error(), ["x"])
    made.run(0.02)
    assert made.core.stop_sequence.level is StopLevel.QUICK_STOP
    made.run(1.0)
    assert isinstance(made.axis.error, SecondMasterError)


def test_an_axis_that_was_never_commanded_is_left_alone():
    made = rig("x")
    made.run(0.1)
    made.scan.intrude(error(), ["x", "of no axis here"])
    made.run(0.1)
    assert made.axis.state is not AxisState.ERRORSTOP
    assert not made.core.touched


def test_while_another_master_commands_the_axis_stays_stopped_with_one_error():
    made = turning(rig("x"))
    for _ in range(30):
        made.scan.intrude(error(), ["x"])
        made.run(0.1)
    assert speed(made) < 1.0
    assert int(made.drive_of("x").power.stage) in OFF
    assert made.device.nmt == NmtState.OPERATIONAL
    assert str(made.axis.error).count("another master commands") == 1
    made.axis.reset().wait(5)
    made.axis.enable().wait(5)  # it is gone now
    assert made.axis.state is AxisState.STANDSTILL


def enabled_by_another(made, monkeypatch):
    """The other master's controlwords come after ours, up to operation enabled."""
    write = made.ports["x"].write
    with monkeypatch.context() as patched:
        for word in (0x06, 0x07, 0x0F):
            patched.setattr(
                made.ports["x"],
                "write",
                lambda outputs, word=word: write(outputs._replace(controlword=word)),
            )
            made.run(0.05)


@pytest.mark.parametrize("holds", [HoldsLoad.NO, HoldsLoad.BRAKE])
def test_an_axis_enabled_by_another_master_leaves_operational_unless_a_load_may_hang_on_it(
    holds, monkeypatch
):
    made = turning(rig("x", holds_load=holds))
    made.scan.intrude(error(), ["x"])
    made.run(1.0)
    enabled_by_another(made, monkeypatch)
    assert int(made.drive_of("x").power.stage) == ENABLED
    made.scan.intrude(error(), ["x"])
    made.run(1.0)
    assert (made.device.nmt == NmtState.STOPPED) is (holds is HoldsLoad.NO)
    assert int(made.drive_of("x").power.stage) in OFF
