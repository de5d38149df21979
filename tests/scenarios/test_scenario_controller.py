"""A loop of the program controls an axis: it gets the values of each cycle, and the axis stops if it does not answer."""

from __future__ import annotations

from itertools import pairwise

import pytest

from axisbus.errors import ArgumentError, CommandError, Interrupted, LimitError, StateError
from axisbus.machine.streaming.controller import AxisFeedback
from axisbus.motion.commands import ControllerCommand, ControllerOutput, CyclicTorque, CyclicVelocity
from axisbus.motion.cyclic.user_controller import ControllerOutputBuffer
from axisbus.motion.states import AxisState
from kit.cell import Cell
from kit.plant_probe import ENABLED, OFF, QUICK_STOP

RATED = "rated_torque = 10.0\n"
RAMP = 500.0  # deg/s², the default
CSV, CST = 9, 10


def to(place: float):
    """A loop that goes to a place."""
    return lambda seen: 5.0 * (place - seen.position)


def opened(scenario, axis: str = "") -> Cell:
    return scenario.simulated("x", axis=RATED + axis).enabled()


def test_a_velocity_loop_moves_the_axis_to_its_position(scenario):
    cell = opened(scenario)
    seen: list[AxisFeedback] = []

    def loop(measured: AxisFeedback) -> float:
        seen.append(measured)
        return to(90.0)(measured)

    moment = cell.moment()
    controller = cell.x.controller(loop)
    cell.run(3.0)
    assert cell.x.position == pytest.approx(90.0, abs=0.2)
    assert controller.handle.busy
    assert cell.drive().mode_display == CSV
    assert cell.x.state is AxisState.CONTINUOUS_MOTION
    assert cell.hardest_change(since=moment) <= 1.05 * RAMP
    steps = [after.time - before.time for before, after in pairwise(seen)]
    assert steps == pytest.approx([cell.machine.cell.bus.scan_period] * len(steps))
    assert [one.dt for one in seen[1:]] == pytest.approx(steps)


def test_a_torque_controller_holds_a_position_and_receives_the_measured_torque(scenario):
    cell = opened(scenario)
    seen: list[AxisFeedback] = []

    def loop(measured: AxisFeedback) -> float:
        seen.append(measured)
        return 0.05 * (30.0 - measured.position) - 0.01 * measured.velocity

    cell.x.controller(loop, output="torque", slope=200.0)
    cell.run(6.0)
    assert cell.drive().mode_display == CST
    assert cell.where("x") == pytest.approx(30.0, abs=6.0)  # the deviation left by friction
    assert max(abs(one.torque) for one in seen) > 0.1


def test_an_answer_that_would_exceed_the_limits_is_found_before_the_drive_gets_it(scenario):
    cell = opened(scenario, "position_limits = [0.0, 100.0]\n")
    answers = [0.0]
    cell.x.controller(lambda _: answers[0])
    cell.run(1.0)
    assert cell.drive().mode_display == CSV
    answers[0] = -cell.x.limits.velocity
    cell.until(lambda: cell.x.error is not None)
    assert isinstance(cell.x.error, LimitError)
    cell.run(0.5)
    assert cell.where("x") == pytest.approx(0.0, abs=0.01)


def test_an_answer_beyond_a_limit_is_limited_and_counted(scenario):
    cell = opened(scenario)
    most = cell.x.limits.velocity
    controller = cell.x.controller(lambda _: 1e6)
    cell.until(lambda: cell.speed() > 0.9 * most)
    cell.run(0.5)
    assert cell.speed() == pytest.approx(most, rel=0.02)
    assert controller.saturated_count > 10
    assert controller.handle.busy


