"""The values used for a limit are known from the drive: its ramps, and its speed by positions."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.options import Ramp
from axisbus.errors import DriveError, LimitError, StateError
from axisbus.motion.moves.prepare import RampTransfers
from axisbus.motion.moves.profile import MoveProfile, on_ramps
from axisbus.motion.parameters import AxisLimits, HomingParameters
from axisbus.motion.states import AxisState
from axisbus.motion.stop.limits import LimitMonitor
from axisbus.motion.stop.overspeed import MARGIN, MARGIN_OF_COMMAND, SpeedWatch
from axisbus.motion.stop_deceleration import Braking, CommandedMotion
from axisbus.motion.velocity_estimator import VelocityEstimator
from axisbus.sim.motor import MotorParams
from kit.motion.rig import SCALE, rig
from kit.motion.steps import Drive

MODE = ModeOfOperation
BOUNDED = {
    "limits": AxisLimits(position=(-100.0, 100.0), velocity=400.0),
    "homing": HomingParameters(required=False),
}
PROFILE = MoveProfile(10_000, 500_000, 500_000, 10_000.0, 500_000.0, None, 500_000.0, 500_000.0)
READ_ONLY, LOCAL, GONE, BAD_VALUE = 0x0601_0002, 0x0800_0022, 0x0602_0000, 0x0609_0030


def farthest(r, seconds: float = 8.0) -> float:
    """Let an axis continue; return how far it came, in degrees."""
    top = 0.0
    for _ in range(round(seconds / 0.01)):
        r.run(0.01)
        top = max(top, abs(r.drive.axis.motor.position) / SCALE)
    return top


def clipped(r, index: int, value: int) -> None:
    """Let a drive have no other value in an object, whatever is written into it."""
    dictionary = r.device.dictionary
    dictionary.on_write(index << 8, lambda new: None if new == value else dictionary.set(index << 8, value))
    dictionary.set(index << 8, value)


# -- ramps -----------------------------------------------------------------------------------------------------------


def transfers(drive: Drive, answers: dict[int, tuple[int | None, int | None]]):
    """Write both ramps; ``answers`` has, for a request's number from 1, a value or an abort code."""
    ramps = RampTransfers([(0x6083, 0, 500_000), (0x6084, 0, 500_000)], drive.parameters)
    ramps.step(*drive.cycle(statusword=0x0237))
    for request in drive.order.sdo:
        value, code = answers.get(request.id, (request.value or 500_000, None))
        drive.answers(request.id, value, code)
    assert ramps.step(*drive.cycle())
    return ramps


@pytest.mark.parametrize(
    ("answers", "up", "down"),
    [
        ({}, 500_000.0, 500_000.0),
        ({4: (2000, None)}, 500_000.0, 2000.0),  # clipped
        ({3: (7000, None)}, 7000.0, 500_000.0),
        ({2: (None, READ_ONLY), 4: (2000, None)}, 500_000.0, 2000.0),
        ({2: (None, LOCAL), 4: (2000, None)}, 500_000.0, 2000.0),
        ({1: (None, READ_ONLY), 3: (900_000, None)}, 900_000.0, 500_000.0),
        ({4: (None, GONE)}, 500_000.0, 500_000.0),  # accepted, and unreadable: the written value
        ({2: (None, READ_ONLY), 4: (None, GONE)}, 500_000.0, None),
        ({2: (None, READ_ONLY), 4: (0, None)}, 500_000.0, None),
    ],
)
def test_a_move_is_reckoned_with_the_ramps_that_its_drive_has(answers, up, down):
    found = transfers(Drive(), answers).applied(PROFILE)
    assert (found.up, found.down) == (up, down)
    assert found.ramp == (min(up, down) if down else None)
    assert (found.acceleration, found.deceleration) == (
        500_000,
        500_000,
    )  # the commanded values are unchanged


