"""The stop sequence and the observations of an axis, step by step: ages of values, steps, loads, missing values, the shutdown."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import ValueTransport
from axisbus.cia402.state import PowerState
from axisbus.errors import ArgumentError, DriveError, LimitError, StaleError
from axisbus.motion.group.start_barrier import OPEN
from axisbus.motion.moves.follow import Follow
from axisbus.motion.parameters import AxisLimits, Defaults, HoldsLoad, StopTimes
from axisbus.motion.pathclock import PathClock
from axisbus.motion.states import AxisState
from axisbus.motion.stop.coast_down import CoastDown
from axisbus.motion.stop.shutdown_stop import AxisShutdown, ShutdownStop
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel, StopSequence
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.motion.rig import rig
from kit.motion.steps import Drive, T

ENABLED, QUICK, DISABLED, READY, SWITCHED_ON, FAULT = 0x0237, 0x0217, 0x0250, 0x0231, 0x0233, 0x0218
NAMES = ("statusword", "mode", "position", "velocity", "torque", "demand")

# How old a value may be.


@pytest.mark.parametrize("name", NAMES)
def test_each_value_is_known_up_to_its_own_age(name):
    ages = dict.fromkeys(NAMES, 100.0) | {name: 0.25}
    drive = Drive(ages=ages)
    first = dict(zip(NAMES, (ENABLED, 1, 5, 6, 7, 8), strict=True))
    drive.cycle(**first)
    began = drive.now
    image = drive.image
    while drive.now + T - began <= 0.25:
        drive.cycle()
        assert [getattr(image, each) for each in NAMES] == list(first.values())
    drive.cycle()
    unknown = [each for each in NAMES if getattr(image, each) is None]
    # without the position nothing is known of how the demand lies to it
    assert unknown == (["position", "demand"] if name == "position" else [name])
    assert (image.state is PowerState.UNKNOWN) is (name == "statusword")
    drive.cycle(**{name: 9})
    assert getattr(image, name) == 9


@pytest.mark.parametrize("name", NAMES)
def test_values_that_are_old_because_of_a_late_cycle_are_no_silence_of_the_drive(name):
    """No SYNC went out meanwhile: being late by less than the age is taken off."""
    drive = Drive(ages={name: 0.25})
    first = dict(zip(NAMES, (ENABLED, 1, 5, 6, 7, 8), strict=True))
    drive.cycle(**first)
    drive.later(1.0)
    drive.cycle()
    assert getattr(drive.image, name) is not None
    assert drive.image.gap == 1.0 + T
    drive.cycle()
    assert getattr(drive.image, name) is None


def test_only_a_gap_of_two_periods_is_time_that_this_program_did_not_run():
    drive = Drive()
    drive.cycle()
    drive.later(T - 2**-20)
    for _ in range(60):
        drive.cycle()
        drive.later(T - 2**-20)
    assert drive.image.starvation.missing(drive.now) == 0.0
    late = Drive()
    late.cycle()
    late.later(0.5).cycle()
    assert late.image.starvation.missing(late.now) == 0.5


def test_half_the_count_may_pass_unseen_only_at_the_highest_speed():
    drive = Drive(ages={"position": 100.0})
    drive.image.fastest = float(2**31)  # in a second
    drive.cycle(position=0)
    drive.later(1.0 - 2 * T).cycle(position=10)
    assert not drive.image.lost_count
    drive.later(1.0 - T).cycle(position=10)
    assert drive.image.lost_count
    drive.cycle(position=10)
    assert not drive.image.lost_count


# The steps of the stop sequence.

TIMES = StopTimes(halt=0.5, quick_stop=0.25, disable=1.0)


class Stop:
    """A stop sequence on a drive whose answers are given; notes each cycle's word, mode and NMT stop."""

    def __init__(
        self,
        then: AfterStop = AfterStop.HOLD,
        start: StopLevel = StopLevel.HALT,
        by_event: bool = False,
        **changes,
    ) -> None:
        self.drive = Drive(by_event=by_event, **({"stop_times": TIMES} | changes))
        self.stop_sequence = StopSequence(self.drive.parameters, then, start=start)
        self.coast_down = CoastDown(self.drive.parameters)
        self.drive.order.goal = PowerState.OPERATION_ENABLED
        self.place = 0
        self.done = False
        self.sent: list[tuple[int | None, bool]] = []

    def before(self, cycles: int, moving: bool, **values: int | None) -> Stop:
        """Set the observations before the stop."""
        for _ in range(cycles):
            self.place += 100 * moving
            self.drive.cycle(position=self.place, **values)
            self.coast_down.look(self.drive.image, True)
        return self

    def run(self, cycles: int, moving: bool, position: bool = True, **values: int | None) -> Stop:
        """Step it until it ends, or so many cycles."""
        for _ in range(cycles):
            self.place += 100 * moving
            image, order = self.drive.cycle(**({"position": self.place} if position else {}), **values)
            self.coast_down.look(image, True)
            self.done = self.stop_sequence.step(image, order, self.coast_down)
            self.sent.append((order.controlword(image.state), order.nmt_stop))
            if self.done:
                break
        return self

    @property
    def words(self) -> list[int | None]:
        """The controlwords, without repetitions."""
        words = [word for word, _ in self.sent]
        return [word for number, word in enumerate(words) if number == 0 or words[number - 1] != word]