@pytest.mark.parametrize("by", ["velocity", "torque"])
@pytest.mark.parametrize("answer", [None, float("nan"), "fast", 1 / 3])
def test_an_invalid_answer_stops_the_axis_with_the_reason(scenario, by, answer):
    cell = opened(scenario)
    calls = iter(range(10_000))

    def loop(_: AxisFeedback) -> float:
        if next(calls) < 100:
            return 50.0 if by == "velocity" else 0.3
        if answer == 1 / 3:
            raise ValueError("no plan")
        return answer

    controller = cell.x.controller(loop, output=by, slope=5.0)
    cell.until(lambda: not controller.handle.busy, 5)
    assert cell.speed() > 20.0
    error = controller.handle.exception()
    assert isinstance(error, CommandError)
    assert "its controller has failed" in error.message
    assert type(controller.error).__name__ in error.message
    cell.must_be_still(within=1.5, stages=ENABLED)
    assert cell.x.state is AxisState.ERRORSTOP
    before = next(calls)
    cell.run(1.0)
    assert next(calls) == before + 1  # it is not called any more


def test_the_end_of_a_block_halts_the_axis(scenario):
    cell = opened(scenario)
    with cell.x.controller(lambda _: 80.0) as controller:
        cell.run(1.0)
        cell.must_move()
    cell.must_be_still(within=1.5, stages=ENABLED)
    assert isinstance(controller.handle.exception(), Interrupted)
    assert cell.x.state is AxisState.STANDSTILL


def test_the_end_of_a_block_raises_the_error_that_ended_the_loop(scenario):
    cell = opened(scenario)
    calls = []

    def loop(_: AxisFeedback) -> float:
        calls.append(1)
        if len(calls) > 50:
            raise ZeroDivisionError("no way")
        return 50.0

    with pytest.raises(CommandError, match="ZeroDivisionError: no way"), cell.x.controller(loop):
        cell.run(2.0)
    cell.must_be_still(within=1.5, stages=ENABLED)


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_block_left_by_an_exception_waits_for_standstill(scenario, error):
    cell = opened(scenario)
    with pytest.raises(error), cell.x.controller(lambda _: 80.0) as controller:
        cell.run(1.0)
        cell.must_move()
        raise error
    assert cell.speed() == pytest.approx(0.0, abs=0.1)
    assert cell.x.state is AxisState.STANDSTILL
    assert controller.handle.aborted


def test_a_with_block_whose_controller_failed_waits_for_standstill(scenario):
    cell = opened(scenario)
    answers = iter([80.0] * 100)
    with pytest.raises(CommandError, match="StopIteration"), cell.x.controller(lambda _: next(answers)):
        cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)
        cell.must_move()
    assert cell.speed() == pytest.approx(0.0, abs=0.1)


def test_a_block_left_by_an_exception_warns_that_its_axis_may_still_move(scenario):
    cell = opened(scenario)
    with pytest.raises(ZeroDivisionError) as caught, cell.x.controller(lambda _: 80.0):
        cell.run(1.0)
        cell.device("x").dials.dead = True
        raise ZeroDivisionError
    assert any("TREAT THE AXIS AS MOVING" in note for note in caught.value.__notes__)


@pytest.mark.parametrize("stop", ["halt", "stop", "quick_stop", "disable", "cyclic_velocity", "controller"])
def test_each_command_that_takes_over_ends_the_controller_without_a_jump(scenario, stop):
    cell = opened(scenario)
    moment = cell.moment()
    controller = cell.x.controller(lambda _: 80.0)
    cell.run(1.0)
    cell.must_move()
    given = {"cyclic_velocity": (20.0,), "controller": (lambda _: 20.0,)}.get(stop, ())
    getattr(cell.x, stop)(*given)
    cell.until(lambda: not controller.handle.busy)
    assert isinstance(controller.handle.exception(), Interrupted)
    if given:
        cell.run(1.0)
        assert cell.speed() == pytest.approx(20.0, rel=0.02)
        assert cell.hardest_change(since=moment) <= 1.05 * RAMP
    else:
        cell.must_be_still(
            within=1.5, stages={"disable": OFF, "quick_stop": (*OFF, QUICK_STOP)}.get(stop, ENABLED)
        )


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.5])
def test_an_override_scales_the_velocity_that_a_controller_returns(scenario, factor):
    cell = opened(scenario)
    cell.x.controller(lambda _: 60.0)
    cell.run(1.0)
    cell.x.set_override(factor).wait(1)
    cell.run(1.0)
    assert cell.speed() == pytest.approx(60.0 * factor, abs=1.0)


