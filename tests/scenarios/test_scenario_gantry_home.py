"""A pair is homed by the switches of both axes: both move until both were seen, and the second axis alone makes it square."""

from __future__ import annotations

import pytest

from axisbus.errors import (
    ArgumentError,
    ConfigError,
    DriveFault,
    HomingError,
    Interrupted,
    ProbeError,
    StateError,
)
from axisbus.motion.states import AxisState
from kit.gantry.pair import AXIS, CYCLE, HOMING, pair_of, put_switches
from kit.plant_probe import ENABLED

# positions = [5.0, 7.0]: in a square beam (offset 0) the switch of y is met 2 deg before that of x, going down.
NEAR = 0.05


def ready(scenario, x=-40.0, y=-38.0, more=HOMING, stiff=0.0, **how):
    """A pair that must be homed, with its switches at x and y (deg of the motors), enabled."""
    limits = f"{AXIS}\nposition_limits = [-300.0, 300.0]"
    pair = pair_of(scenario, axis=limits, more=more, stiff=stiff, required=True, **how)
    put_switches(pair, x, y)
    pair.gantry.enable().wait(5)
    return pair


def motors(pair):
    return [pair.record(name).sample.position for name in "xy"]


@pytest.mark.parametrize("bent", [0.0, 3.0, -3.0, 9.5, -9.5])
@pytest.mark.parametrize("offset", [0.0, 1.5])
def test_both_sides_are_homed_at_their_switches_and_the_beam_is_square(scenario, bent, offset):
    # Square means y is offset farther than x: motor y = motor x + (switch of y - switch of x) - 2 + offset.
    pair = ready(scenario, -40.0, -38.0 + offset - bent - offset, gantry=f"offset = {offset}")
    begun = pair.moment()
    pair.gantry.home().wait(30)
    at = motors(pair)
    assert pair["x"].position == pytest.approx(at[0] + 40.0 + 5.0, abs=NEAR)
    assert pair["y"].position == pytest.approx(at[1] + 38.0 + bent + 7.0, abs=NEAR)
    assert pair.gantry.skew == pytest.approx(0.0, abs=NEAR)
    assert pair["y"].position - pair["x"].position == pytest.approx(offset, abs=NEAR)
    # Until both were seen they moved together: the distance between the motors has changed by squaring alone.
    assert pair.worst_skew(begun) == pytest.approx(abs(-bent + offset), abs=NEAR)
    assert pair.fastest("x", begun) < 21.0
    assert pair.fastest("y", begun) < 21.0
    assert pair.gantry.homed
    assert {axis.state for axis in pair.gantry} == {AxisState.STANDSTILL}
    pair.gantry.move_absolute(20.0).wait(5)
    assert motors(pair) == pytest.approx([-25.0, -25.0 - bent + offset], abs=NEAR)
    assert pair.gantry.max_skew == 8.0


def test_both_sides_move_together_until_the_second_reaches_its_switch(scenario):
    pair = ready(scenario, -40.0, -43.0)
    begun = pair.moment()
    home = pair.gantry.home()
    pair.until(lambda: motors(pair)[1] < -43.0)
    assert pair.worst_skew(begun) < NEAR
    assert pair.speed("x") == pytest.approx(20.0, rel=0.05)
    home.wait(30)
    assert pair.worst_skew(begun) == pytest.approx(5.0, abs=NEAR)  # 3 + 2


@pytest.mark.parametrize("y", [-62.0, -20.0, -500.0, 500.0])
def test_switches_that_do_not_agree_stop_both_and_nothing_is_homed(scenario, y):
    pair = ready(scenario, -40.0, y)
    error = pair.failure_of(pair.gantry.home(), 30)
    assert isinstance(error, HomingError)
    assert "skew = 12 deg" in error.message
    pair.run(0.5)
    assert pair.speed("x") == pair.speed("y") == 0.0
    assert not pair.gantry.homed
    assert pair.worst_skew() < NEAR
    with pytest.raises(ArgumentError, match="not homed"):
        pair.gantry.move_absolute(10.0)
    with pytest.raises(StateError, match=r"not homed|nobody knows"):
        pair.gantry.skew  # noqa: B018
    pair.gantry.move_relative(-5.0).wait(5)  # it may be moved with its present skew