@pytest.mark.parametrize("holds", [HoldsLoad.NO, HoldsLoad.BRAKE, HoldsLoad.TORQUE])
@pytest.mark.parametrize("moving", [True, False])
def test_the_power_of_an_axis_with_a_load_is_not_cut_while_that_would_let_it_fall(holds, moving):
    """A drive that obeys nothing: a brake holds only an axis at standstill, a motor only as long as it has power."""
    stop = Stop(start=StopLevel.QUICK_STOP, holds_load=holds).run(400, moving, statusword=ENABLED, mode=1)
    cut = 0x00 in [word & 0x0F for word in stop.words]
    assert stop.done
    assert cut is (holds is HoldsLoad.NO or (holds is HoldsLoad.BRAKE and not moving))
    assert stop.stop_sequence.power_left_on is not cut
    if not cut:
        assert len(stop.sent) == 16 + 2
        assert stop.stop_sequence.confirmed is not moving
        assert stop.stop_sequence.escalated


def test_each_step_has_its_own_time():
    stop = Stop().run(400, True, statusword=ENABLED, mode=3)
    words = [word & 0x0F for word, _ in stop.sent]
    # the cycle in which a time has passed still has the old word
    assert [words.count(word) for word in (0x0F, 0x02)] == [34, 17]
    assert stop.stop_sequence.path == [
        StopLevel.HALT,
        StopLevel.QUICK_STOP,
        StopLevel.DISABLE_VOLTAGE,
        StopLevel.NMT_STOP,
    ]
    assert stop.stop_sequence.late == ["halt_time", "quick_stop_time", "disable_time"]
    nmt = [nmt for _, nmt in stop.sent]
    assert nmt.index(True) == 34 + 17 + 65
    assert nmt.count(True) == 7  # a tenth of a second
    assert not stop.stop_sequence.confirmed
    assert "still moving" in stop.stop_sequence.missing_condition


@pytest.mark.parametrize(
    ("holds", "leaves", "done"),
    [(False, False, False), (True, False, True)],
)
def test_a_quick_stop_that_the_drive_itself_will_leave_is_over_when_it_has_left(holds, leaves, done):
    stop = Stop(start=StopLevel.QUICK_STOP, quick_stop_holds=holds, stop_times=StopTimes(quick_stop=2.0))
    stop.run(40, False, statusword=QUICK, mode=1)
    assert stop.done is done
    if not done:
        stop.run(3, False, statusword=DISABLED)
        assert stop.done or stop.run(10, False, statusword=DISABLED).done
    assert stop.stop_sequence.confirmed


def test_a_quick_stop_seen_during_a_halt_is_adopted():
    stop = Stop().run(1, True, statusword=QUICK, mode=1)
    assert stop.stop_sequence.level is StopLevel.QUICK_STOP
    assert stop.words == [0x02]
    assert not stop.stop_sequence.escalated


def test_a_drive_without_a_statusword_gets_a_controlword_that_is_safe_in_every_state():
    stop = Stop().run(1, True, statusword=None, mode=1)
    assert (
        stop.stop_sequence.level,
        stop.stop_sequence.statusword_missing,
        stop.stop_sequence.escalated,
    ) == (StopLevel.QUICK_STOP, True, True)
    assert stop.words == [0x02]


