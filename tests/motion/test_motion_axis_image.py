"""The small parts at their edges: the image's unwrapping and standstill, the order's controlword, the stop sequence's steps."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia402.port import Capabilities, Inputs, Outputs, Sample, SdoReply
from axisbus.cia402.state import PowerState
from axisbus.errors import SetPointError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.moves.setpoint import HandshakePhase, SetPoint
from axisbus.motion.moves.setpoint_confirmation import SetPointConfirmation, confirmation_for
from axisbus.motion.moves.setpoint_without_ack import TimedSetPoint
from axisbus.motion.parameters import DemandUse, HoldsLoad, StopTimes
from axisbus.motion.stop.coast_down import CoastDown
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel, StopSequence
from kit.motion.rig import GENERIC, dictionary_of, parameters
from kit.motion.steps import Drive
from kit.motion.steps import T as STEP

T = 0.01
HALF, SPAN = 2**31, 2**32
# Statuswords by table 29 of CiA 402-2, typed off: (word, state, the controlword that keeps the state).
STATES = [
    (0x0000, PowerState.NOT_READY_TO_SWITCH_ON, 0x00),
    (0x0040, PowerState.SWITCH_ON_DISABLED, 0x00),
    (0x0021, PowerState.READY_TO_SWITCH_ON, 0x06),
    (0x0023, PowerState.SWITCHED_ON, 0x07),
    (0x0027, PowerState.OPERATION_ENABLED, 0x0F),
    (0x0007, PowerState.QUICK_STOP_ACTIVE, 0x02),
    (0x000F, PowerState.FAULT_REACTION_ACTIVE, 0x00),
    (0x0008, PowerState.FAULT, 0x00),
]
OUTSIDE = [0x0001, 0x0002, 0x0022, 0x0043, 0x0047, 0x006F, 0x0067]  # no row of the table


def wrapped(position: int) -> int:
    """As INTEGER32 shows it."""
    return (position + HALF) % SPAN - HALF


def fresh_image(tolerance: float = 2.0, window: float = 0.05) -> AxisImage:
    return AxisImage(Capabilities({}, {}, True, {}), T, tolerance, window, DemandUse.USE)


def seen(img: AxisImage, now: float, **values) -> AxisImage:
    """Give the image one cycle in which ``values`` are received."""
    samples = {name: Sample(value, now) for name, value in values.items()}
    none = dict.fromkeys(("statusword", "mode", "position", "velocity", "torque", "demand"))
    img.update(Inputs(now, True, **(none | samples)))
    return img


# Image.


@pytest.mark.parametrize(("word", "state", "_"), STATES)
@pytest.mark.parametrize("others", [0x0000, 0xFF90])
def test_the_power_state_is_that_of_table_29_for_any_other_bits(word, state, _, others):
    assert seen(fresh_image(), 0.0, statusword=word | others).state is state


@pytest.mark.parametrize("word", OUTSIDE)
def test_a_word_outside_the_table_is_unknown_and_no_crash(word):
    img = seen(fresh_image(), 0.0, statusword=word)
    assert img.state is PowerState.UNKNOWN
    assert img.statusword == word


@settings(deadline=None, derandomize=True)
@given(
    st.integers(-(2**40), 2**40),
    st.lists(st.integers(-(HALF - 1), HALF - 1), min_size=1, max_size=30),
)
def test_positions_continue_over_every_wrap(start, steps):
    img = fresh_image()
    here = wrapped(start)
    seen(img, 0.0, position=here)
    for number, step in enumerate(steps, 1):
        here += step
        seen(img, number * T, position=wrapped(here))
        assert img.position == here


def test_the_demand_is_unwrapped_like_the_position():
    img = fresh_image()
    seen(img, 0.0, position=HALF - 10, demand=HALF - 5)
    seen(img, T, position=wrapped(HALF + 3), demand=wrapped(HALF + 8))
    assert (img.position, img.demand) == (HALF + 3, HALF + 8)
    assert img.reference == HALF + 8
    seen(img, 2 * T, position=wrapped(HALF + 3))
    assert img.reference == HALF + 3  # no demand: the actual position


def test_standstill_needs_the_whole_window_at_one_position():
    img = fresh_image()
    for number in range(5):
        seen(img, number * T, position=100 + number % 2)
        assert not img.standstill
    seen(img, 5 * T, position=100)
    assert img.standstill
    seen(img, 6 * T, position=105)
    assert not img.standstill


def test_creeping_is_no_standstill():
    """One increment per cycle is within the tolerance of the cycle before, but not of an anchor."""
    img = fresh_image()
    for number in range(200):
        seen(img, number * T, position=number)
        assert not img.standstill


def slowly_sampled(positions, period: float, age: float = 1.0) -> AxisImage:
    """An image whose velocity (606Ch) came once, before all of these positions."""
    img = AxisImage(Capabilities({}, {}, True, {"velocity": age}), period, 2.0, 0.05, DemandUse.USE)
    velocity = Sample(77, 0.0)
    for number, position in enumerate(positions, start=1):
        now = number * period
        img.update(Inputs(now, True, None, None, Sample(position, now), velocity, None, None))
    return img


def test_noise_at_standstill_is_no_velocity():
    positions = [(0, 2, -2, 1, -1)[number % 5] for number in range(48)]
    assert slowly_sampled(positions, 0.002).standstill
    assert slowly_sampled(positions, 0.002).speed(1.0) == 0.0
    assert slowly_sampled(positions[:20], 0.002).speed(1.0) != 77.0  # before that is known


@pytest.mark.parametrize("count", [30, 31, 32, 33, 34])
def test_a_velocity_by_positions_has_a_base_in_which_noise_is_little(count):
    """10 increments in each 2 ms, and ±2 of noise: 4 increments in 2 ms would be 2000 per s, in 8 ms they are 500."""
    positions = [10 * number + (0, 2, -2, 1, -1)[number % 5] for number in range(count)]
    assert slowly_sampled(positions, 0.002).speed(1.0) == pytest.approx(5000.0, abs=500.0)


def test_a_velocity_by_positions_is_that_of_the_last_two_if_they_are_far_enough_apart():
    positions = [number * number for number in range(20)]
    assert slowly_sampled(positions, 0.01).speed(1.0) == pytest.approx((19 * 19 - 18 * 18) / 0.01)
    assert slowly_sampled([0, 5], 0.01).speed(1.0) == pytest.approx(500.0)


def test_a_new_count_begins_a_new_base():
    img = slowly_sampled([100 * number for number in range(10)], 0.002)
    img.recount()
    for number, position in enumerate((5000, 5020, 5040), start=10):
        now = number * 0.002 + 0.002
        img.update(Inputs(now, True, None, None, Sample(position, now), Sample(77, 0.0), None, None))
    assert img.speed(1.0) == pytest.approx(10_000.0)


def test_a_position_that_was_received_once_is_no_standstill():
    img = fresh_image()
    sample = Sample(100, 0.0)
    for number in range(20):
        img.update(Inputs(number * T, True, None, None, sample, None, None, None))
    assert not img.standstill  # the repeated frame proves nothing


def test_an_endless_axis_past_int32_keeps_its_angle_over_a_gap():
    """2**32 is no multiple of a turn: a count from the drive's own value would be another angle."""
    img = fresh_image()
    seen(img, 0.0, position=HALF - 1)
    seen(img, T, position=-HALF)
    assert img.position == HALF
    seen(img, 2 * T)
    assert img.position is None
    seen(img, 3 * T, position=-HALF + 5)
    assert img.position == HALF + 5
    assert not img.lost_count
    assert img.unwrapped(-HALF + 7) == HALF + 7


