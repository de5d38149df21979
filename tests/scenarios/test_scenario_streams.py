"""Axes follow points that a program gives at its own pace, and stop on their path if points are missing."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from axisbus import PointStream, wait
from axisbus.errors import (
    ArgumentError,
    AxisbusError,
    CommandError,
    DriveFault,
    Interrupted,
    LimitError,
    NodeError,
    StateError,
)
from axisbus.motion.states import AxisState
from kit.cell import Cell
from kit.plant_probe import ENABLED, OFF, QUICK_STOP

HARDEST = 2000.0
AXIS = f"max_acceleration = {HARDEST}\nposition_limits = [-300.0, 300.0]"
STEP = 0.01
SHARES = {"x": 1.0, "y": 0.5, "z": -0.25}


def place(t: float) -> tuple[float, float, float]:
    """Where x, y and z are to be: on one line, at up to 120 deg/s."""
    x = 60.0 * (1.0 - math.cos(2.0 * t))
    return x, SHARES["y"] * x, SHARES["z"] * x


def opened(scenario, on_fault: str = "path", **changes) -> Cell:
    more = f'[groups.xyz]\naxes = ["x", "y", "z"]\non_fault = "{on_fault}"\n'
    return scenario.simulated("xyz", axis=AXIS, more=more, **changes).enabled()


def stream(cell: Cell, **options) -> PointStream:
    return cell.machine.group("xyz").stream(**({"period": STEP} | options))


def feed(cell: Cell, points: PointStream, seconds: float, path: Callable = place) -> None:
    """Give points as there is room for them, until the next cycle would be later than that."""
    end = cell.now + seconds
    while cell.now < end:
        while points.try_push(path(points.count * STEP)):
            pass
        cell.run(STEP)


def must_be_on_the_line(cell: Cell, since: float = 0.0) -> None:
    for x, y, z in zip(*(cell.positions(name, since) for name in "xyz"), strict=True):
        assert (y, z) == pytest.approx((SHARES["y"] * x, SHARES["z"] * x), abs=0.15)


def must_not_jolt(cell: Cell, names: str = "xyz") -> None:
    for name in names:
        assert cell.hardest_change(name) < 1.3 * HARDEST


def must_be_still(cell: Cell, names: str = "xyz") -> None:
    before = [cell.where(name) for name in names]
    cell.run(0.3)
    assert [cell.where(name) for name in names] == pytest.approx(before, abs=0.02)


def test_axes_follow_the_points_and_stop_at_the_last(scenario):
    cell = opened(scenario)
    seen = []
    cell.each_cycle(lambda now, _: seen.append((now, cell.drive("x").target_position / 100)))
    with stream(cell) as points:
        for number in range(250):
            points.push(place(number * STEP))
            assert points.buffered_seconds < 0.6
    assert points.handle.done
    assert [cell.where(name) for name in "xyz"] == pytest.approx(place(2.49), abs=0.1)
    must_be_on_the_line(cell)
    must_not_jolt(cell)
    begun = next(now for now, target in seen if target > 0.02)
    # In step with the points, once it is at their pace.
    late = [abs(target - place(now - begun + 0.02)[0]) for now, target in seen if 0.2 < now - begun < 2.2]
    assert max(late) < 120.0 * 3 * STEP
    assert cell["x"].state is AxisState.STANDSTILL


def test_points_may_have_times_of_their_own(scenario):
    cell = opened(scenario)
    with stream(cell, period=None) as points:
        t = 17.0
        while t < 19.0:
            points.push((t, *place(t - 17.0)))
            t += STEP * (1.0 + 0.5 * math.sin(50.0 * t))
    assert [cell.where(name) for name in "xyz"] == pytest.approx(place(2.0), abs=2.0)
    must_be_on_the_line(cell)
    must_not_jolt(cell)


@pytest.mark.parametrize("pause", [0.3, 2.0])
def test_without_points_the_axes_brake_on_their_path_and_continue_with_the_next_points(scenario, pause):
    cell = opened(scenario)
    points = stream(cell, buffer="50ms")
    feed(cell, points, 0.8)
    cell.must_move("x")
    cell.run(pause)
    if pause > 1.0:
        must_be_still(cell)
        assert points.buffered_seconds == 0.0
    assert points.handle.active
    feed(cell, points, 1.0)
    cell.must_move("x", 5.0)
    last = place((points.count - 1) * STEP)
    assert cell.end_of(points.finish()) is None
    assert [cell.where(name) for name in "xyz"] == pytest.approx(last, abs=0.1)
    must_be_on_the_line(cell)
    must_not_jolt(cell)


def test_an_underrun_ends_a_stream_that_is_to_end_by_it(scenario):
    cell = opened(scenario)
    points = stream(cell, on_underrun="error")
    feed(cell, points, 0.8)
    error = cell.failure_of(points.handle)
    assert isinstance(error, CommandError)
    assert "underrun" in error.message
    assert "position in the stream: " in error.observed
    assert "buffer" in error.remedy
    cell.run(1.0)
    must_be_still(cell)
    must_be_on_the_line(cell)
    must_not_jolt(cell)
    with pytest.raises(CommandError, match="underrun"):
        points.push(place(1.0))
    assert cell["x"].state is AxisState.STANDSTILL
    assert cell.end_of(cell["x"].move_absolute(0.0)) is None


def test_a_stream_that_is_fed_in_time_has_no_underrun(scenario):
    cell = opened(scenario)
    points = stream(cell, on_underrun="error")
    feed(cell, points, 3.0)
    assert cell.end_of(points.finish()) is None


BAD = {
    "too fast": (
        (9.0, 0.0, 0.0),
        LimitError,
        r"point \d+ takes x beyond its velocity.*\n.*the allowed maximum is 400",
    ),
    "too hard": ((0.0, 2.0, 0.0), LimitError, r"point \d+ takes y beyond its acceleration.*\n.*80%"),
    "too far": ((400.0, 0.0, 0.0), LimitError, r"x.push \(point \d+\): beyond the position limits"),
    "no number": ((math.nan, 0.0, 0.0), ArgumentError, "is invalid"),
    "too few": (None, ArgumentError, "3 finite numbers"),
    "no sequence": (7, ArgumentError, "is invalid"),
}


@pytest.mark.parametrize("bad", BAD)
def test_an_invalid_point_is_refused_as_a_whole(scenario, bad):
    off, kind, words = BAD[bad]
    cell = opened(scenario)
    points = stream(cell)
    feed(cell, points, 0.5)
    cell.run(0.05)
    given, count = place(points.count * STEP), points.count
    wrong = (
        off
        if isinstance(off, int)
        else given[:2]
        if off is None
        else [a + b for a, b in zip(given, off, strict=True)]
    )
    with pytest.raises(kind, match=words):
        points.try_push(wrong)
    assert points.count == count
    assert points.try_push(given)
    feed(cell, points, 0.5)
    assert cell.end_of(points.finish()) is None
    must_be_on_the_line(cell)


@pytest.mark.parametrize("t", [0.02, 0.01, 0.021, 100.0])
def test_times_continue(scenario, t):
    cell = opened(scenario)
    points = stream(cell, period=None)
    for number in range(3):
        points.push((number * STEP, *place(number * STEP)))
    with pytest.raises(ArgumentError, match=r"this point was rejected|scan period"):
        points.push((t, *place(0.03)))
    points.push((0.03, *place(0.03)))
    assert cell.end_of(points.finish()) is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"period": "1ms"}, "scan period"),
        ({"period": "soon"}, "not a time"),
        ({"on_underrun": "panic"}, "hold"),
        ({"buffer": -1.0}, "buffer"),
    ],
)
def test_invalid_options_of_a_stream_are_refused(scenario, options, words):
    cell = opened(scenario)
    with pytest.raises(ArgumentError, match=words):
        stream(cell, **options)


def test_a_stream_begins_at_the_present_position(scenario):
    cell = opened(scenario)
    points = stream(cell)
    with pytest.raises(StateError, match="y is not at the start of the stream"):
        points.push((0.0, 5.0, 0.0))
    points.push((0.0, 0.0, 0.0))
    assert cell.end_of(points.finish()) is None


def test_axes_wait_for_points_for_as_long_as_it_takes(scenario):
    cell = opened(scenario)
    cell["x"].move_absolute(10.0).wait()
    points = stream(cell)
    cell.run(30.0)
    assert points.handle.active
    assert cell.where("x") == pytest.approx(10.0, abs=0.05)
    cell.must_be(ENABLED)
    for number in range(100):
        x, y, z = place(number * STEP)
        points.push((x + 10.0, y, z))
    assert cell.end_of(points.finish()) is None
    must_not_jolt(cell)


def test_points_that_are_lost_in_transit_end_the_stream_without_a_jump(scenario):
    cell = opened(scenario)
    points = stream(cell)
    feed(cell, points, 0.8)
    points._sent += 1  # as if one had not reached the core
    with pytest.raises(StateError, match="did not arrive"):
        feed(cell, points, 1.0)
    cell.run(1.0)
    must_be_still(cell)
    must_be_on_the_line(cell)
    must_not_jolt(cell)


def test_cycles_that_are_late_make_it_late_and_nothing_else(scenario):
    cell = opened(scenario)
    points = stream(cell, on_underrun="error")
    feed(cell, points, 0.6)
    skipped = cell.machine.cycle_jitter.skipped
    for blocks in (0.018, 0.0, 0.025, 0.0):
        cell.faults.send_blocks = blocks
        feed(cell, points, 0.2)
    assert cell.machine.cycle_jitter.skipped > skipped
    assert cell.end_of(points.finish()) is None
    must_be_on_the_line(cell)
    assert cell.where("x") == pytest.approx(place((points.count - 1) * STEP)[0], abs=0.1)


def test_a_stream_that_gets_no_point_ends_well(scenario):
    cell = opened(scenario)
    with stream(cell) as points:
        cell.run(0.2)
    assert points.handle.done
    must_be_still(cell)


def test_a_full_buffer_blocks_the_program_no_longer_than_its_timeout(scenario):
    cell = opened(scenario)
    group = cell.machine.group("xyz")
    group.set_override(0.0).wait()
    points = stream(cell)
    with pytest.raises(TimeoutError, match="no room for point"):
        for number in range(1000):
            points.push(place(number * STEP), timeout=0.5)
    group.set_override(0.5).wait()
    count = points.count
    feed(cell, points, 2.0)
    assert points.count - count == pytest.approx(100, abs=25)  # at half the pace
    must_be_on_the_line(cell)
    cell.end_of(points.finish())
    must_not_jolt(cell)


def test_an_exception_in_its_block_halts_the_axes(scenario):
    cell = opened(scenario)
    with pytest.raises(ZeroDivisionError), stream(cell) as points:
        feed(cell, points, 0.8)
        points.push((1 / 0, 0.0, 0.0))
    must_be_still(cell)
    must_be_on_the_line(cell)
    assert points.handle.aborted
    with pytest.raises(Interrupted):
        points.push(place(1.0))


def test_a_with_block_whose_stream_was_interrupted_waits_for_standstill(scenario):
    cell = opened(scenario)
    with pytest.raises(Interrupted), stream(cell) as points:
        feed(cell, points, 0.8)
        cell["y"].halt()
    must_be_still(cell)


def test_a_block_left_by_an_exception_does_not_end_motions_that_have_taken_over(scenario):
    cell = opened(scenario)
    with pytest.raises(ZeroDivisionError), stream(cell) as points:
        feed(cell, points, 0.8)
        moves = [cell[name].move_absolute(0.0) for name in "xyz"]
        cell.run(0.1)
        raise ZeroDivisionError
    wait(*moves)
    assert points.handle.aborted


STOPS = {
    "halt": lambda cell: cell.machine.group("xyz").halt(),
    "halt of one": lambda cell: cell["y"].halt(),
    "stop": lambda cell: cell.machine.group("xyz").stop(),
    "quick stop": lambda cell: cell.machine.group("xyz").quick_stop(),
    "quick stop of one": lambda cell: cell["z"].quick_stop(),
    "disable": lambda cell: cell.machine.group("xyz").disable(),
    "a move of one": lambda cell: cell["x"].move_absolute(0.0),
    "another stream": lambda cell: stream(cell).handle,
}


@pytest.mark.parametrize("stop", STOPS)
def test_each_stop_of_one_axis_of_a_stream_stops_all(scenario, stop):
    cell = opened(scenario)
    points = stream(cell)
    feed(cell, points, 0.8)
    handle = STOPS[stop](cell)
    feeding_ends_with = None
    try:
        feed(cell, points, 2.0)
    except AxisbusError as error:
        feeding_ends_with = error
    if stop == "another stream":  # which wants standstill
        assert isinstance(cell.failure_of(handle), StateError)
        assert feeding_ends_with is None
        return
    assert feeding_ends_with is not None
    cell.run(1.0)
    assert cell.end_of(handle) is None
    assert not points.handle.busy
    must_be_still(cell)
    if "halt" in stop:
        must_be_on_the_line(cell)


@pytest.mark.parametrize(("on_fault", "ramp"), [("path", 500.0), ("each", 500.0), ("quick", 1000.0)])
def test_a_fault_brakes_the_other_axes_as_on_fault_of_their_group_requires(scenario, on_fault, ramp):
    cell = opened(scenario, on_fault)
    points = stream(cell)
    feed(cell, points, 0.75)
    since = cell.moment()
    cell.machine.simulated_node(3).fault(0x2310)
    with pytest.raises(DriveFault):
        feed(cell, points, 1.5)
    cell.run(1.5)
    for name in "xy":
        samples = cell.record(name).since(since)
        top = abs(samples[0].velocity)
        fast = next(sample for sample in samples if abs(sample.velocity) < 0.9 * top)
        slow = next(sample for sample in samples if abs(sample.velocity) < 0.3 * top)
        hard = (abs(fast.velocity) - abs(slow.velocity)) / (slow.time - fast.time)
        share = SHARES[name] if on_fault == "path" else 1.0
        assert hard == pytest.approx(share * ramp, rel=0.2)
        assert cell.hardest_change(name) < 1.3 * HARDEST
        assert cell.speed(name) == 0.0
        assert cell.stage(name) in ((*OFF, QUICK_STOP) if on_fault == "quick" else (ENABLED,))
    off_line = abs(cell.where("y") - 0.5 * cell.where("x"))
    assert off_line < 0.1 if on_fault == "path" else off_line > 0.5


def test_a_lost_node_stops_the_others_on_their_path(scenario):
    cell = opened(scenario)
    points = stream(cell)
    feed(cell, points, 0.75)
    cell.device("z").dials.dead = True
    with pytest.raises(NodeError):
        feed(cell, points, 2.0)
    cell.run(1.5)
    must_be_still(cell, "xy")
    assert cell.where("y") == pytest.approx(0.5 * cell.where("x"), abs=0.1)