@pytest.mark.parametrize(
    ("start", "word", "first", "level", "last"),
    [
        (StopLevel.HALT, ENABLED, [0x10F, 0x107], StopLevel.QUICK_STOP, 0x02),
        (StopLevel.QUICK_STOP, QUICK, [0x02, 0x00], StopLevel.DISABLE_VOLTAGE, 0x00),
    ],
)
def test_while_disabling_an_unknown_state_gets_a_controlword_that_is_safe_in_every_state(
    start, word, first, level, last
):
    stop = Stop(AfterStop.DISABLE, start).run(8, False, statusword=word, mode=1)
    assert stop.words[:2] == first
    stop.run(1, False, statusword=None)
    assert stop.stop_sequence.level is level
    stop.run(1, False, statusword=None)
    assert stop.words[-1] == last


def test_disabling_has_its_time_limit_and_then_the_power_is_removed():
    stop = Stop(AfterStop.DISABLE).run(6, False, statusword=ENABLED, mode=1)
    stood = len(stop.sent)
    stop.run(60, False, statusword=SWITCHED_ON)
    assert not stop.done
    assert stop.stop_sequence.late == []
    stop.run(10, False, statusword=ENABLED)
    assert stop.stop_sequence.late == ["disable_time"]
    assert len(stop.sent) - stood >= 64
    assert stop.words[-1] & 0x0F == 0x00


def test_without_power_standstill_must_be_seen_within_the_time_limit():
    stop = Stop().before(3, True, statusword=ENABLED, mode=1).run(1000, True, statusword=READY)
    assert stop.done
    assert not stop.stop_sequence.confirmed
    assert stop.stop_sequence.coasting_text.startswith("its power is off, at ")
    assert len(stop.sent) == 64 + 2  # one second
    at_standstill = Stop().before(3, True, statusword=ENABLED, mode=1).run(1000, False, statusword=READY)
    assert (
        at_standstill.done,
        at_standstill.stop_sequence.confirmed,
        at_standstill.stop_sequence.coasting_text,
    ) == (
        True,
        True,
        "",
    )
    assert len(at_standstill.sent) < 10
    fell = (
        Stop(AfterStop.DISABLE).before(3, True, statusword=ENABLED, mode=1).run(10, False, statusword=READY)
    )
    assert fell.stop_sequence.confirmed
    assert not fell.done  # it still has to be taken down
    assert fell.run(1, False, statusword=DISABLED).done


def test_a_standstill_confirmed_with_power_does_not_count_if_the_motor_moves_without_power():
    stop = (
        Stop(AfterStop.DISABLE).before(3, False, statusword=ENABLED, mode=1).run(8, False, statusword=ENABLED)
    )
    assert stop.stop_sequence.confirmed
    stop.run(3, True, statusword=READY)
    assert not stop.stop_sequence.confirmed
    assert stop.run(200, True, statusword=DISABLED).done
    assert not stop.stop_sequence.confirmed


@pytest.mark.parametrize(
    ("asked", "then", "level", "goes"),
    [
        (StopLevel.QUICK_STOP, AfterStop.HOLD, StopLevel.QUICK_STOP, True),
        (StopLevel.HALT, AfterStop.HOLD, StopLevel.HALT, False),
        (StopLevel.HALT, AfterStop.DISABLE, StopLevel.HALT, False),
    ],
)
def test_a_repeated_stop_request_makes_the_stop_harder_and_never_softer(asked, then, level, goes):
    stop = Stop().run(3, True, statusword=ENABLED, mode=1)
    assert not stop.stop_sequence.removes_power
    stop.stop_sequence.harden(then, asked)
    assert (stop.stop_sequence.level, stop.stop_sequence.removes_power) == (level, then is AfterStop.DISABLE)
    assert (len(stop.stop_sequence.path) == 2) is goes
    stop.stop_sequence.harden(AfterStop.HOLD, StopLevel.HALT)
    assert (stop.stop_sequence.level, stop.stop_sequence.removes_power) == (level, then is AfterStop.DISABLE)
    down = Stop(AfterStop.DISABLE).run(8, False, statusword=ENABLED, mode=1)
    down.stop_sequence.harden(
        AfterStop.HOLD, StopLevel.QUICK_STOP
    )  # it is at standstill, and is being disabled
    assert down.stop_sequence.level is StopLevel.HALT