def test_if_half_the_count_may_have_passed_between_two_positions_the_angle_is_unknown():
    img = fresh_image()
    img.fastest = HALF / (10 * T)
    seen(img, 0.0, position=0)
    seen(img, 9 * T, position=1000)
    assert not img.lost_count
    seen(img, 19.1 * T, position=2000)
    assert img.lost_count
    seen(img, 20 * T, position=2000)
    assert not img.lost_count


def test_a_drive_that_has_restarted_counts_from_its_own_value():
    img = fresh_image()
    seen(img, 0.0, position=HALF - 1)
    seen(img, T, position=-HALF)
    img.restart()
    seen(img, 2 * T, position=3)
    assert img.position == 3


# Order.


def order_for(goal: PowerState | None) -> CycleOutputs:
    order = CycleOutputs()
    order.goal = goal
    return order


@pytest.mark.parametrize("state", list(PowerState))
def test_without_a_goal_nothing_holds_a_controlword(state):
    order = order_for(None)
    order.halt, order.bits = True, 0x30
    assert order.outputs(state).controlword is None


@pytest.mark.parametrize(
    "goal", [PowerState.OPERATION_ENABLED, PowerState.SWITCH_ON_DISABLED, PowerState.QUICK_STOP_ACTIVE]
)
def test_an_unknown_statusword_sends_no_controlword(goal):
    order = order_for(goal)
    order.halt, order.bits = True, 0x30
    assert order.outputs(PowerState.UNKNOWN).controlword is None