def test_a_value_that_a_drive_cannot_take_is_an_error():
    ramps = RampTransfers([(0x6084, 0, 1)], (drive := Drive()).parameters)
    ramps.step(*drive.cycle(statusword=0x0237))
    drive.answers(drive.order.sdo[0].id, None, BAD_VALUE)
    with pytest.raises(DriveError, match="6084h"):
        ramps.step(*drive.cycle())


def test_a_drive_without_6084h_brakes_as_it_accelerates():
    whole = Drive().parameters
    few = replace(whole, objects=whole.objects - {0x6084})
    assert on_ramps(PROFILE, 7000, 500_000, few).down == 7000.0


def test_a_drive_limits_its_ramps_by_its_own_maxima():
    limited = replace(Drive().parameters, braking=Braking(most_up=30.0, most_down=20.0))
    found = on_ramps(PROFILE, 7000, 8000, limited)
    assert (found.up, found.down, found.ramp) == (30.0, 20.0, 20.0)


@pytest.mark.parametrize("known_before", [True, False])
@pytest.mark.parametrize("fixed", [20_000, 200_000])
def test_limits_are_kept_by_a_drive_that_has_another_deceleration_than_was_written(fixed, known_before):
    ramps = ((0x6084, fixed),) if known_before else ()
    r = rig(fixed_ramps=ramps, stop_times=replace(rig().core.parameters.stop_times, halt=60.0), **BOUNDED)
    clipped(r, 0x6084, fixed)
    r.enabled()
    r.axis.move_velocity(60.0)
    assert 80.0 < farthest(r, 12.0) <= 100.0
    assert isinstance(r.axis.error, LimitError)


def test_limits_are_kept_by_a_drive_that_changes_its_deceleration_with_its_mode():
    r = rig(stop_times=replace(rig().core.parameters.stop_times, halt=60.0), **BOUNDED).enabled()
    drive, changed = r.drive, []

    def weaken() -> bool:
        if drive.mode == MODE.PROFILE_VELOCITY and not changed:
            changed.append(drive.axis.settings.profile_deceleration)
            r.device.write(0x6084, 0, 20_000)
        return bool(changed)

    r.axis.move_velocity(60.0)
    r.until(weaken)
    assert changed == [500_000]
    assert 80.0 < farthest(r, 12.0) <= 100.0


@pytest.mark.parametrize("command", ["move_velocity", "move_absolute"])
def test_ramps_harder_than_max_acceleration_are_refused(command):
    r = rig(limits=AxisLimits(velocity=400.0, acceleration=600.0))
    clipped(r, 0x6083, 900_000)
    r.enabled()
    with pytest.raises(LimitError, match="steeper than max_acceleration"):
        getattr(r.axis, command)(10.0).wait(5)
    assert abs(r.drive.axis.motor.position) < 10


# -- unknown values --------------------------------------------------------------------------------------------------


def unknown_ratio():
    units = replace(Drive().parameters.units, ratio_known=False)
    return {"units": units}


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (unknown_ratio(), "the units of its velocities and accelerations are unknown"),
        ({"fixed_ramps": ((0x6084, None),)}, "does not accept a deceleration"),
        ({"fixed_ramps": ((0x6084, 0),)}, "does not accept a deceleration"),
        ({"braking": Braking(halt=Ramp.COAST, quick_stop=Ramp.COAST)}, "coast"),
        ({"braking": Braking(halt=Ramp.QUICK)}, "6085h"),
    ],
)
@pytest.mark.parametrize("command", ["move_velocity", "jog"])
def test_a_free_motion_that_could_not_be_stopped_within_its_limits_is_refused(changes, why, command):
    r = rig(**BOUNDED, **changes).enabled()
    asked = r.axis.move_velocity(10.0) if command == "move_velocity" else r.axis.jog(10.0)
    with pytest.raises(StateError, match="within its position limits in pv") as caught:
        asked.wait(5)
    assert re.search(why, caught.value.observed)
    assert caught.value.remedy
    assert r.drive.axis.motor.position == 0.0