def edge(stop: Stop, target: int) -> Stop:
    """A set-point far away was given before, by a drive without a visible demand (no 6062h)."""
    reference_tracker = stop.drive.image.reference_tracker
    reference_tracker.note(stop.drive.now, 1, None, target, True)
    return stop


@pytest.mark.parametrize(
    ("waited", "moving", "blocked"),
    [(30, False, True), (10, False, False), (30, True, False)],
)
def test_only_an_axis_at_standstill_in_the_middle_of_its_move_counts_as_held_and_loses_its_power(
    waited, moving, blocked
):
    """Three tenths of a second after its set-point a free axis moves; if its pull is not visible, it is not released softly."""
    stop = Stop().before(10, False, statusword=ENABLED, mode=1)
    edge(stop, 90_000).before(waited, moving)
    stop.run(12, False, statusword=ENABLED)
    assert stop.stop_sequence.blocked is blocked
    assert (stop.stop_sequence.level is StopLevel.QUICK_STOP) is blocked
    assert ("it is not known whether" in stop.stop_sequence.missing_condition) is blocked
    taken = edge(Stop(AfterStop.DISABLE).before(10, False, statusword=ENABLED, mode=1), 90_000).before(
        waited, moving
    )
    taken.run(12, False, statusword=ENABLED)
    assert not taken.stop_sequence.blocked
    assert taken.stop_sequence.level is StopLevel.HALT
    again = edge(Stop().before(10, False, statusword=ENABLED, mode=1), 90_000).before(waited, moving)
    again.stop_sequence.harden(AfterStop.HOLD, StopLevel.QUICK_STOP)
    again.run(2, False, statusword=ENABLED)
    assert not again.stop_sequence.blocked


@pytest.mark.parametrize(
    ("asked_before", "shown", "blocked"), [(20, 1, False), (20, 3, False), (400, 1, True)]
)
def test_an_axis_that_stopped_for_another_mode_is_not_held_by_anything(asked_before, shown, blocked):
    """The drive may show the requested mode late. A mode that it has not shown for long is not the reason."""
    stop = edge(Stop().before(10, False, statusword=ENABLED, mode=1), 90_000).before(30, False)
    stop.drive.order.mode = ModeOfOperation.PROFILE_VELOCITY
    stop.before(asked_before, False, statusword=ENABLED, mode=1)
    stop.run(12, False, statusword=ENABLED, mode=shown)
    assert stop.stop_sequence.blocked is blocked


def test_a_pull_that_is_seen_keeps_a_halted_axis_from_counting_as_stopped():
    stop = Stop().run(400, False, statusword=ENABLED, mode=1, demand=5000)
    assert stop.stop_sequence.path[:2] == [StopLevel.HALT, StopLevel.QUICK_STOP]
    assert stop.stop_sequence.blocked
    assert "leaps" in stop.stop_sequence.missing_condition or "pulls" in stop.stop_sequence.missing_condition
    near = Stop().run(400, False, statusword=ENABLED, mode=1, demand=4000)
    assert near.stop_sequence.path == [StopLevel.HALT]
    assert not near.stop_sequence.blocked


@pytest.mark.parametrize(
    ("mode", "holds", "wanted", "torque"),
    [
        (4, HoldsLoad.TORQUE, 1, None),
        (10, HoldsLoad.BRAKE, 1, None),
        (4, HoldsLoad.NO, 3, 0),
        (3, HoldsLoad.TORQUE, None, 0),
    ],
)
def test_a_torque_is_halted_by_a_mode_that_brakes_or_holds(mode, holds, wanted, torque):
    stop = Stop(holds_load=holds).run(1, True, statusword=ENABLED, mode=mode, demand=50)
    order = stop.drive.order
    assert (order.mode, order.target_torque) == (wanted, torque)
    assert order.halt is (wanted is None)
    if wanted is not None:
        assert (order.target_position, order.target_velocity) == (50, 0)


def test_a_load_is_held_by_the_first_mode_that_the_drive_has():
    for has, wanted in (({8, 3}, 8), ({3}, 3), ({9}, 1)):
        modes = frozenset(ModeOfOperation(mode) for mode in has)
        stop = Stop(holds_load=HoldsLoad.TORQUE, modes=modes).run(1, True, statusword=ENABLED, mode=4)
        assert stop.drive.order.mode == wanted