@pytest.mark.parametrize(("_", "state", "word"), STATES)
def test_the_word_that_keeps_a_state_is_the_standard_s(_, state, word):
    if state in (PowerState.NOT_READY_TO_SWITCH_ON, PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE):
        assert order_for(PowerState.OPERATION_ENABLED).controlword(state) == word
    else:
        assert order_for(state).controlword(state) == word


def test_enabling_takes_one_transition_at_a_time():
    up = order_for(PowerState.OPERATION_ENABLED)
    words = [up.controlword(state) for _, state, _ in STATES[1:5]]
    assert words == [0x06, 0x07, 0x0F, 0x0F]


def test_disabling_sends_7_then_6_then_0():
    down = order_for(PowerState.SWITCH_ON_DISABLED)
    words = [down.controlword(state) for _, state, _ in reversed(STATES[1:5])]
    assert words == [0x07, 0x06, 0x00, 0x00]


def test_halt_and_mode_bits_go_only_to_an_enabled_drive():
    order = order_for(PowerState.OPERATION_ENABLED)
    order.halt, order.bits = True, 0x30
    assert order.controlword(PowerState.OPERATION_ENABLED) == 0x13F
    assert order.controlword(PowerState.SWITCHED_ON) == 0x0F
    assert order.controlword(PowerState.READY_TO_SWITCH_ON) == 0x07
    order.goal = PowerState.SWITCH_ON_DISABLED
    assert order.controlword(PowerState.OPERATION_ENABLED) == 0x107  # halted until it has left the state


def test_targets_are_wrapped_and_wishes_last_one_cycle():
    order = order_for(PowerState.OPERATION_ENABLED)
    order.target_position, order.target_velocity, order.word = HALF + 7, -3, 0x02
    number = order.request(0x6081, 0, 5)
    out = order.outputs(PowerState.OPERATION_ENABLED)
    assert (out.controlword, out.target_position, out.target_velocity) == (0x02, -HALF + 7, -3)
    assert [(r.id, r.index, r.subindex, r.value) for r in out.sdo] == [(number, 0x6081, 0, 5)]
    order.clear()
    assert order.outputs(PowerState.OPERATION_ENABLED) == Outputs(0x0F)
    assert order.request(0x6081, 0, 5) != number


# Set-point.


