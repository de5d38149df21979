"""A drive with ip and without csp follows paths all the same: nothing jumps, and every way of stopping works as in csp."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest

from axisbus.errors import AxisbusError, ModeError
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.drive import Drive
from axisbus.sim.fault_injection import NEVER
from kit.cell import Cell, Stage
from kit.plant_probe import ENABLED, OFF
from kit.sim.interpolated import CSP, IP, PV, USUAL, write_eds

IP_MODE, BIT_4, HALT, PERIOD, SCALE = 7, 0x10, 0x100, 0.01, 100
JOLT = 1.1 * 500.0  # deg/s², the default acceleration


class Wire:
    """The values of a drive at each SYNC: stage, mode, controlword, 60C1h:01 and its demand."""

    def __init__(self, drive: Drive) -> None:
        self.seen: list[tuple[int, int, int, int, float]] = []
        self._drive, self._sync = drive, drive.sync
        drive.sync = self._noted  # type: ignore[method-assign]

    def _noted(self) -> None:
        drive = self._drive
        values = drive.mode_display, drive.controlword, drive.interpolation_target, drive.axis.position
        self.seen.append((int(drive.power.stage), *values))
        self._sync()


def made(scenario: Stage, names: str = "x", modes: int = USUAL, **changes: str) -> Cell:
    write_eds(scenario.folder, modes)
    axis = "rated_torque = 10.0\n" + changes.pop("axis", "")
    return scenario.simulated(names, eds="ip.eds", axis=axis, **changes)


def follow(cell: Cell, distance: float, velocity: float = 100.0, name: str = "x"):
    start = cell[name].position
    return cell[name].follow(TrapezoidalTrajectory(start, start + distance, velocity, 400.0))


def test_a_trajectory_is_followed_in_ip(scenario):
    cell = made(scenario)
    wire = Wire(cell.drive())
    cell.enabled()
    moment = cell.moment()
    follow(cell, 90.0).wait(5)
    assert cell.drive().mode_display == IP_MODE
    assert cell.where() == pytest.approx(90.0, abs=0.05)
    assert cell.hardest_change(since=moment) <= JOLT
    assert (cell.device().read(0x60C0), cell.device().read(0x60C2, 1)) == (0, 10)
    for stage, mode, word, target, place in wire.seen:
        if word & BIT_4 and mode == IP_MODE:
            assert stage == ENABLED
            assert abs(target - place) <= 100.0 * SCALE * PERIOD * 1.5  # never far away


def test_bit_4_is_not_set_before_there_is_a_target_at_the_axis_position(scenario):
    cell = made(scenario)
    wire = Wire(cell.drive())
    cell.enabled()
    cell.x.move_relative(33.0).wait(5)
    cell.run(0.2)
    before = len(wire.seen)
    follow(cell, 10.0).wait(5)
    first = next(
        n for n in range(before, len(wire.seen)) if wire.seen[n][1] == IP_MODE and wire.seen[n][2] & BIT_4
    )
    *_, target, place = wire.seen[first]
    assert abs(target - place) <= 2


def test_moves_in_pp_homing_and_ip_follow_each_other_without_a_jolt(scenario):
    """Bit 4 means another thing in pp and in homing: none of it is swallowed, and none is made up."""
    cell = made(scenario).enabled()
    moment = cell.moment()
    for _ in range(3):
        start = cell.where()
        follow(cell, 20.0).wait(5)
        cell.x.move_relative(7.0).wait(5)
        cell.x.home().wait(5)
        follow(cell, -4.0).wait(5)
        cell.x.move_velocity(30.0).wait(5)
        cell.x.halt().wait(5)
        assert cell.where() > start + 23.0
    assert cell.hardest_change(since=moment) <= JOLT


def test_a_move_takes_over_from_a_trajectory_without_a_jolt(scenario):
    cell = made(scenario).enabled()
    moment = cell.moment()
    follow(cell, 300.0)
    cell.run(1.0)
    cell.must_move()
    cell.x.move_velocity(40.0).wait(5)
    cell.run(0.5)
    assert cell.speed() == pytest.approx(40.0, abs=1.0)
    assert cell.hardest_change(since=moment) <= JOLT
    cell.x.move_relative(10.0).wait(5)


STOPS = {
    "halt": lambda cell: cell.x.halt(),
    "stop": lambda cell: cell.x.stop(),
    "quick stop": lambda cell: cell.x.quick_stop(),
    "disable": lambda cell: cell.x.disable(),
    "close": lambda cell: cell.machine.close(),
}


@pytest.mark.parametrize("how", STOPS)
def test_every_stop_holds(scenario, how):
    cell = made(scenario)
    wire = Wire(cell.drive())
    cell.enabled()
    follow(cell, 300.0)
    cell.run(1.0)
    moment = cell.moment()
    STOPS[how](cell)
    cell.must_be_still(within=1.0, stages=(ENABLED,) if how in ("halt", "stop") else OFF)
    assert cell.hardest_change(since=moment) <= 1.1 * 1000.0
    for stage, _, word, *_ in wire.seen[-20:]:
        assert stage == ENABLED or not word & BIT_4


def test_a_halt_is_continued_from(scenario):
    cell = made(scenario).enabled()
    follow(cell, 300.0)
    cell.run(1.0)
    cell.x.halt().wait(5)
    moment = cell.moment()
    follow(cell, 30.0).wait(5)
    assert cell.hardest_change(since=moment) <= JOLT


def test_a_fault_in_ip_and_the_recovery(scenario):
    cell = made(scenario).enabled()
    handle = follow(cell, 300.0)
    cell.run(1.0)
    cell.drive().fault(0x7500)
    assert isinstance(cell.failure_of(handle), AxisbusError)
    cell.must_be_still(within=3.0, stages=OFF)
    cell.x.reset().wait(5)
    cell.run(1.0)
    start = cell.where()
    cell.x.enable().wait(5)
    cell.run(0.3)
    assert cell.where() == pytest.approx(start, abs=0.1)
    follow(cell, 10.0).wait(5)


def test_a_drive_that_stops_interpolating_is_reported(scenario):
    cell = made(scenario).enabled()
    handle = follow(cell, 300.0)
    cell.run(1.0)
    drive = cell.drive()
    mode = drive._mode
    mode.sync = lambda _axis, _period: None  # it takes no set-point any more
    mode.bits = lambda _axis: 0  # and shows it
    assert isinstance(cell.failure_of(handle, 3.0), AxisbusError)
    cell.must_be_still(within=3.0, stages=(ENABLED, *OFF))


def test_a_drive_that_interpolates_late_is_waited_for(scenario):
    cell = made(scenario).enabled()
    cell.drive().dials.interpolation_delay = 0.3
    moment = cell.moment()
    follow(cell, 50.0).wait(5)
    assert cell.where() == pytest.approx(50.0, abs=0.05)
    assert cell.hardest_change(since=moment) <= JOLT


def test_a_drive_that_never_interpolates_is_reported_and_nothing_moves(scenario):
    cell = made(scenario).enabled()
    cell.drive().dials.interpolation_delay = NEVER
    moment = cell.moment()
    error = cell.failure_of(follow(cell, 50.0))
    assert isinstance(error, ModeError)
    assert "does not interpolate" in error.message
    assert cell.top_speed(since=moment) == 0.0


def test_a_group_moves_along_a_line_in_interpolated_position_mode(scenario):
    cell = made(scenario, "xy", more='[groups.xy]\naxes = ["x", "y"]\n').enabled()
    cell.machine.group("x", "y").move_linear((40.0, 20.0), velocity=60.0).wait(5)
    assert (cell.where("x"), cell.where("y")) == (
        pytest.approx(40.0, abs=0.05),
        pytest.approx(20.0, abs=0.05),
    )
    assert cell.drive("y").mode_display == IP_MODE


def test_with_feed_forward(scenario):
    cell = made(scenario, more="[axes.x.feed_forward]\nvelocity = true\n").enabled()
    follow(cell, 90.0)
    cell.run(0.6)
    assert cell.drive().velocity_offset == pytest.approx(10_000, abs=100)


def test_a_jerk_limited_velocity_works_in_ip_and_is_reported_while_a_move_takes_over(scenario):
    write_eds(scenario.folder, USUAL)
    file = scenario.folder / "ip.eds"
    file.write_text(file.read_text("utf-8").replace("60A4", "67A4"), "utf-8")  # it has no profile jerk
    more = "rated_torque = 10.0\n", "[axes.x.feed_forward]\nvelocity = true\n"
    cell = scenario.simulated("x", eds="ip.eds", axis=more[0], more=more[1]).enabled()
    moment, told = cell.moment(), []
    cell.x.move_velocity(90.0, jerk=3000.0)
    cell.run(0.28)
    assert cell.drive().mode_display == IP_MODE
    cell.each_cycle(lambda *_: told.append(cell.drive().velocity_offset / SCALE))
    cell.x.move_absolute(60.0, jerk=3000.0)
    cell.run(0.3)
    assert max(abs(b - a) for a, b in pairwise(told)) <= 500.0 * PERIOD * 1.1
    assert max(told) > 50.0
    cell.run(2.0)
    assert cell.where() == pytest.approx(60.0, abs=0.05)
    assert cell.hardest_change(since=moment) <= JOLT


@pytest.mark.parametrize(
    ("modes", "named", "expected"),
    [
        (USUAL, "", 7),
        (USUAL | CSP, "", 8),
        (USUAL | CSP, 'modes = ["pp", "ip"]', 7),
        (USUAL, 'modes = ["pp", "csp"]', 7),
        (USUAL & ~IP | CSP, "", 8),
    ],
)
def test_the_interpolating_mode_is_selected_from_6502h_and_the_cell_file(scenario, modes, named, expected):
    cell = made(scenario, modes=modes, axis=named).enabled()
    follow(cell, 10.0).wait(5)
    assert cell.drive().mode_display == expected


def test_a_drive_that_can_do_nothing_else_is_enabled_in_it(scenario):
    cell = made(scenario, modes=IP | PV, axis='modes = ["ip"]')
    cell.enabled()
    cell.run(0.5)
    assert cell.stage() == ENABLED
    moment = cell.moment()
    follow(cell, 20.0).wait(5)
    assert cell.where() == pytest.approx(20.0, abs=0.05)
    assert cell.hardest_change(since=moment) <= JOLT


@pytest.mark.parametrize("seed", range(6))
def test_random_plays_never_jolt(scenario, seed):
    rng = random.Random(seed)
    cell = made(scenario)
    wire = Wire(cell.drive())
    cell.enabled()
    plays = (
        lambda: cell.x.enable(),
        lambda: follow(cell, rng.uniform(-80, 80)),
        lambda: follow(cell, rng.uniform(-80, 80)),
        lambda: cell.x.move_relative(rng.uniform(-60, 60)),
        lambda: cell.x.move_relative(rng.uniform(-60, 60), jerk=3000.0),
        lambda: cell.x.move_velocity(rng.uniform(-90, 90)),
        lambda: cell.x.move_velocity(rng.uniform(-90, 90), jerk=3000.0),
        lambda: cell.x.move_relative(rng.uniform(-60, 60), jerk=3000.0, buffer="blending_next"),
        lambda: cell.x.move_superimposed(rng.uniform(-5, 5)),
        lambda: cell.x.set_override(rng.choice([0.0, 0.5, 1.0, 1.3])),
        lambda: cell.x.halt(),
        lambda: cell.x.stop(),
        lambda: cell.x.release(),
        lambda: cell.x.home(),
        lambda: cell.x.disable(),
        lambda: cell.x.reset(),
    )
    moment = cell.moment()
    for _ in range(60):
        handle = rng.choice(plays)()
        cell.run(rng.choice([0.02, 0.05, 0.1, 0.4, 1.0]))
        if not handle.busy:
            handle.exception()
    assert cell.hardest_change(since=moment) <= 1.1 * 1000.0
    assert cell.x.state is not AxisState.ERRORSTOP
    for before, now in pairwise(wire.seen):
        if now[1] == IP_MODE and now[2] & BIT_4 and not before[2] & BIT_4:
            assert abs(now[3] - now[4]) <= 100.0 * SCALE * PERIOD * 1.5, (before, now)
    cell.machine.close()
    cell.run(0.3)
    assert cell.stage() in OFF
