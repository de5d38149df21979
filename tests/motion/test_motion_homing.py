"""Homing by the methods of the simulated drive: the home position, a real edge each time, stale bits, errors and time-outs."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from types import SimpleNamespace

import pytest

from axisbus.cia402.port import ValueTransport
from axisbus.errors import ArgumentError, DriveFault, HomingError, StateError, Stopped
from axisbus.motion.moves.homing import HomingJob, HomingRun
from axisbus.motion.parameters import HomingParameters
from axisbus.motion.states import AxisState
from axisbus.sim.modes.homing import Homing
from axisbus.sim.motor import MotorParams
from kit.motion.plant_recorder import HALT, Watch
from kit.motion.rig import PERIOD, rig
from kit.motion.steps import Drive

BIT_4 = 0x10
TURN = 16_384
SEARCH = HomingParameters(speed_switch=50.0, speed_zero=5.0, acceleration=500.0)
# Limit switches at -40 and +30 degrees, an index pulse 1000 increments into each turn, power-up at 10 degrees.
MACHINE = MotorParams(
    limit_switches=(-40_000.0, 30_000.0),
    index_offset=1_000.0,
    increments_per_turn=TURN,
    start_position=10_000.0,
)


def edges(watch: Watch) -> int:
    """How often bit 4 rose."""
    bits = [
        bool(item.outputs.controlword & BIT_4) for item in watch.sent if item.outputs.controlword is not None
    ]
    return sum(after and not before for before, after in pairwise([False, *bits]))


@pytest.mark.parametrize(
    ("method", "home"),
    [
        (17, -40_000),  # the negative limit switch
        (18, 30_000),  # the positive limit switch
        (33, 1_000),  # the next index pulse below 10 000: 1000 + 0 turns
        (34, 1_000 + TURN),  # the next index pulse above 10 000
        (35, 10_000),  # in place
        (37, 10_000),
    ],
)
def test_each_homing_method_sets_home_at_the_right_position(method, home):
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    assert not r.axis.homed
    watch = Watch(r)
    r.axis.home(method).wait(20)
    r.run(0.1)
    motor = r.drive.axis.motor.position
    assert r.drive.position == pytest.approx(motor - home, abs=1)  # the drive counts from home
    assert r.axis.position == pytest.approx((motor - home) / 1000, abs=0.002)
    assert abs(r.drive.axis.motor.velocity) < 1.0
    assert r.axis.homed
    assert r.axis.state is AxisState.STANDSTILL
    assert edges(watch) == 1
    assert watch.modes[-1] == 6
    if method in (35, 37):
        assert watch.displacement == 0.0


def test_objects_written_before_homing():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    watch = Watch(r)
    r.axis.home(17).wait(20)
    assert watch.writes == [(0x6098, 0, 17), (0x6099, 1, 50_000), (0x6099, 2, 5_000), (0x609A, 0, 500_000)]
    first_bit_4 = next(item.t for item in watch.sent if (item.outputs.controlword or 0) & BIT_4)
    last_write = [item.t for item in watch.sent if item.outputs.sdo][-1]
    assert first_bit_4 > last_write  # the search began with its objects in place


def test_bit_4_stays_high_during_the_search_and_falls_after_it():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    watch = Watch(r)
    r.axis.home(18).wait(20)
    r.run(0.1)
    assert watch.words == [0x0F, 0x1F, 0x0F]


def test_bit_4_is_low_for_two_cycles_in_homing_mode_before_it_rises():
    """In the mode before it meant something else: only low in homing mode and then high is an edge for certain."""
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    watch = Watch(r)
    r.axis.home(37).wait(5)
    asked = [item.t for item in watch.sent if item.outputs.mode == 6][-1]  # until 6061h shows it
    rises = next(item.t for item in watch.sent if (item.outputs.controlword or 0) & BIT_4)
    assert rises - asked >= 2.5 * PERIOD


def test_the_speeds_of_the_search_are_those_of_the_cell():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    watch = Watch(r)
    r.axis.home(18).wait(20)
    assert watch.speed == pytest.approx(50_000, rel=0.02)
    assert watch.acceleration() <= 500_000 * 1.05
    back = min(row.velocity for row in watch.rows)
    assert back == pytest.approx(-5_000, rel=0.02)


# Once more.


@pytest.mark.parametrize("method", [17, 18, 35, 37])
def test_a_second_homing_takes_a_second_edge_and_does_not_believe_the_bits_of_the_first(method):
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.axis.home(method).wait(20)
    watch = Watch(r)
    start = r.now
    r.axis.home(method).wait(20)
    assert edges(watch) == 1
    low_for = next(item.t for item in watch.sent if (item.outputs.controlword or 0) & BIT_4) - start
    assert low_for >= 2 * PERIOD - 1e-9  # long enough for the drive to see it low
    if method in (17, 18):
        assert watch.displacement > 100  # it searched again
    assert r.axis.homed


def slow_to_clear(r, bits: int, seconds: float) -> None:
    """A drive whose statusword keeps ``bits`` of the last homing for some time after bit 4 has risen."""
    port = r.ports["x"]
    read = port.read
    risen: list[float] = []

    def stale(now):
        inputs = read(now)
        if r.drive.controlword & BIT_4 and not risen:
            risen.append(now)
        word = inputs.statusword
        if word is None or (risen and now - risen[0] > seconds):
            return inputs
        return inputs._replace(statusword=word._replace(value=word.value | bits))

    port.read = stale


@pytest.mark.parametrize("late", [0.06, 0.5, 0.9])
def test_bits_12_and_10_of_the_first_homing_are_not_the_end_of_a_slow_second_one(late):
    """The axis is at standstill while it is late, as behind a brake that opens."""
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.axis.home(17).wait(20)
    r.axis.move_absolute(20.0).wait(5)
    r.run(0.3)
    slow_to_clear(r, 0x1400, late)
    step, begun = Homing.step, r.now

    def step_late(mode, axis, dt):
        if r.now >= begun + late:
            step(mode, axis, dt)

    r.drive._all_modes[6].step = partial(step_late, r.drive._all_modes[6])
    handle = r.axis.home(17)
    r.run(0.5)
    assert handle.busy  # 20 degrees to go back at 50 deg/s
    handle.wait(20)
    assert r.drive.position == pytest.approx(r.drive.axis.motor.position + 40_000, abs=1)


@pytest.mark.parametrize("late", [0.06, 0.9])
def test_bit_13_of_the_homing_before_does_not_fail_a_slow_second_one(late):
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    slow_to_clear(r, 0x2000, late)
    r.axis.home(17).wait(20)
    assert r.axis.homed


@pytest.mark.parametrize("poll", [0.1, 0.3])
def test_a_slow_statusword_of_the_homing_before_is_not_the_end_of_the_next(poll):
    """A word that was polled just after the edge is old: the drive shows the new homing later, and the next poll is late."""
    r = rig(motor=MACHINE, homing=SEARCH, port={"max_age": {"statusword": 1.0}}).enabled()
    r.axis.home(17).wait(20)
    r.axis.move_absolute(20.0).wait(5)
    r.run(0.3)
    port = r.ports["x"]
    read, polled, risen = port.read, [], []

    def slow(now):
        """The first poll after the edge answers within 8 ms, the next ones each ``poll`` later."""
        inputs = read(now)
        if r.drive.controlword & BIT_4 and not risen:
            risen.append(now)
        word = (
            inputs.statusword._replace(value=inputs.statusword.value | 0x1400)
            if not risen
            else inputs.statusword
        )
        if risen and len(risen) == 1 and now > risen[0] + 0.001:
            risen.append(now)
            polled.append(polled[-1]._replace(stamp=now - 0.002))
        elif not polled or now >= polled[-1].stamp + poll:
            polled.append(word._replace(stamp=now - 0.001))
        return inputs._replace(statusword=polled[-1])

    port.read = slow
    handle = r.axis.home(17)
    handle.wait(20)
    assert r.drive.position == pytest.approx(r.drive.axis.motor.position + 40_000, abs=1)
    assert r.drive.axis.motor.position < -30_000  # it has searched: 20 degrees back, and to the switch


def test_homing_in_place_ends_on_an_event_driven_drive_whose_word_does_not_change():
    events = dict.fromkeys(
        ("statusword", "mode", "position", "velocity", "torque", "demand"), ValueTransport.EVENT_PDO
    )
    r = rig(port={"inputs": events, "event_timer": 0.1}).enabled()
    r.axis.home(37).wait(3)
    r.axis.home(37).wait(3)
    assert r.axis.homed


def test_after_homing_the_axis_moves_in_the_new_count_and_nothing_jumps():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.axis.home(18).wait(20)
    r.run(0.1)
    watch = Watch(r)
    r.axis.move_absolute(-10.0).wait(5)
    assert watch.targets[-1] == -10_000
    assert r.drive.axis.motor.position == pytest.approx(20_000, abs=60)
    assert watch.acceleration() <= 500_000 * 1.05
    assert watch.travel[1] <= watch.rows[0].position + 2


def test_an_axis_that_was_past_the_wrap_of_integer32_counts_from_home_again():
    r = rig(motor=MotorParams(start_position=2.0**31 - 10_000))
    r.device.write(0x607D, 1, 0)
    r.device.write(0x607D, 2, 0)  # no software limits
    r.enabled()
    r.axis.move_velocity(50.0).wait(5)
    r.until(lambda: r.axis.position > 2**31 / 1000)
    r.axis.halt().wait(5)
    r.axis.home(37).wait(5)
    r.run(0.1)
    assert r.axis.position == 0.0
    r.axis.move_absolute(5.0).wait(5)
    assert r.drive.position == pytest.approx(5_000, abs=60)


def test_a_home_offset_of_the_drive_is_the_position_at_home():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.device.write(0x607C, 0, 5_000)
    r.axis.home(18).wait(20)
    r.run(0.1)
    assert r.drive.position == pytest.approx(r.drive.axis.motor.position - 30_000 + 5_000, abs=1)
    assert r.axis.position == pytest.approx(r.drive.position / 1000)


# Errors.


def test_a_homing_error_of_the_drive_is_reported_with_its_bits_and_method():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.drive.dials.homing_fails = True
    with pytest.raises(HomingError) as caught:
        r.axis.home(17).wait(5)
    assert "homing by method 17" in caught.value.message
    assert "statusword bit 13" in caught.value.observed
    assert "switch" in caught.value.remedy
    assert r.axis.state is AxisState.ERRORSTOP
    assert not r.axis.homed
    r.run(0.3)
    assert not r.drive.controlword & BIT_4


def test_a_method_that_the_drive_does_not_have_fails():
    r = rig(homing=SEARCH).enabled()  # no switches at all
    with pytest.raises(HomingError):
        r.axis.home(17).wait(5)
    assert not r.axis.homed


def test_the_error_bit_of_a_failed_homing_does_not_fail_the_next():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.drive.dials.homing_fails = True
    with pytest.raises(HomingError):
        r.axis.home(17).wait(5)
    r.until(lambda: r.core.stop_sequence is None)
    r.drive.dials.homing_fails = False
    r.axis.reset().wait(1)
    r.axis.home(17).wait(20)
    assert r.axis.homed


def test_a_home_that_is_never_found_ends_in_time_and_the_axis_is_halted():
    nowhere = MotorParams(limit_switches=(-4e9, 4e9))
    r = rig(motor=nowhere, homing=SEARCH).enabled()
    start = r.now
    with pytest.raises(HomingError, match="method 17") as caught:
        r.axis.home(17, timeout=1.0).wait(10)
    assert r.now - start == pytest.approx(1.0, abs=0.15)
    assert "home was not found within 1 s" in caught.value.observed
    assert r.axis.state is AxisState.ERRORSTOP
    r.until(lambda: r.core.stop_sequence is None)
    watch = Watch(r)
    r.run(1.0)
    assert watch.displacement < 1.0
    assert r.drive.controlword & HALT
    assert not r.drive.controlword & BIT_4


@pytest.mark.parametrize(
    ("word", "told"),
    [
        (None, "no fresh statusword, attained (bit 12) 0, reached (bit 10) 0"),
        (0x0637, "statusword 0x0637, attained (bit 12) 0, reached (bit 10) 1"),
        (0x1237, "statusword 0x1237, attained (bit 12) 1, reached (bit 10) 0"),
    ],
)
def test_observations_of_a_failed_homing(word, told):
    homing = HomingRun(HomingJob(17, None, None, None, 1.0), Drive().parameters)
    error = homing._error(SimpleNamespace(statusword=word), "why")
    assert error.observed == f"why; {told}"
    is_found = word == 0x1237
    assert ("switch" in error.remedy) is not is_found
    assert ("the condition of bit 10" in error.remedy) is is_found


def test_the_cell_s_time_out_applies_if_the_call_gives_none():
    nowhere = MotorParams(limit_switches=(-4e9, 4e9))
    r = rig(motor=nowhere, homing=HomingParameters(17, 50.0, 5.0, 500.0, timeout=0.7)).enabled()
    start = r.now
    with pytest.raises(HomingError):
        r.axis.home().wait(10)
    assert r.now - start == pytest.approx(0.7, abs=0.15)


@pytest.mark.parametrize("how", ["halt", "stop", "disable", "quick_stop"])
def test_a_stop_ends_the_homing_and_the_axis_is_not_homed(how):
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.axis.home(37).wait(5)
    handle = r.axis.home(17)
    r.until(lambda: abs(r.drive.axis.motor.velocity) > 40_000)
    assert r.axis.state is AxisState.HOMING
    getattr(r.axis, how)().wait(5)
    with pytest.raises(Stopped, match=how):
        handle.wait()
    assert not r.axis.homed  # the old home was given up when the search began
    assert abs(r.drive.axis.motor.velocity) < 1.0
    watch = Watch(r)
    r.run(1.0)
    assert watch.displacement < 1.0


def test_a_halted_homing_can_be_begun_again():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.axis.home(17)
    r.until(lambda: abs(r.drive.axis.motor.velocity) > 40_000)
    r.axis.halt().wait(5)
    r.run(0.5)
    watch = Watch(r)
    r.axis.home(17).wait(20)
    assert edges(watch) == 1
    assert r.axis.homed
    assert r.drive.position == pytest.approx(r.drive.axis.motor.position + 40_000, abs=1)


def test_a_motion_command_does_not_take_over_from_a_homing():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    handle = r.axis.home(17)
    r.run(0.3)
    with pytest.raises(StateError, match="Homing"):
        r.axis.move_relative(1.0).wait(1)
    with pytest.raises(StateError, match="Homing"):
        r.axis.home(37).wait(1)
    handle.wait(20)


def test_homing_while_the_axis_moves_is_refused():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    r.axis.move_velocity(5.0).wait(2)
    with pytest.raises(StateError, match="moves"):
        r.axis.home(37).wait(1)
    assert r.axis.state is AxisState.CONTINUOUS_MOTION


def test_a_fault_during_the_search_names_the_interrupted_command():
    r = rig(motor=MACHINE, homing=SEARCH).enabled()
    handle = r.axis.home(17)
    r.until(lambda: abs(r.drive.axis.motor.velocity) > 40_000)
    r.drive.fault(0x7121)
    with pytest.raises(DriveFault, match=r"during x.home\(method 17\)"):
        handle.wait(3)
    assert not r.axis.homed


def test_speeds_are_not_guessed():
    r = rig(motor=MACHINE, homing=HomingParameters(17)).enabled()
    with pytest.raises(ArgumentError, match="speed_switch is missing"):
        r.axis.home()
    r.axis.home(37).wait(3)  # nothing moves by this one
    with pytest.raises(ArgumentError, match="method is missing"):
        rig(homing=HomingParameters()).axis.home()
    with pytest.raises(ArgumentError, match="6098h"):
        rig(homing=SEARCH).axis.home(200)


def test_a_restart_of_the_node_takes_the_home_away():
    r = rig().enabled()
    r.axis.home(37).wait(3)
    r.axis.disable().wait(3)
    r.cycle.nmt(0x81)
    r.run(0.5)
    assert not r.axis.homed