def test_a_set_point_is_taken_only_by_a_word_received_after_bit_4_went_low():
    """A drive may clear bit 12 early, or the word was in transit already: its bit 10 belonged to the move before."""
    img, order, point = fresh_image(), CycleOutputs(), SetPoint(5_000, "x", 1.0)

    def cycle(now: float, word: int, stamp: float) -> tuple[bool, int]:
        img.update(Inputs(now, True, Sample(word, stamp), None, None, None, None, None))
        order.clear()
        return point.step(img, order), order.bits

    assert cycle(0.00, 0x0427, 0.000) == (False, 0x30)  # bit 12 is low: target and bits 4 and 5 go out
    assert order.target_position == 5_000
    assert cycle(0.01, 0x0427, 0.009) == (False, 0x30)
    assert cycle(0.02, 0x1427, 0.019) == (False, 0)  # acknowledged: bit 4 goes low now, at 0.02
    assert cycle(0.03, 0x0427, 0.020) == (False, 0)  # received before that
    assert cycle(0.04, 0x0427, 0.031) == (True, 0)


def test_a_set_point_is_not_offered_while_the_old_acknowledge_is_set():
    img, order, point = fresh_image(), CycleOutputs(), SetPoint(5_000, "x", 1.0)
    for number in range(100):
        seen(img, number * T, statusword=0x1427)
        order.clear()
        assert not point.step(img, order)
        assert order.bits == 0
        assert not point.begun
    seen(img, 1.5, statusword=0x1427)
    with pytest.raises(SetPointError, match="handshake"):
        point.step(img, order)


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_the_target_is_sent_before_the_edge_by_as_many_cycles_as_the_port_requires(delay):
    img = AxisImage(Capabilities({}, {}, True, {}, delay), T, 2.0, 0.05)
    order, point = CycleOutputs(), SetPoint(5_000, "x", 1.0)
    sent = []
    for number in range(4):
        seen(img, number * T, statusword=0x0427)
        order.clear()
        point.step(img, order)
        sent.append((order.target_position, order.bits))
        assert point.begun == bool(order.bits)
    assert sent == [(5_000, 0)] * delay + [(5_000, 0x30)] * (4 - delay)


def test_the_edge_waits_for_the_statusword_also_behind_its_target():
    """The drive shows an acknowledge without a request: an edge now could not be distinguished from it."""
    img = AxisImage(Capabilities({}, {}, True, {}, 1), T, 2.0, 0.05)
    order, point = CycleOutputs(), SetPoint(5_000, "x", 1.0)
    sent = []
    for number, word in enumerate((0x0427, 0x1427, 0x1427, 0x0427)):
        seen(img, number * T, statusword=word)
        order.clear()
        point.step(img, order)
        sent.append((order.target_position, order.bits))
    assert sent == [(5_000, 0)] * 3 + [(5_000, 0x30)]


# The stop sequence.


class Fall:
    """A stop sequence against a drive whose every cycle is written by hand."""

    def __init__(self, *, then=AfterStop.HOLD, start=StopLevel.HALT, **changes) -> None:
        times = StopTimes(halt=0.3, quick_stop=0.2, disable=0.2)
        self.parameters = parameters("x", dictionary_of(GENERIC), stop_times=times, **changes)
        self.stop_sequence = StopSequence(self.parameters, then, start=start)
        self.coast_down = CoastDown(self.parameters)
        self.image = fresh_image()
        self.order = CycleOutputs()
        self.order.goal = PowerState.OPERATION_ENABLED
        self.now = 0.0
        self.place = 0

    def step(self, word: int | None, *, moving: bool, mode: int = 3, sdo=()) -> Outputs:
        """Run one cycle; return the outputs. ``self.done`` shows if the stop sequence has ended."""
        self.place += 100 * moving
        values = {"position": Sample(self.place, self.now), "mode": Sample(mode, self.now)}
        status = None if word is None else Sample(word, self.now)
        self.image.update(
            Inputs(self.now, True, status, values["mode"], values["position"], None, None, None, (), sdo)
        )
        self.order.clear()
        self.coast_down.look(self.image, touched=True)
        self.done = self.stop_sequence.step(self.image, self.order, self.coast_down)
        self.now += T
        return self.order.outputs(self.image.state)

    def steps(self, seconds: float, word: int | None, *, moving: bool, **options) -> Outputs:
        for _ in range(round(seconds / T)):
            out = self.step(word, moving=moving, **options)
            if self.done:
                break
        return out


