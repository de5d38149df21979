"""Whatever follows upon whatever, at any moment and in any mode: the plant is not jolted, and ends where the last command says."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.errors import Interrupted, StateError
from axisbus.motion.parameters import AxisLimits, HomingParameters
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.motion.plant_recorder import Watch
from kit.motion.rig import rig

RAMP = 500.0  # degrees/s², of every command and default
# A drive takes a mode within some cycles and a set-point in some: meanwhile it may brake on its own ramp, and speed up again.
BOUND = RAMP * 1000 * 1.6

TARGETS = st.floats(-150, 150)
VELOCITIES = st.floats(-200, 200)
PAUSES = st.sampled_from([0.0, 0.01, 0.02, 0.05, 0.1, 0.3, 1.0])
COMMANDS = st.one_of(
    st.tuples(st.just("move_absolute"), TARGETS),
    st.tuples(st.just("move_relative"), TARGETS),
    st.tuples(st.just("move_additive"), TARGETS),
    st.tuples(st.just("move_velocity"), VELOCITIES),
    st.tuples(st.just("jog"), VELOCITIES),
    st.tuples(st.just("cyclic_velocity"), VELOCITIES),
    st.tuples(st.just("follow"), TARGETS),
    st.tuples(st.just("home"), st.just(37)),
    st.tuples(st.just("halt"), st.none()),
    st.tuples(st.just("stop"), st.none()),
    st.tuples(st.just("release"), st.none()),
)


def give(r, what: str, value):
    """Give one command; None where the call itself cannot be made now."""
    if what == "follow":
        here = r.axis.position
        return r.axis.follow(TrapezoidalTrajectory(here, here + value, 100.0, RAMP))
    method = getattr(r.axis, what)
    return method() if value is None else method(value)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.tuples(COMMANDS, PAUSES), min_size=2, max_size=8),
    st.sampled_from([0.0, 0.0, 0.03, 0.12]),
    st.sampled_from([0.0, 0.0, 0.03]),
    TARGETS,
)
def test_no_sequence_of_commands_jolts_the_axis(commands, mode_delay, acknowledge_delay, last):
    r = rig(homing=HomingParameters(method=37), limits=AxisLimits(velocity=1000.0)).enabled()
    r.drive.dials.mode_delay, r.drive.dials.acknowledge_delay = mode_delay, acknowledge_delay
    watch = Watch(r)
    handles = []
    for (what, value), pause in commands:
        handles.append(give(r, what, value))
        r.run(pause)
    r.axis.stop().wait(10)
    assert abs(r.drive.axis.motor.velocity) < 1.0
    r.axis.release().wait(1)
    r.axis.move_absolute(last).wait(10)
    r.run(0.2)
    assert r.axis.state is AxisState.STANDSTILL
    assert r.drive.position == pytest.approx(last * 1000, abs=2)
    assert watch.acceleration() <= BOUND
    for handle in handles:
        assert not handle.busy
        assert handle.exception() is None or isinstance(handle.exception(), (Interrupted, StateError))