@pytest.mark.parametrize(
    "changes",
    [unknown_ratio(), {"braking": Braking(halt=Ramp.SLOW, quick_stop=Ramp.QUICK)}],
)
def test_a_torque_that_could_not_be_stopped_within_its_limits_is_refused(changes):
    r = rig(**BOUNDED, **changes).enabled()
    with pytest.raises(StateError, match="within its position limits in tq"):
        r.axis.torque_control(1.0).wait(5)
    assert r.drive.axis.motor.position == 0.0


def test_without_an_active_limit_nothing_is_refused():
    for changes in ({}, {"homing": HomingParameters(required=True), "limits": BOUNDED["limits"]}):
        r = rig(**unknown_ratio(), **changes).enabled()
        r.axis.move_velocity(10.0).wait(5)


@pytest.mark.parametrize(
    ("place", "step", "told"),
    [
        (100_019, 10, False),  # within the window, or moving back
        (100_200, -10, False),
        (100_061, 10, True),
        (-100_061, -10, True),
        (-100_200, 10, False),
        (99_000, 10, False),
    ],
)
def test_a_move_with_an_unknown_braking_distance_is_stopped_by_its_positions(place, step, told):
    drive = Drive(**BOUNDED)
    guard = LimitMonitor(drive.parameters)
    commanded, error = CommandedMotion(speed=640.0, by_target=True, unknown=True), None
    for left in range(7, -1, -1):
        drive.cycle(statusword=0x0237, position=place - left * step)
        guard.look(drive.image)
        error = guard.danger(drive.image, AxisState.DISCRETE_MOTION, commanded=commanded)
    assert (error is not None) is told


def test_an_encoder_that_wanders_at_a_limit_stops_no_move_into_the_limits():
    drive = Drive(**BOUNDED)
    guard, edge = LimitMonitor(drive.parameters), 100_000
    commanded = CommandedMotion(speed=5000.0, down=100.0, by_target=True)
    for wander in (0, 0, -1, -1, 1, -2, 0, 2, -2, 2):
        drive.cycle(statusword=0x0237, position=edge + wander)
        guard.look(drive.image)
        assert guard.danger(drive.image, AxisState.DISCRETE_MOTION, commanded=commanded) is None


# -- speed -----------------------------------------------------------------------------------------------------------


class Watched:
    """A speed watch over an axis that makes so many increments in each cycle."""

    def __init__(
        self,
        commanded: CommandedMotion | None = None,
        mode: ModeOfOperation = MODE.PROFILE_POSITION,
        **changes,
    ):
        self.drive = Drive(
            **({"limits": AxisLimits(velocity=64.0)} | changes)
        )  # 64 000 increments per s: 1000 in a cycle
        self.watch, self.track, self.place = SpeedWatch(self.drive.parameters), VelocityEstimator(), 0.0
        self.activity = SimpleNamespace(commanded=commanded, mode=mode, set_point_source=None, in_effect=True)

    def go(self, step: float, cycles: int = 10) -> LimitError | None:
        """Go on; return the first error."""
        found = None
        for _ in range(cycles):
            self.place += step
            image, _order = self.drive.cycle(statusword=0x0237, position=round(self.place))
            self.track.take(image.position, image.position_stamp)
            found = found or self.watch.error(image, self.activity, self.track)
        return found


FASTEST = 1000  # increments in a cycle, at max_velocity


@pytest.mark.parametrize("mode", [MODE.PROFILE_POSITION, MODE.CYCLIC_SYNC_POSITION, MODE.HOMING])
@pytest.mark.parametrize("sign", [1, -1])
def test_an_axis_is_stopped_that_is_a_quarter_faster_than_max_velocity(mode, sign):
    assert Watched(mode=mode).go(sign * (FASTEST * MARGIN + 3), 30) is None
    error = Watched(mode=mode).go(sign * (FASTEST * MARGIN + 4))
    assert "faster than max_velocity" in error.message
    assert "velocity_scale" in error.remedy