ENABLED, QUICK, OFF = 0x27, 0x07, 0x40


def test_standstill_on_the_first_step_ends_the_stop_sequence():
    fall = Fall()
    out = fall.steps(0.1, ENABLED, moving=True)
    assert (out.controlword, out.target_velocity, out.target_torque) == (0x10F, 0, 0)
    fall.steps(0.1, ENABLED, moving=False)
    assert fall.done
    assert fall.stop_sequence.confirmed
    assert fall.stop_sequence.path == [StopLevel.HALT]
    assert not fall.stop_sequence.escalated


def test_each_deadline_of_the_stop_sequence_leads_to_the_next_step():
    fall = Fall()
    words = []
    while not getattr(fall, "done", False) and fall.now < 3:
        out = fall.step(ENABLED, moving=True)
        if not words or words[-1][0] != out.controlword & 0x0F:
            words.append((out.controlword & 0x0F, round(fall.now, 2)))
        last = out
    # halt 0.3 s, quick stop 0.2 s, disable voltage 0.2 s, then NMT stop (with the word of disable voltage)
    assert [word for word, _ in words] == [0x0F, 0x02, 0x00]
    assert words[1][1] == pytest.approx(0.3, abs=0.03)
    assert words[2][1] == pytest.approx(0.5, abs=0.05)
    assert last.nmt_stop
    assert fall.stop_sequence.path == [
        StopLevel.HALT,
        StopLevel.QUICK_STOP,
        StopLevel.DISABLE_VOLTAGE,
        StopLevel.NMT_STOP,
    ]
    assert not fall.stop_sequence.confirmed
    assert fall.stop_sequence.late == ["halt_time", "quick_stop_time", "disable_time"]


def test_asking_again_gives_no_more_time():
    fall = Fall()
    for _ in range(29):
        fall.step(ENABLED, moving=True)
        fall.stop_sequence.harden(AfterStop.HOLD, StopLevel.HALT)
    out = fall.steps(0.03, ENABLED, moving=True)
    assert out.controlword & 0x0F == 0x02


def test_asking_for_less_does_not_climb_up_again():
    fall = Fall(start=StopLevel.QUICK_STOP)
    fall.step(ENABLED, moving=True)
    fall.stop_sequence.harden(AfterStop.HOLD, StopLevel.HALT)
    assert fall.step(ENABLED, moving=True).controlword & 0x0F == 0x02


def test_without_a_statusword_the_first_controlword_is_safe_in_every_state_and_also_sent_by_sdo():
    fall = Fall()
    fall.step(ENABLED, moving=True)
    out = fall.step(None, moving=True)
    assert out.controlword == 0x02
    writes = [(r.index, r.value) for r in out.sdo if r.value is not None]
    assert writes == [(0x6040, 0x02)]
    out = fall.step(None, moving=True)
    assert [r for r in out.sdo if r.value is not None] == []  # once is enough


def test_values_read_by_sdo_confirm_the_stop():
    fall = Fall()
    out = fall.step(None, moving=True)
    reads = {r.index: r.id for r in out.sdo if r.value is None}
    fall.image.position = None
    for _ in range(25):  # off is not yet stopped: two positions must be the same, a tenth of a second apart
        answers = tuple(SdoReply(id_, OFF if index == 0x6041 else 500, None) for index, id_ in reads.items())
        out = fall.step(None, moving=False, sdo=answers)
        reads = {r.index: r.id for r in out.sdo if r.value is None}
        if fall.done:
            break
    assert fall.stop_sequence.confirmed
    assert fall.stop_sequence.seen is PowerState.SWITCH_ON_DISABLED


def test_a_drive_that_is_not_driven_has_stopped():
    for word in (0x40, 0x21, 0x23, 0x08):
        fall = Fall()
        fall.step(word, moving=True)
        assert fall.done
        assert fall.stop_sequence.confirmed