def test_a_search_without_a_switch_ends_at_its_distance(scenario):
    pair = ready(scenario, -500.0, -500.0)
    error = pair.failure_of(pair.gantry.home(), 30)
    assert isinstance(error, HomingError)
    assert "90 deg" in error.message
    assert "x and y" in error.observed
    assert motors(pair) == pytest.approx([-90.0, -90.0], abs=NEAR)
    assert not pair.gantry.homed


def test_moves_buffered_behind_a_homing_begin_when_it_is_done(scenario):
    pair = ready(scenario)
    home = pair.gantry.home()
    waiting = [pair.gantry.move_relative(12.0, buffer=True), pair.gantry.move_relative(-4.0, buffer=True)]
    at = pair.end_of(home, 30), motors(pair)
    assert at[0] is None
    assert [pair.end_of(handle, 30) for handle in (home, *waiting)] == [None] * 3
    assert motors(pair) == pytest.approx([place + 8.0 for place in at[1]], abs=NEAR)
    assert {axis.state for axis in pair.gantry} == {AxisState.STANDSTILL}


@pytest.mark.parametrize("how", ["no switch", "halt", "fault"])
def test_moves_buffered_behind_a_failed_homing_end_with_it(scenario, how):
    pair = ready(scenario, -500.0, -500.0)
    home = pair.gantry.home()
    waiting = [pair.gantry.move_relative(12.0, buffer=True) for _ in range(2)]
    if how != "no switch":
        pair.run(1.0)
        pair.gantry.halt() if how == "halt" else pair.drive("x").fault(0x2310)
    assert pair.failure_of(home, 30) is not None
    assert all(pair.failure_of(handle, 2) is not None for handle in waiting)
    pair.run(1.0)
    there = motors(pair)
    pair.run(1.0)
    assert motors(pair) == pytest.approx(there, abs=0.01)


def test_with_one_switch_the_beam_is_taken_to_be_square(scenario):
    one = HOMING.replace("positions = [5.0, 7.0]", 'positions = [5.0]\nswitches = "first"')
    pair = ready(scenario, -40.0, 500.0, more=one, gantry="offset = 1.5")
    pair.gantry.home().wait(30)
    at = motors(pair)
    assert pair["x"].position == pytest.approx(at[0] + 45.0, abs=NEAR)
    assert pair["y"].position == pytest.approx(pair["x"].position + 1.5, abs=NEAR)
    assert pair.worst_skew() < NEAR


@pytest.mark.parametrize("bent", [4.0, -4.0])
def test_after_homing_at_switches_beyond_the_limits_the_beam_moves_back_within_them(scenario, bent):
    pair = pair_of(
        scenario, axis=f"{AXIS}\nposition_limits = [10.0, 300.0]", more=HOMING, stiff=0.0, required=True
    )
    put_switches(pair, -40.0, -38.0 - bent)
    pair.gantry.enable().wait(5)
    begun = pair.moment()
    pair.gantry.home().wait(30)
    assert pair.gantry.position == pytest.approx(10.0, abs=NEAR)
    assert pair.gantry.skew == pytest.approx(0.0, abs=NEAR)
    assert pair.worst_skew(begun) == pytest.approx(4.0, abs=NEAR)


def test_a_second_homing_gives_the_same_positions(scenario):
    pair = ready(scenario, -40.0, -37.0)
    pair.gantry.home().wait(30)
    first = [axis.position - at for axis, at in zip(pair.gantry, motors(pair), strict=True)]
    pair.gantry.move_absolute(50.0).wait(9)
    pair.gantry.home().wait(30)
    again = [axis.position - at for axis, at in zip(pair.gantry, motors(pair), strict=True)]
    assert again == pytest.approx(first, abs=NEAR)
    assert pair.gantry.skew == pytest.approx(0.0, abs=NEAR)