@pytest.mark.parametrize(
    ("holds", "torque"), [(HoldsLoad.NO, 0), (HoldsLoad.BRAKE, None), (HoldsLoad.TORQUE, None)]
)
def test_a_quick_stop_takes_no_torque_from_a_load(holds, torque):
    stop = Stop(start=StopLevel.QUICK_STOP, holds_load=holds).run(1, True, statusword=ENABLED, mode=4)
    assert (stop.drive.order.target_torque, stop.drive.order.target_velocity) == (torque, 0)


def test_a_running_observation_by_sdo_is_cancelled_at_the_end():
    stop = Stop(start=StopLevel.QUICK_STOP).run(1, False, statusword=None, mode=1)
    asked = [request.id for request in stop.drive.order.sdo if request.value is None]
    assert len(asked) == 2
    stop.run(3, False, statusword=DISABLED)
    assert stop.done
    assert stop.drive.order.cancel == asked


def test_names_of_steps():
    assert [level.text for level in StopLevel] == ["halt", "quick stop", "disable voltage", "NMT stop"]


# Along a path.


def path(drive: Drive, end: float = 40.0) -> Follow:
    return Follow(TrapezoidalTrajectory(0.0, end, 20.0, 40.0), drive.parameters, OPEN)


def test_a_path_is_braked_only_while_it_runs_and_with_a_known_deceleration():
    drive = Drive(scan_period=0.01)
    follow = path(drive)
    drive.cycle(statusword=ENABLED, mode=8, position=0)
    assert not follow.begin_braking()
    assert follow.at_rest
    for _ in range(60):
        for request in drive.order.sdo:
            drive.answers(request.id)
        follow.step(*drive.cycle(statusword=ENABLED, mode=8, position=0))
    assert not follow.at_rest
    assert follow.begin_braking()
    assert follow.clock.braking
    for _ in range(60):
        follow.step(*drive.cycle(statusword=ENABLED, mode=8, position=0))
    assert follow.at_rest
    none = Drive(scan_period=0.01, defaults=Defaults(), limits=AxisLimits(velocity=400.0))
    unknown = path(none)
    for _ in range(60):
        for request in none.order.sdo:
            none.answers(request.id)
        unknown.step(*none.cycle(statusword=ENABLED, mode=8, position=0))
    assert not unknown.begin_braking()


class Change:
    """A change of mode with a given result in each cycle; notes if it was cancelled."""

    def __init__(self, *says: bool | Exception) -> None:
        self.says, self.cancelled = list(says), 0

    def step(self, *_) -> bool:
        said = self.says.pop(0)
        if isinstance(said, Exception):
            raise said
        return said

    def cancel(self, _) -> None:
        self.cancelled += 1


def stop_out_of_a_path(change: Change) -> tuple[Stop, list[str]]:
    """A halt while a trajectory in csp is being left; the calls of the trajectory are noted."""
    asked: list[str] = []

    def brakes() -> bool:
        asked.append("brake")
        return True

    follow = SimpleNamespace(
        mode=8, at_rest=False, begin_braking=brakes, step=lambda *_: asked.append("step")
    )
    stop = Stop()
    stop.stop_sequence = StopSequence(
        stop.drive.parameters, AfterStop.HOLD, follow=follow, pending_mode_switch=change
    )
    return stop, asked


def test_a_mode_change_is_completed_before_the_drive_s_own_halt():
    stop, asked = stop_out_of_a_path(Change(False, False, True))
    stop.run(2, True, statusword=ENABLED, mode=8)
    assert asked == ["brake", "brake"]  # it continues along the path
    assert not stop.drive.order.halt
    assert stop.stop_sequence.pending_mode_switch is not None
    stop.run(1, True, mode=3)
    assert (stop.stop_sequence.pending_mode_switch, stop.stop_sequence.follow) == (None, None)
    assert stop.drive.order.halt
    stop.run(2, True)
    assert asked == ["brake"] * 3


def test_if_the_drive_does_not_take_its_new_mode_it_is_braked_along_the_path():
    change = Change(False, DriveError("no"))
    stop, asked = stop_out_of_a_path(change)
    stop.run(3, True, statusword=ENABLED, mode=8)
    assert change.cancelled == 1
    assert stop.stop_sequence.pending_mode_switch is None
    assert asked == ["brake", "brake", "brake", "step", "brake", "step"]
    assert not stop.drive.order.halt