def test_disabling_waits_for_the_last_step_down():
    fall = Fall(then=AfterStop.DISABLE)
    fall.steps(0.1, ENABLED, moving=False)
    assert not fall.done
    assert fall.order.goal is PowerState.SWITCH_ON_DISABLED
    assert fall.step(ENABLED, moving=False).controlword == 0x07
    assert fall.step(0x23, moving=False).controlword == 0x06
    assert fall.step(0x21, moving=False).controlword == 0x00
    assert not fall.done
    fall.steps(0.2, OFF, moving=False)  # off, and standstill seen
    assert fall.done
    assert fall.stop_sequence.confirmed


def test_standstill_seen_before_the_step_could_act_does_not_count():
    """The command of a motion may be in transit to the drive."""
    fall = Fall()
    for _ in range(20):  # it was at standstill for long before the halt
        fall.image.update(
            Inputs(fall.now, True, Sample(ENABLED, fall.now), None, Sample(0, fall.now), None, None, None)
        )
        fall.now += T
    assert fall.image.standstill
    fall.step(ENABLED, moving=False)
    assert not fall.done


def test_a_load_on_the_motor_is_not_dropped_at_any_deadline():
    fall = Fall(holds_load=HoldsLoad.TORQUE)
    words = set()
    for _ in range(300):
        words.add(fall.step(ENABLED, moving=True).controlword)
        if fall.done:
            break
    assert fall.done
    assert all(word & 0x02 for word in words)  # enable voltage: bit 1 is never taken away
    assert fall.stop_sequence.power_left_on
    assert not fall.stop_sequence.confirmed


def test_a_load_in_a_torque_mode_is_taken_over_by_a_mode_that_holds():
    fall = Fall(holds_load=HoldsLoad.TORQUE)
    out = fall.step(ENABLED, moving=True, mode=4)
    assert out.mode == 1
    assert out.target_torque is None  # the torque that holds it now is kept until then
    assert out.controlword == 0x0F


def test_without_bit_12_bit_4_is_low_for_a_time_before_it_rises_under_halt_or_with_another_set_point():
    img, order, point = fresh_image(), CycleOutputs(), TimedSetPoint(5_000, "x", 1.0)
    highs = []
    for number in range(40):
        seen(img, number * T, statusword=0x1427)
        order.clear()
        order.halt = True
        if number < 3:
            order.bits = 0x10  # another's
        point.step(img, order)
        highs.append(bool(order.bits & 0x10))
    rises = [number for number in range(1, 40) if highs[number] and not highs[number - 1]]
    falls = [number for number in range(1, 40) if highs[number - 1] and not highs[number]]
    assert falls[0] == 3
    assert len(rises) == 2
    assert [rise - fall for rise, fall in zip(rises, falls, strict=False)] == [
        pytest.approx(4, abs=1),
        pytest.approx(4, abs=1),
    ]
    assert point.step(img, order)


@pytest.mark.parametrize(
    ("period", "words", "cycles"),
    [
        (0.01, range(40), 4),
        (0.005, range(40), 4),  # 20 ms
        (0.004, range(40), 5),
        (0.01, [1, 2], 4),
        (0.01, [3, 7], 7),  # the second word of after the edge
        (0.01, [3], 10),  # no word comes for 0.1 s
        (0.01, [], 10),
    ],
)
def test_without_bit_12_bit_4_stays_set_until_any_drive_has_read_it(period, words, cycles):
    img, order, point = fresh_image(), CycleOutputs(), TimedSetPoint(5_000, "x", 1.0)
    highs = []
    for number in range(2 * cycles + 1):
        stamp = max((word for word in words if word <= number), default=0) * period
        img.update(Inputs(number * period, True, Sample(ENABLED, stamp), None, None, None, None, None))
        order.clear()
        point.step(img, order)
        highs.append(bool(order.bits))
    assert highs[: cycles + 1] == [True] * cycles + [False]
    if words == range(40):
        assert point.phase is HandshakePhase.TAKEN  # and it was low for as long


