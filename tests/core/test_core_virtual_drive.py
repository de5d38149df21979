"""The ideal drive behind a virtual axis: its power stage by the standard's table, its motions by other arithmetic, and no jump."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia301 import abort
from axisbus.cia402.controlword import PowerCommand
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Outputs, SdoRequest, ValueTransport
from axisbus.cia402.state import TRANSITIONS, PowerState, decode
from axisbus.core.virtual_axes import VirtualPort
from axisbus.core.virtual_drive import (
    STATUSWORDS,
    RampLimits,
    RampProfile,
    VirtualDrive,
    after,
    to_distance,
    to_rest,
    to_velocity,
)

PERIOD = 0.01
PP, PV, CSP = (
    int(mode)
    for mode in (
        ModeOfOperation.PROFILE_POSITION,
        ModeOfOperation.PROFILE_VELOCITY,
        ModeOfOperation.CYCLIC_SYNC_POSITION,
    )
)
ENABLE, HALT, NEW = 0x0F, 0x100, 0x10

speeds = st.floats(-1e6, 1e6, allow_nan=False)
rates = st.floats(1.0, 1e7, allow_nan=False)
ramps = st.builds(RampLimits, st.floats(1.0, 1e6), rates, rates)


# -- the power stage ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arrow", [each for each in TRANSITIONS if each.command and each.number != 15], ids=str
)
def test_each_transition_that_a_master_may_command_is_made(arrow):
    assert after(arrow.source, arrow.command.word) is arrow.target


@pytest.mark.parametrize("state", STATUSWORDS)
def test_each_state_is_shown_as_itself(state):
    assert decode(STATUSWORDS[state]) is state


@pytest.mark.parametrize("word", range(0x100))
def test_only_enable_operation_in_an_allowed_state_enables_it(word):
    for state in STATUSWORDS:
        enabled = (
            after(state, word) is PowerState.OPERATION_ENABLED and state is not PowerState.OPERATION_ENABLED
        )
        if enabled:
            assert word & 0x0F == PowerCommand.ENABLE_OPERATION.word
            assert state in (PowerState.SWITCHED_ON, PowerState.QUICK_STOP_ACTIVE)


# -- motions -----------------------------------------------------------------------------------------------------------


def run(way: RampProfile, dt: float = PERIOD, limit: int = 10_000_000) -> tuple[float, float]:
    """Return the distance of a motion until it is over, and the seconds."""
    gone = seconds = 0.0
    while not way.over:
        gone += way.advance(dt)
        seconds += dt
        limit -= 1
        assert limit
    return gone, seconds


@given(speeds, rates)
def test_to_rest_needs_the_braking_distance(velocity, down):
    way = to_rest(velocity, down)
    gone = way.advance(abs(velocity) / down + 1.0)
    assert way.over
    assert way.velocity == 0.0
    assert gone == pytest.approx(velocity * abs(velocity) / (2 * down), rel=1e-9, abs=1e-6)


@given(speeds, speeds, ramps)
def test_to_velocity_ends_at_its_target_and_keeps_it(velocity, target, by):
    way = to_velocity(velocity, target, by)
    way.advance(3e6)
    assert way.over
    assert way.velocity == target
    assert way.advance(2.0) == pytest.approx(2.0 * target)


@given(speeds, st.floats(-1e9, 1e9), ramps)
def test_to_distance_ends_there_at_standstill_within_its_ramps(velocity, distance, by):
    way = to_distance(velocity, distance, by)
    gone, seen, hardest = 0.0, way.velocity, max(by.up, by.down)
    fastest = max(by.speed, abs(velocity)) * (1 + 1e-9)
    far = abs(distance) + velocity * velocity / (2 * by.down)  # it may have overshot, and returned
    longest = abs(velocity) / by.down + far / by.speed + 2 * by.speed * (1 / by.up + 1 / by.down)
    step = max(1e-3, longest / 500)
    for _ in range(5000):
        gone += way.advance(step)
        assert abs(way.velocity) <= fastest
        assert abs(way.velocity - seen) <= hardest * step * (1 + 1e-6) + 1e-6
        seen = way.velocity
        if way.over:
            break
    assert way.over
    assert way.velocity == 0.0
    assert gone == pytest.approx(distance, rel=1e-9, abs=1e-6 * (1 + far))


def test_a_motion_from_standstill_takes_the_time_of_its_trapezoid():
    gone, seconds = run(to_distance(0.0, 1000.0, RampLimits(100.0, 200.0, 400.0)), 1e-3)
    assert gone == pytest.approx(1000.0)
    assert seconds == pytest.approx(1000.0 / 100.0 + 0.5 * (100 / 200 + 100 / 400), abs=2e-3)
    gone, seconds = run(to_distance(0.0, -12.0, RampLimits(100.0, 200.0, 400.0)), 1e-4)
    top = math.sqrt(12.0 / (0.5 / 200 + 0.5 / 400))
    assert gone == pytest.approx(-12.0)
    assert seconds == pytest.approx(top / 200 + top / 400, abs=2e-4)


# -- the drive ---------------------------------------------------------------------------------------------------------


class DriveBench:
    """A drive that is commanded cycle by cycle, as the scan does it."""

    def __init__(self, slow: float = 1000.0, quick: float = 5000.0) -> None:
        self.drive = VirtualDrive(slow, quick)
        self.port = VirtualPort(self.drive, PERIOD)
        self.now = 0.0

    def cycle(self, word: int | None = ENABLE, **wishes: int) -> VirtualDrive:
        self.port.write(Outputs(word, **wishes))
        self.now += PERIOD
        self.seen = self.port.read(self.now)
        return self.drive

    def enabled(self, mode: int, **wishes: int) -> DriveBench:
        for word in (0x06, 0x07, 0x0F):
            self.cycle(word, mode=mode, **wishes)
        assert self.drive.state is PowerState.OPERATION_ENABLED
        return self

    def set(self, **values: int) -> None:
        objects = {"speed": 0x6081, "up": 0x6083, "down": 0x6084}
        requests = tuple(SdoRequest(1, objects[name], 0, value) for name, value in values.items())
        self.port.write(Outputs(None, sdo=requests))


def test_in_a_cyclic_mode_it_is_at_its_target_a_cycle_later():
    led = DriveBench().enabled(CSP, target_position=0)
    for target in (0, 10, 25, 24, -7):
        led.cycle(target_position=target)
        assert led.seen.position.value == target
        assert led.seen.position.stamp == led.now
    assert led.drive.velocity == round(-31 / PERIOD)
    led.cycle()
    assert (led.drive.position, led.drive.velocity) == (-7, 0)


def test_a_set_point_is_taken_at_the_edge_alone_and_acknowledged():
    led = DriveBench().enabled(PP)
    led.set(speed=1000, up=10_000, down=10_000)
    led.cycle(target_position=100)
    assert not led.drive.statusword & 0x1000
    for _ in range(50):
        led.cycle(ENABLE | NEW, target_position=100)
        assert led.drive.statusword & 0x1000
    assert led.drive.position == 100
    assert led.drive.statusword & 0x400
    led.cycle(ENABLE | NEW, target_position=500)  # no edge
    led.cycle(ENABLE)
    assert not led.drive.statusword & 0x1000
    assert led.drive.position == 100
    led.cycle(ENABLE | NEW, target_position=500)
    assert led.drive.statusword & 0x1400 == 0x1000


def test_the_count_wraps_as_a_drive_s_does():
    led = DriveBench(1e9, 1e9).enabled(CSP, target_position=0)
    step, top = 1 << 29, 1 << 31
    for number in range(1, 9):
        led.cycle(target_position=(number * step + top) % (2 * top) - top)
    assert led.drive.position == 0
    led.cycle(target_position=-5)
    assert (led.drive.position, led.drive.velocity) == (-5, round(-5 / PERIOD))


def test_turning_for_a_day_loses_no_increment():
    led = DriveBench(1e6, 1e6).enabled(PV)
    led.set(up=1_000_000, down=1_000_000)
    led.cycle(target_velocity=123_457)
    while led.drive.velocity != 123_457:
        led.cycle(target_velocity=123_457)
    led.cycle()
    first = led.drive._whole + led.drive._fraction
    cycles = 200_000
    for _ in range(cycles):
        led.cycle()
    assert led.drive._whole + led.drive._fraction - first == pytest.approx(cycles * 1234.57, abs=0.01)


def test_a_quick_stop_ends_without_power():
    led = DriveBench(1000.0, 50_000.0).enabled(PV)
    led.set(up=100_000, down=1000)
    for _ in range(30):
        led.cycle(target_velocity=10_000)
    led.cycle(PowerCommand.QUICK_STOP.word)
    assert led.drive.state is PowerState.QUICK_STOP_ACTIVE
    for _ in range(25):
        led.cycle(PowerCommand.QUICK_STOP.word)
    assert (led.drive.velocity, led.drive.state) == (0, PowerState.SWITCH_ON_DISABLED)


@pytest.mark.parametrize(
    ("request_", "value", "code"),
    [
        (SdoRequest(7, 0x6083, 0, 500), None, None),
        (SdoRequest(7, 0x6084, 0, None), 1000, None),
        (SdoRequest(7, 0x607A, 0, None), 0, None),
        (SdoRequest(7, 0x6064, 0, 5), None, abort.READ_ONLY),
        (SdoRequest(7, 0x6098, 0, 35), None, abort.OBJECT_MISSING),
        (SdoRequest(7, 0x6083, 1, 500), None, abort.OBJECT_MISSING),
    ],
)
def test_an_sdo_request_is_answered_in_the_next_cycle(request_, value, code):
    led = DriveBench()
    led.port.write(Outputs(None, sdo=(request_,)))
    (reply,) = led.port.read(PERIOD).sdo
    assert (reply.id, reply.value, reply.abort) == (7, value, code)
    assert led.port.read(2 * PERIOD).sdo == ()


def test_a_virtual_drive_reports_all_values_but_torque_in_each_cycle():
    led = DriveBench()
    led.cycle(None)
    seen, how = led.seen, led.port.capabilities
    assert seen.torque is None
    assert how.inputs["torque"] is ValueTransport.NONE
    assert {seen.statusword.stamp, seen.mode.stamp, seen.position.stamp, seen.velocity.stamp} == {led.now}
    assert seen.operational
    assert not seen.overdue


words = st.sampled_from(
    [None, 0x00, 0x02, 0x06, 0x07, 0x0F, 0x0F, 0x0F, 0x1F, 0x3F, 0x0F | HALT, 0x1F | HALT, 0x80]
)
wishes = st.fixed_dictionaries(
    {"word": words},
    optional={
        "mode": st.sampled_from([0, PP, PV, CSP, 6]),
        "target_velocity": st.integers(-20_000, 20_000),
        "target_position": st.integers(-5000, 5000),
        "nmt_stop": st.booleans(),
    },
)


@settings(max_examples=300)
@given(st.lists(st.tuples(wishes, st.integers(1, 30)), max_size=30))
def test_the_velocity_of_a_virtual_drive_jumps_with_a_cyclic_target_only(asked):
    led = DriveBench(1000.0, 5000.0).enabled(PV)
    led.set(speed=3000, up=4000, down=2000)
    hardest = 5000.0 * PERIOD
    for wish, cycles in asked:
        word, wish = wish["word"], {key: value for key, value in wish.items() if key != "word"}
        for _ in range(cycles):
            before, place = led.drive._profile.velocity, led.drive._whole + led.drive._fraction
            led.cycle(word, **wish)
            follows = (led.drive.state, led.drive.mode) == (PowerState.OPERATION_ENABLED, CSP) and not (
                word or 0
            ) & HALT
            if follows and "target_position" in wish:
                continue
            now = led.drive._profile.velocity
            moved = (led.drive._whole + led.drive._fraction - place) / PERIOD
            if led.drive.mode != CSP:
                assert abs(now - before) <= hardest * (1 + 1e-9)
                assert min(before, now) - hardest <= moved <= max(before, now) + hardest
            if led.drive.state is not PowerState.OPERATION_ENABLED:
                assert abs(now) <= abs(before)


def moving_in_csp(led: DriveBench) -> None:
    for target in range(0, 400, 20):  # 2000 increments per s
        led.cycle(target_position=target)
    assert led.drive.velocity == 2000


def must_stop_beyond(led: DriveBench, place: int, word: int = ENABLE, **wishes: int) -> None:
    """Brake on a ramp from the last target on, and stay where that ends, whatever was a target before."""
    for _ in range(300):
        led.cycle(word, **wishes)
    rested = led.drive.position
    assert led.drive.velocity == 0
    assert rested > place + 100
    for again in (ENABLE, 0x07, 0x0F, ENABLE, ENABLE):
        led.cycle(again)
        assert led.drive.position == rested


def test_a_cyclic_target_does_not_act_again_once_the_axis_was_without_power():
    led = DriveBench(1000.0, 5000.0).enabled(CSP, target_position=0)
    moving_in_csp(led)
    must_stop_beyond(led, led.drive.position, 0x07)


def test_a_cyclic_target_does_not_act_again_after_a_halt_even_one_sent_with_it():
    led = DriveBench(1000.0, 5000.0).enabled(CSP, target_position=0)
    moving_in_csp(led)
    place = led.drive.position
    must_stop_beyond(led, place, ENABLE | HALT, target_position=place)


@pytest.mark.parametrize("other", [PP, PV])
def test_a_cyclic_target_does_not_act_again_after_another_mode(other):
    led = DriveBench(1000.0, 5000.0).enabled(CSP, target_position=0)
    moving_in_csp(led)
    place = led.drive.position
    for _ in range(300):
        led.cycle(mode=other, target_velocity=0)
    led.cycle(mode=CSP)
    must_stop_beyond(led, place)


def test_a_goal_does_not_act_again_once_the_axis_was_without_power():
    led = DriveBench(1000.0, 5000.0).enabled(PP)
    led.set(speed=2000, up=10_000, down=10_000)
    for _ in range(30):
        led.cycle(ENABLE | NEW, target_position=100_000)
    for word in [0x07] * 100 + [ENABLE] * 100:
        led.cycle(word)
    assert led.drive.position < 2000
    assert led.drive.velocity == 0