def test_an_axis_twice_as_fast_as_commanded_is_stopped():
    commanded = CommandedMotion(speed=6400.0)  # 100 in a cycle
    assert Watched(commanded).go(100 * MARGIN_OF_COMMAND + 3, 30) is None
    error = Watched(commanded).go(100 * MARGIN_OF_COMMAND + 4)
    assert "faster than commanded" in error.message
    assert Watched(commanded, limits=AxisLimits()).go(300) is not None
    assert Watched(None, limits=AxisLimits()).go(30_000) is None


def test_an_axis_that_brakes_to_a_lower_speed_is_not_too_fast():
    watched = Watched(CommandedMotion(speed=64_000.0))
    assert watched.go(1000, 20) is None
    watched.activity = SimpleNamespace(
        commanded=CommandedMotion(speed=6400.0),
        mode=MODE.PROFILE_VELOCITY,
        set_point_source=None,
        in_effect=False,
    )
    assert watched.go(1000, 40) is None  # it continues as before until the new command acts
    watched.activity.in_effect = True
    for step in range(1000, 100, -2):
        assert watched.go(step, 1) is None
    assert watched.go(100, 20) is None
    assert watched.go(400, 10) is not None  # the allowance has ended with the speed


def test_the_end_of_the_previous_trajectory_is_no_overspeed():
    watched = Watched(CommandedMotion(speed=640.0))
    watched.activity.set_point_source, watched.activity.in_effect = object(), False
    for step in range(10, 900, 30):
        assert watched.go(step, 1) is None


def test_noise_and_a_position_that_is_set_again_are_no_speed():
    watched = Watched(CommandedMotion(speed=64.0))
    for number in range(60):
        assert watched.go(4 if number % 2 else -4, 1) is None
    watched.place += 1e6
    assert watched.go(1, 20) is None


def test_a_limit_in_the_drives_own_count_is_compared_with_no_position():
    raw = Watched(mode=MODE.PROFILE_POSITION, **unknown_ratio())
    assert raw.go(30_000) is None
    assert Watched(mode=MODE.CYCLIC_SYNC_POSITION, **unknown_ratio()).go(30_000) is not None


@pytest.mark.parametrize("how", ["move_absolute", "move_velocity", "home"])
@pytest.mark.parametrize("limits", [AxisLimits(), AxisLimits(velocity=20.0)])
def test_a_drive_that_counts_velocities_in_another_unit_is_stopped(how, limits):
    homing = HomingParameters(method=17, speed_switch=10.0, speed_zero=5.0, acceleration=500.0, timeout=20.0)
    other = replace(
        MotorParams(), velocity_unit=1 / 20.0, acceleration_unit=1 / 20.0, limit_switches=(-9e6, None)
    )
    r = rig(limits=limits, homing=homing, motor=other).enabled()
    call = getattr(r.axis, how)
    move = call() if how == "home" else call(10.0) if how == "move_velocity" else call(5000.0, velocity=10.0)
    with pytest.raises(LimitError, match="faster than") as caught:
        move.wait(30)
    assert "velocity_scale" in caught.value.remedy
    r.run(2.0)
    assert r.drive.axis.motor.velocity == pytest.approx(0.0, abs=1.0)


def test_another_velocity_of_a_move_keeps_the_known_ramps_of_its_drive():
    r = rig(**BOUNDED)
    clipped(r, 0x6084, 50_000)
    r.enabled()
    r.axis.move_absolute(90.0, velocity=10.0)
    r.run(1.0)
    assert r.core.activity.commanded.down == 50_000.0
    r.axis.set_override(0.5)
    r.run(1.0)
    assert r.core.activity.commanded.speed == 5000.0
    assert r.core.activity.commanded.down == 50_000.0