def test_without_bit_12_the_time_of_bit_4_counts_from_its_rise():
    drive, point = Drive(start=1_000.0), TimedSetPoint(5_000, "x", 1.0)
    highs = []
    for _ in range(14):
        point.step(*drive.cycle())  # no word comes: a tenth of a second, seven cycles of 1/64 s
        highs.append(bool(drive.order.bits))
    assert highs == [True] * 7 + [False] * 7
    assert point.phase is HandshakePhase.RELEASE
    assert point.step(*drive.cycle())


BIT_10, ENABLED = 0x0400, 0x0027
RAMPED = MoveProfile(96, 100, 100, 96.0, 100.0, down=100.0)


def given_edge(drive: Drive, target: int, profile: MoveProfile = RAMPED, **seen: int) -> SetPointConfirmation:
    """A set-point whose edge has just been given to a drive that shows these values."""
    point = SimpleNamespace(target=target, edge_at=math.inf, from_halt=False)
    proof = SetPointConfirmation(point, profile, drive.parameters)
    proof.step(drive.cycle(**seen)[0])
    point.edge_at = drive.now
    proof.step(drive.image)
    return proof


@pytest.mark.parametrize("value", ["position", "demand"])
def test_the_first_value_after_the_edge_that_is_nearer_shows_that_a_set_point_was_taken(value):
    drive = Drive()
    proof = given_edge(drive, 5_000, statusword=ENABLED, position=0, demand=0)
    proof.step(drive.cycle(statusword=ENABLED)[0])
    assert not proof.seen
    proof.step(drive.cycle(**{value: 900})[0])
    assert proof.seen


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("value", ["position", "demand"])
def test_a_set_point_at_the_present_position_is_taken_within_the_tolerance_and_after_a_while(value, side):
    for off, there in ((0, True), (1, False)):
        drive = Drive()
        place = side * int(drive.parameters.standstill_tolerance)
        near = {"position": 0} | {value: 5_000 + place + side * off}
        proof = given_edge(drive, 5_000, statusword=ENABLED, **near)
        edge = drive.now
        drive.now = edge + 0.3 - 2 * STEP
        drive.cycle(**near)
        assert not proof.suffices(drive.image)
        drive.cycle(**near)
        assert drive.now == edge + 0.3
        assert proof.suffices(drive.image) is there


@pytest.mark.parametrize("shown", [{"position": 0}, {"position": 0, "demand": 0}])
def test_a_set_point_without_confirmation_fails_its_time_after_the_edge(shown):
    drive = Drive()
    proof = given_edge(drive, 5_000, statusword=ENABLED, **shown)
    edge = drive.now
    with pytest.raises(SetPointError):
        while drive.now < edge + 10.0:
            proof.step(drive.cycle(**shown)[0])
    assert drive.now == edge + drive.parameters.timing.acknowledge + 0.0625 + STEP


def test_with_an_unknown_deceleration_a_set_point_has_two_seconds_more_to_reverse():
    drive = Drive()
    proof = given_edge(
        drive, 5_000, profile=MoveProfile(96, 100, 100, 96.0, 100.0), statusword=ENABLED, position=0
    )
    edge = drive.now
    with pytest.raises(SetPointError):
        while drive.now < edge + 10.0:
            proof.step(drive.cycle(position=0)[0])
    assert drive.now == edge + drive.parameters.timing.acknowledge + 2.0 + 0.0625 + STEP


@pytest.mark.parametrize(("moves", "seen"), [(0, True), (100, False)])
def test_a_falling_bit_10_confirms_the_set_point_only_at_standstill(moves, seen):
    drive = Drive()
    for number in range(8):
        drive.cycle(statusword=ENABLED | BIT_10, position=moves * number)
    proof = given_edge(drive, 5_000, statusword=ENABLED | BIT_10, position=moves * 8)
    proof.step(drive.cycle(statusword=ENABLED)[0])
    assert proof.seen is seen