def test_a_harder_stop_withdraws_the_mode_change():
    change = Change(False, False)
    stop, _ = stop_out_of_a_path(change)
    stop.run(1, True, statusword=ENABLED, mode=8)
    assert change.cancelled == 0
    stop.stop_sequence.harden(AfterStop.HOLD, StopLevel.QUICK_STOP)
    stop.run(2, True)
    assert change.cancelled == 1
    assert stop.stop_sequence.pending_mode_switch is None


def test_a_path_that_has_ended_is_at_standstill():
    drive = Drive(scan_period=0.01)
    follow = path(drive, 0.5)
    for _ in range(60):
        for request in drive.order.sdo:
            drive.answers(request.id)
        follow.step(*drive.cycle(statusword=ENABLED, mode=8, position=0))
    assert drive.order.target_position == 500
    assert follow.at_rest
    assert follow.take_stepped()
    assert not follow.take_stepped()
    assert isinstance(follow.clock, PathClock)


@pytest.mark.parametrize(("start", "begins"), [(0.0, True), (90.0, False)])
def test_a_trajectory_begins_at_the_present_position(start, begins):
    drive = Drive(scan_period=0.01)
    follow = Follow(TrapezoidalTrajectory(start, start + 1.0, 20.0, 40.0), drive.parameters, OPEN)

    def run() -> None:
        for _ in range(20):
            for request in drive.order.sdo:
                drive.answers(request.id)
            follow.step(*drive.cycle(statusword=ENABLED, mode=8, position=0))

    if begins:
        run()
        return
    with pytest.raises(LimitError, match="does not begin at the position of the axis") as caught:
        run()
    assert caught.value.observed == "it begins at 90 deg, the axis is at 0 deg"


def test_a_path_without_a_position_is_refused():
    drive = Drive(scan_period=0.01)
    with pytest.raises(StaleError, match="cyclic synchronous position mode needs it"):
        path(drive).step(*drive.cycle(statusword=ENABLED, mode=8))


# Closing.


def test_the_stop_at_the_end_has_the_time_of_all_steps():
    assert TIMES.stop_sequence == 0.5 + 0.25 + 2.0


def test_a_report_of_an_earlier_request_is_not_repeated():
    """The same error may come from an axis whose stop was asked for again."""
    way_out, error, other = ShutdownStop(), StaleError("x: once"), StaleError("y: another")
    way_out._earlier_errors = [error]
    way_out._axes = [SimpleNamespace(final_error=final_error) for final_error in (error, None, other)]
    assert way_out.failures() == [error, other]


def pending_mode_switch(**changes) -> tuple[SimpleNamespace, AxisShutdown]:
    """An axis whose own stop is over, and its observations after it."""
    image = SimpleNamespace(
        state=PowerState.SWITCH_ON_DISABLED, position=0, velocity=None, standstill=False, position_stamp=99.0
    )
    core = SimpleNamespace(
        touched=True, stop_confirmed=False, image=image, parameters=Drive(stop_times=TIMES).parameters
    )
    for name, value in changes.items():
        setattr(image if hasattr(image, name) else core, name, value)
    axis = AxisShutdown.__new__(AxisShutdown)
    axis.over, axis.error, axis._core = False, None, core
    axis._since, axis._until = 100.0, 102.75
    axis._ticket = SimpleNamespace(busy=False, error=None)
    return core, axis


@pytest.mark.parametrize(
    ("changes", "over"),
    [
        ({"touched": False}, True),
        ({}, False),
        ({"standstill": True}, False),  # a position of before says nothing
        ({"standstill": True, "position_stamp": 100.0}, True),
        ({"standstill": True, "stop_confirmed": True}, True),
        ({"stop_confirmed": True}, False),
        ({"standstill": True, "position_stamp": 100.0, "state": PowerState.OPERATION_ENABLED}, False),
        ({"standstill": True, "state": PowerState.OPERATION_ENABLED, "stop_confirmed": True}, True),
        ({"standstill": True, "position_stamp": 100.0, "state": PowerState.UNKNOWN}, False),
        ({"position": None}, False),  # it has 6064h, and no value was received
        ({"position": None, "stop_confirmed": True}, True),
        ({"position": None, "parameters": Drive(objects=frozenset({0x6041})).parameters}, True),
        ({"position": None, "velocity": 5}, False),
        ({"position": None, "velocity": 0}, True),
    ],
)
def test_an_axis_has_left_its_path_when_standstill_is_seen(changes, over):
    _, axis = pending_mode_switch(**changes)
    axis.step(102.75)
    assert axis.over is over
    assert axis.error is None
    axis.step(102.75 + T)
    assert axis.over
    assert (axis.error is None) is over
    if not over:
        assert axis.error.message == "x: the stop of the axis could not be confirmed"
        assert "TREAT THE AXIS AS MOVING" in axis.error.remedy
        assert axis.error_so_far is axis.error
    assert axis.final_error is axis.error