def test_a_controller_begins_from_the_velocity_that_is_being_sent(scenario):
    cell = opened(scenario)
    cell.x.cyclic_velocity(80.0).wait(5)
    moment = cell.moment()
    cell.x.controller(lambda _: 80.0)
    cell.run(1.0)
    assert cell.hardest_change(since=moment) <= 0.1 * RAMP


def test_an_axis_that_is_off_or_moves_otherwise_is_not_taken(scenario):
    cell = scenario.simulated("x", axis=RATED)
    with pytest.raises(StateError):
        cell.x.controller(to(1.0)).handle.wait(1)
    cell.enabled()
    cell.x.move_velocity(30.0).wait(5)
    with pytest.raises(StateError):
        cell.x.controller(to(1.0)).handle.wait(1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"output": "position"}, "is not known"),
        ({"max_missed_cycles": -1}, "not a number of cycles"),
        ({"max_missed_cycles": True}, "not a number of cycles"),
        ({"output": "torque", "slope": 0.0}, "slope"),
        ({"acceleration": -1.0}, "acceleration"),
    ],
)
def test_a_controller_with_invalid_arguments_is_refused_with_the_reason(scenario, options, words):
    cell = opened(scenario)
    with pytest.raises((ArgumentError, LimitError), match=words):
        cell.x.controller(to(1.0), **options)
    with pytest.raises(ArgumentError, match="is not a function"):
        cell.x.controller(3.0)


# -- how late an answer may be -------------------------------------------------------------------------------------------


def answers(late: int = 0) -> ControllerOutputBuffer:
    return ControllerOutputBuffer(ControllerCommand(7, CyclicVelocity(0, 1.0, 1.0), late), "x")


@pytest.mark.parametrize("late", [0, 1, 3])
def test_an_answer_holds_for_the_next_cycle_and_for_as_many_more_as_are_allowed(late):
    loop = answers(late)
    assert loop.due(1.0) is None
    assert loop.take(ControllerOutput(7, 1.0, 50))
    for number in range(late + 1):
        assert loop.due(1.01 + 0.01 * number) == 50
    with pytest.raises(CommandError, match="answered too late"):
        loop.due(1.01 + 0.01 * (late + 1))


def test_cycles_that_the_core_has_skipped_count_as_one():
    loop = answers()
    loop.due(1.0)
    loop.take(ControllerOutput(7, 1.0, 50))
    assert loop.due(1.3) == 50


def test_an_older_answer_and_one_of_another_loop_change_nothing():
    loop = answers(5)
    loop.due(1.0)
    assert loop.take(ControllerOutput(7, 1.0, 50))
    assert loop.take(ControllerOutput(7, 0.9, 10))
    assert not loop.take(ControllerOutput(8, 1.0, 20))
    assert loop.due(1.01) == 50


def test_a_loop_that_never_answers_is_not_waited_for():
    loop = ControllerOutputBuffer(ControllerCommand(7, CyclicTorque(0, 5), 1000), "x")
    assert [loop.due(0.1 * number) for number in range(10)] == [None] * 10
    with pytest.raises(CommandError, match="has given no first answer"):
        loop.due(1.2)


def test_a_torque_controller_that_has_moved_an_axis_out_of_its_limits_is_not_begun_again(scenario):
    cell = opened(scenario, "position_limits = [-50.0, 50.0]\n")
    cell.x.set_position(49.9).wait(2)
    cell.x.controller(lambda _: 3.0, output="torque", slope=1000.0)
    cell.until(lambda: cell.x.error is not None)
    cell.run(1.0)
    out = cell.x.position
    assert out > 50.1
    cell.x.reset().wait(5)
    cell.x.enable().wait(5)
    with pytest.raises(LimitError, match="a torque has moved it there"):
        cell.x.controller(lambda _: 3.0, output="torque", slope=1000.0).handle.wait(5)
    cell.run(0.5)
    assert cell.x.position == pytest.approx(out, abs=0.05)
    cell.x.move_absolute(0.0).wait(10)
    assert cell.x.controller(lambda _: 0.0, output="torque", slope=1000.0).handle.busy