@pytest.mark.parametrize(
    ("set_point", "taken", "known"),
    [
        (5_000, 5_000, True),
        (5_000, None, False),
        (5_000, 4_000, False),
        (0, 5_000, False),
        (None, None, False),
    ],
)
def test_a_target_that_the_drive_had_taken_before_needs_no_proof(set_point, taken, known):
    """An axis that something holds, with bit 10 low: it does not approach, and the drive has the target anyhow."""
    drive = Drive()
    drive.image.reference_tracker.set_point, drive.image.reference_tracker.taken = set_point, taken
    proof = given_edge(drive, 5_000, statusword=ENABLED, position=1_000)
    blamed = False
    for _ in range(640):
        try:
            proof.step(drive.cycle(position=1_000)[0])
        except SetPointError:
            blamed = True
            break
    assert blamed is not known
    assert (drive.image.reference_tracker.taken == 5_000) is known
    assert not proof.seen


@pytest.mark.parametrize(("place", "seen"), [(2_501, True), (2_500, False)])
def test_bit_10_set_again_nearer_to_the_new_target_confirms_it(place, seen):
    drive = Drive()
    drive.image.reference_tracker.set_point = 0
    proof = given_edge(drive, 5_000, statusword=ENABLED, position=place)
    proof.step(drive.cycle(statusword=ENABLED, position=place)[0])
    assert not proof.seen
    proof.step(drive.cycle(statusword=ENABLED | BIT_10, position=place)[0])
    assert proof.seen is seen


@pytest.mark.parametrize(("before", "position"), [(0, None), (None, 4_000), (None, None)])
def test_bit_10_set_again_confirms_nothing_without_a_position_or_an_old_target(before, position):
    drive = Drive()
    drive.image.reference_tracker.set_point = before
    proof = given_edge(drive, 5_000, statusword=ENABLED, position=position)
    proof.step(drive.cycle(statusword=ENABLED, position=position)[0])
    proof.step(drive.cycle(statusword=ENABLED | BIT_10, position=position)[0])
    assert not proof.seen


def test_an_axis_at_standstill_at_its_target_needs_no_further_approach():
    for off, blamed in ((0, False), (1, True)):
        drive = Drive()
        place = 5_000 + int(drive.parameters.standstill_tolerance) + off
        proof = given_edge(drive, 5_000, statusword=ENABLED, position=place)
        for _ in range(640):
            try:
                proof.step(drive.cycle(position=place)[0])
            except SetPointError:
                break
        else:
            assert not blamed
            continue
        assert blamed


def proved(word_at) -> tuple[SetPointConfirmation, float]:
    """A set-point without 6064h and 6062h, ``word_at(time)`` being the statusword; until it is proved, or 10 s."""
    img, order, point = fresh_image(), CycleOutputs(), TimedSetPoint(5_000, "x", 1.0)
    proof = confirmation_for(
        point, MoveProfile(100, 100, 100, 100.0, 100.0), parameters("x", dictionary_of(GENERIC))
    )
    now = 0.0
    while not proof.seen and now < 10.0:
        seen(img, now, statusword=word_at(now))
        order.clear()
        point.step(img, order)
        proof.step(img)
        now += T
    return proof, now


def test_without_6064h_bit_10_confirms_a_set_point_given_at_standstill():
    proof, now = proved(lambda time: ENABLED if time > 0.2 else ENABLED | BIT_10)
    assert proof.seen
    assert now < 0.3


@pytest.mark.parametrize(
    "word_at",
    [
        lambda _: ENABLED | BIT_10,  # it never falls
        lambda _: ENABLED,  # in motion before and after
        lambda time: ENABLED | (BIT_10 if time > 0.2 else 0),  # the end of the move before
    ],
    ids=["at standstill", "in motion", "to the end"],
)
def test_without_6064h_an_unconfirmed_set_point_fails(word_at):
    with pytest.raises(SetPointError, match="no sign that"):
        proved(word_at)


def test_with_bit_12_no_other_confirmation_is_used():
    assert (
        confirmation_for(
            SetPoint(5_000, "x", 1.0),
            MoveProfile(100, 100, 100, None, None),
            parameters("x", dictionary_of(GENERIC)),
        )
        is None
    )