@pytest.mark.parametrize("after", [0.02, 0.1, 0.5, 1.9, 2.1, 2.3, 2.5])
@pytest.mark.parametrize("what", ["halt", "stop", "one halt", "quick_stop", "disable", "fault"])
def test_a_fault_or_a_stop_during_homing_ends_it_with_both_axes_at_standstill(scenario, after, what):
    pair = ready(scenario, -40.0, -43.0)
    home = pair.gantry.home()
    pair.run(after)
    if what == "fault":
        pair.machine.simulated_node(2).fault(0x2310)
    elif what == "one halt":
        pair["y"].halt()
    else:
        getattr(pair.gantry, what)()
    error = pair.end_of(home, 30)
    assert isinstance(error, DriveFault if what == "fault" else Interrupted)
    pair.run(1.0)
    assert pair.speed("x") == pair.speed("y") == 0.0
    assert pair.worst_skew() < 5.0 + 1.0
    for name in "xy":
        assert not pair.core(name).probes.requests
    if what == "one halt":
        pair.gantry.move_relative(-motors(pair)[0]).wait(9)  # to the side from which the switches are met
        pair.gantry.home().wait(30)
        assert pair.gantry.skew == pytest.approx(0.0, abs=NEAR)


def test_no_motion_before_both_touch_probes_are_armed(scenario):
    pair = ready(scenario)
    pair.drive("y").dials.probe_deaf = True
    error = pair.failure_of(pair.gantry.home(), 30)
    assert isinstance(error, ProbeError)
    assert motors(pair) == [0.0, 0.0]
    assert {pair.stage(name) for name in "xy"} == {ENABLED}


def test_a_side_that_jams_during_the_search_stops_both(scenario):
    pair = ready(scenario, -400.0, -400.0)
    home = pair.gantry.home()
    pair.run(1.0)
    pair.drive("y").dials.blocked = True
    assert pair.failure_of(home, 30) is not None
    pair.run(1.0)
    assert pair.speed("x") == 0.0
    assert pair.worst_skew() < 12.0 + 20.0 * 6 * CYCLE + 1.0


def test_before_homing_only_changes_count_as_skew(scenario):
    pair = pair_of(scenario, axis=f"{AXIS}\nposition_limits = [-300.0, 300.0]", stiff=0.0, required=True)
    pair.drive("y").dials.encoder_jump = -1500
    pair.run(0.1)
    assert "as at the first cycle" in pair.failure_of(pair.gantry.enable()).observed
    pair.drive("y").dials.encoder_jump = 1500
    pair.run(0.1)
    pair.gantry.enable().wait(5)
    pair.gantry.move_relative(20.0).wait(5)
    pair.gantry.set_position(0.0, square=True).wait(2)
    assert pair.gantry.homed
    pair.gantry.move_absolute(10.0).wait(5)


def test_a_gantry_is_not_homed_while_it_moves(scenario):
    pair = ready(scenario)
    pair.gantry.move_relative(50.0)
    pair.run(0.1)
    assert isinstance(pair.failure_of(pair.gantry.home()), StateError)
    pair.run(2.0)
    home = pair.gantry.home()
    pair.run(0.3)
    assert isinstance(pair.failure_of(pair.gantry.home()), StateError)
    assert isinstance(pair.failure_of(pair.gantry.move_relative(1.0)), StateError)
    home.wait(30)


@pytest.mark.parametrize("after", [0.0, CYCLE, 0.3])
def test_nothing_interrupts_a_homing_while_its_touch_probes_are_armed(scenario, after):
    pair = ready(scenario)
    home = pair.gantry.home()
    pair.run(after)
    for command in (
        lambda: pair.gantry.move_relative(1.0),
        lambda: pair.gantry.move_velocity(5.0),
        lambda: pair.gantry.square(velocity=2.0),
        lambda: pair.gantry.set_position(0.0),
    ):
        error = pair.failure_of(command())
        assert isinstance(error, StateError)
        assert "the pair is being homed" in error.message
    home.wait(30)
    assert pair.gantry.homed


def test_a_cell_that_homes_a_pair_by_touch_probes_is_refused_if_a_drive_has_none(scenario):
    with pytest.raises(ConfigError, match="the drive of x has no touch probe"):
        pair_of(scenario, eds="builtin:gim6010-8", more=HOMING, stiff=0.0)