def test_a_running_stop_is_not_over():
    _, axis = pending_mode_switch(touched=False)
    axis._ticket.busy = True
    axis.step(1000.0)
    assert not axis.over
    assert axis.final_error is None
    _, moving = pending_mode_switch()
    assert "could not be confirmed" in moving.final_error.message
    assert moving.error_so_far is None


# Calls to several axes, and values that are not known.


def test_a_group_needs_one_position_for_each_of_its_axes():
    r = rig("xy").enabled()
    for call in (
        lambda: r.groups["all"].move_direct((1.0,)),
        lambda: r.groups["all"].move_direct((1.0, 2.0, 3.0)),
        lambda: r.groups["all"].move_linear((1.0,), velocity=1.0),
    ):
        with pytest.raises(ArgumentError, match=r"positions? for 2 axes"):
            call()
    assert repr(r.groups["all"]) == "<Group all: x Standstill, y Standstill>"
    bounded = rig("xy", limits=AxisLimits(position=(-5.0, 5.0))).enabled()
    with pytest.raises(LimitError):
        bounded.groups["all"].move_direct((1.0, 6.0))
    for velocity in (0.0, -1.0, float("nan")):
        with pytest.raises(LimitError, match="must be a finite number above 0"):
            r.groups["all"].move_linear((1.0, 2.0), velocity=velocity)


def test_why_a_value_is_not_known_is_reported():
    r = rig(port={"inputs": {"velocity": ValueTransport.NONE}})
    r.run(0.1)
    with pytest.raises(StaleError) as caught:
        _ = r.axis.velocity
    assert caught.value.observed == "it is not transmitted: no TPDO contains it, and it is not polled"
    assert r.axis.position == 0.0
    assert r.axis.state is AxisState.DISABLED


def test_the_observation_missing_at_a_time_limit_is_stored_for_the_report():
    stop = Stop().run(34, True, statusword=ENABLED, mode=1).run(20, False, statusword=QUICK)
    assert stop.stop_sequence.level is StopLevel.QUICK_STOP
    assert "still moving" in stop.stop_sequence.missing_condition
    assert not stop.stop_sequence.blocked
    blocked = Stop().run(34, False, statusword=ENABLED, mode=1, demand=5000)
    assert blocked.stop_sequence.blocked
    blocked.run(18, False, statusword=ENABLED, demand=0)
    assert blocked.stop_sequence.path == [StopLevel.HALT, StopLevel.QUICK_STOP, StopLevel.DISABLE_VOLTAGE]
    assert blocked.stop_sequence.blocked  # something did hold it, whatever was seen later


def test_an_axis_on_a_path_has_not_stopped_before_its_path_has():
    """Two increments in a tenth of a second look like standing, and are not."""
    drive = Drive(scan_period=0.01, defaults=Defaults(acceleration=0.05), stop_times=StopTimes(halt=5.0))
    follow = Follow(TrapezoidalTrajectory(0.0, 40.0, 0.02, 0.05), drive.parameters, OPEN)
    for _ in range(100):
        for request in drive.order.sdo:
            drive.answers(request.id)
        follow.step(*drive.cycle(statusword=0x1237, mode=8, position=0))
    stop_sequence = StopSequence(drive.parameters, AfterStop.HOLD, follow=follow)
    coast_down, cycles = CoastDown(drive.parameters), 0
    while not stop_sequence.step(*drive.cycle(statusword=0x1237, position=0), coast_down):
        cycles += 1
        assert cycles < 200
    assert follow.at_rest
    assert stop_sequence.confirmed
    assert cycles >= 38  # 0.4 s of the path's time
