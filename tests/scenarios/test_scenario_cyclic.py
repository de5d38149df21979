"""Velocity and torque in each cycle (csv, cst): the ramps are the master's, and every way of stopping holds as elsewhere."""

from __future__ import annotations

from itertools import pairwise

import pytest

from axisbus.errors import (
    ArgumentError,
    AxisbusError,
    FollowingError,
    LimitError,
    MotionTimeout,
    Replaced,
    StateError,
)
from axisbus.motion.states import AxisState
from kit.cell import Cell
from kit.plant_probe import ENABLED, FAULT, OFF, QUICK_STOP
from kit.plants import PLANTS, cell_on

CSV, CST = 9, 10
RATED = "rated_torque = 10.0\n"
RAMP = 500.0  # deg/s², the default
JOLT = 1.05 * RAMP


def turning(scenario, velocity: float = 100.0, **changes) -> Cell:
    """A cell whose axis moves at a velocity."""
    cell = scenario.simulated("x", **changes).enabled()
    cell.x.cyclic_velocity(velocity).wait(5)
    cell.must_move()
    return cell


def pushing(scenario, torque: float = 0.25, **changes: str) -> Cell:
    """A cell whose axis is pushed by a torque, and has got to some speed by that."""
    axis = RATED + changes.pop("axis", "")
    cell = scenario.simulated("x", axis=axis, **changes).enabled()
    cell.x.cyclic_torque(torque, slope=5.0).wait(5)
    cell.until(lambda: cell.speed() > 30.0)
    return cell


# -- velocity: the ramp --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", [100.0, -100.0, 7.0])
def test_the_drive_gets_the_ramp_and_the_handle_is_done_in_velocity(scenario, velocity):
    cell = scenario.simulated("x").enabled()
    moment = cell.moment()
    handle = cell.x.cyclic_velocity(velocity)
    handle.wait(5)
    assert cell.drive().mode_display == CSV
    assert cell.sample().velocity == pytest.approx(velocity, rel=0.01)
    assert cell.hardest_change(since=moment) <= JOLT
    assert cell.x.state is AxisState.CONTINUOUS_MOTION
    cell.run(1.0)  # it continues
    assert cell.sample().velocity == pytest.approx(velocity, rel=0.01)
    assert cell.drive().target_velocity == round(velocity * 100)


def test_a_cyclic_velocity_has_the_ramps_of_the_call(scenario):
    cell = scenario.simulated("x").enabled()
    cell.x.cyclic_velocity(200.0, acceleration=100.0, deceleration=400.0)
    cell.until(lambda: cell.speed() > 50.0)
    cell.run(1.0)
    assert cell.speed() == pytest.approx(150.0, abs=5.0)
    cell.x.cyclic_velocity(0.0, acceleration=100.0, deceleration=400.0).wait(5)
    moment = cell.moment()
    cell.x.cyclic_velocity(40.0, acceleration=100.0, deceleration=400.0).wait(5)
    assert cell.hardest_change(since=moment) <= 105.0


def test_another_cyclic_velocity_continues_from_the_present_one(scenario):
    cell = turning(scenario)
    moment = cell.moment()
    first = cell.x.cyclic_velocity(300.0)
    cell.run(0.2)
    second = cell.x.cyclic_velocity(-50.0)  # in the middle of the ramp, and in the other direction
    second.wait(5)
    assert isinstance(first.exception(), Replaced)
    assert cell.sample().velocity == pytest.approx(-50.0, rel=0.01)
    assert cell.hardest_change(since=moment) <= JOLT
    assert cell.drive().mode_display == CSV


def test_a_velocity_given_in_every_cycle_still_lets_a_jam_be_detected(scenario):
    cell = scenario.simulated("x").enabled()
    moment = cell.moment()
    for number in range(200):
        cell.x.cyclic_velocity(100.0 + 0.2 * number)
        cell.run(0.01)
    assert cell.speed() == pytest.approx(139.0, abs=5.0)
    assert cell.hardest_change(since=moment) <= JOLT
    cell.jam()
    for _ in range(100):
        if cell.x.state is AxisState.ERRORSTOP:
            break
        cell.x.cyclic_velocity(140.0)
        cell.run(0.01)
    assert isinstance(cell.x.error, FollowingError)
    cell.must_be_still(within=2.0, stages=OFF)


@pytest.mark.parametrize("pause", [0.0, 0.01, 0.02, 0.05, 0.1])
def test_a_velocity_commanded_before_the_mode_has_changed_replaces_the_first(scenario, pause):
    cell = scenario.simulated("x").enabled()
    cell.drive().dials.mode_delay = 0.2
    cell.device().write(0x60B1, 0, 5000)
    first = cell.x.cyclic_velocity(100.0)
    cell.run(pause)
    cell.x.cyclic_velocity(30.0).wait(5)
    assert isinstance(first.exception(), Replaced)
    cell.run(0.5)
    assert (
        cell.top_speed() < 31.0
    )  # the first transfers were not left out: no offset, and no jump of the first velocity
    assert cell.device().read(0x60C2, 1) == 10


def test_a_velocity_may_be_given_in_every_cycle_from_the_first_on(scenario):
    cell = scenario.simulated("x").enabled()
    cell.device().write(0x60B1, 0, 5000)
    cell.drive().dials.mode_delay = 0.05
    for _ in range(60):
        cell.x.cyclic_velocity(50.0)
        cell.run(0.01)
    assert cell.speed() == pytest.approx(50.0, rel=0.01)
    assert cell.top_speed() < 51.0


def test_no_motion_before_the_mode_is_displayed_and_offsets_of_another_program_are_cleared(scenario):
    cell = scenario.simulated("x").enabled()
    cell.device().write(0x60B1, 0, 5000)
    cell.drive().dials.mode_delay = 0.3
    cell.x.cyclic_velocity(20.0)
    cell.run(0.25)
    assert cell.top_speed() == 0.0
    cell.run(1.0)
    assert cell.top_speed() < 21.0


# -- velocity: commands that take over -----------------------------------------------------------------------------------


@pytest.mark.parametrize("hears_halt", [True, False], ids=["obeys halt", "ignores halt"])
@pytest.mark.parametrize("how", ["halt", "stop", "disable"])
def test_a_halt_ramps_the_velocity_down(scenario, how, hears_halt):
    cell = turning(scenario)
    cell.drive().dials.halt_in_cyclic_modes = hears_halt
    start, moment = cell.where(), cell.moment()
    getattr(cell.x, how)().wait(5)
    cell.must_be_still(within=0.1, stages=OFF if how == "disable" else ENABLED)
    cell.must_have_moved("x", start, (10.0, 13.0))
    assert cell.hardest_change(since=moment) <= JOLT


def test_a_halt_brakes_with_the_deceleration_of_the_call(scenario):
    cell = scenario.simulated("x").enabled()
    cell.x.cyclic_velocity(100.0, deceleration=200.0).wait(5)
    start = cell.where()
    cell.x.halt().wait(5)
    cell.must_have_moved("x", start, (25.0, 29.0))


def test_a_halt_may_be_interrupted_and_the_axis_continues_from_its_velocity(scenario):
    cell = turning(scenario)
    moment = cell.moment()
    halt = cell.x.halt()
    cell.run(0.1)
    assert 20.0 < cell.speed() < 80.0
    cell.x.cyclic_velocity(90.0).wait(5)
    assert halt.aborted
    assert min(cell.speeds(since=moment)) > 20.0
    assert cell.hardest_change(since=moment) <= JOLT


def test_a_halt_may_be_interrupted_at_its_very_end(scenario):
    cell = turning(scenario)
    cell.x.halt()
    cell.until(lambda: cell.speed() == 0.0)
    cell.x.cyclic_velocity(50.0).wait(5)
    assert cell.speed() == pytest.approx(50.0, rel=0.01)


@pytest.mark.parametrize("mode_delay", [0.0, 0.03, 0.12])
@pytest.mark.parametrize(
    "command",
    [
        lambda x: x.move_velocity(-60.0),
        lambda x: x.move_velocity(150.0),
        lambda x: x.move_relative(200.0),
        lambda x: x.jog(50.0),
    ],
    ids=["reversed", "faster", "to a position", "jog"],
)
def test_a_move_in_another_mode_takes_over_without_a_jolt(scenario, command, mode_delay):
    cell = turning(scenario)
    cell.drive().dials.mode_delay = mode_delay
    moment = cell.moment()
    handle = command(cell.x)
    cell.run(3.0)
    assert cell.hardest_change(since=moment) <= 1.6 * RAMP
    if handle.name.startswith("x.jog"):
        assert cell.speed() == 0.0
    else:
        assert handle.exception() is None


def test_a_halt_during_a_mode_change_ramps_down(scenario):
    cell = turning(scenario)
    cell.drive().dials.mode_delay = 0.2
    moment = cell.moment()
    cell.x.move_velocity(150.0)
    cell.run(0.05)
    cell.x.halt().wait(5)
    cell.must_be_still(within=0.1, stages=ENABLED)
    assert cell.hardest_change(since=moment) <= 1.6 * RAMP


def test_a_drive_that_does_not_take_the_next_mode_is_ramped_down(scenario):
    cell = turning(scenario)
    cell.drive().dials.modes_refused = frozenset({1})
    moment = cell.moment()
    cell.failure_of(cell.x.move_relative(500.0))
    cell.must_be_still(within=2.0, stages=(ENABLED, QUICK_STOP, *OFF))
    assert cell.hardest_change(since=moment) <= 1.6 * RAMP


@pytest.mark.parametrize("command", ["follow", "home", "torque"])
def test_a_command_that_needs_standstill_is_refused_and_the_axis_continues(scenario, command):
    cell = turning(scenario, axis=RATED)
    here = cell.x.position
    give = {
        "follow": lambda: cell.x.follow(lambda t: here + t, duration=1.0),
        "home": lambda: cell.x.home(),
        "torque": lambda: cell.x.cyclic_torque(0.1, slope=1.0),
    }[command]
    assert isinstance(cell.failure_of(give()), StateError)
    cell.run(0.2)
    assert cell.speed() == pytest.approx(100.0, rel=0.01)


def test_cyclic_commands_are_refused_during_another_move(scenario):
    cell = scenario.simulated("x", axis=RATED)
    cell.turning(90.0)
    for handle in (cell.x.cyclic_velocity(10.0), cell.x.cyclic_torque(0.1, slope=1.0)):
        assert "halt it first" in str(cell.failure_of(handle))
    cell.must_move()


def test_after_a_halt_the_axis_takes_a_trajectory_and_a_move(scenario):
    cell = turning(scenario)
    cell.x.halt().wait(5)
    here = cell.x.position
    cell.x.follow(lambda t: here + 5.0 * t * t * (1.5 - t), duration=1.0).wait(5)
    cell.x.move_relative(10.0).wait(5)
    cell.x.cyclic_velocity(20.0).wait(5)
    assert cell.speed() == pytest.approx(20.0, rel=0.01)


# -- velocity: stops -----------------------------------------------------------------------------------------------------


def test_a_jammed_axis_is_stopped_and_does_not_leap_when_it_is_released(scenario):
    cell = turning(scenario)
    cell.jam()
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 2.0)
    assert isinstance(cell.x.error, FollowingError)
    cell.until(lambda: cell.stage() in OFF, 3.0)
    moment = cell.free()
    cell.run(1.0)
    cell.must_not_leap(since=moment)


def test_an_axis_that_is_blocked_from_the_beginning_is_stopped(scenario):
    cell = scenario.simulated("x").enabled()
    cell.jam()
    error = cell.failure_of(cell.x.cyclic_velocity(100.0))
    assert isinstance(error, FollowingError)
    cell.until(lambda: cell.stage() in OFF, 3.0)


def test_an_axis_that_its_load_overhauls_is_stopped(scenario):
    cell = turning(scenario)
    motor = cell.drive().axis.motor
    motor.params = type(motor.params)(**{**vars_of(motor.params), "load": -20000.0})
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 3.0)
    assert cell.x.error is not None


def vars_of(params) -> dict[str, object]:
    return {name: getattr(params, name) for name in params.__dataclass_fields__}


def lose_the_targets(cell: Cell) -> None:
    """The RPDO of velocity and torque does not arrive any more."""
    (pdo,) = (pdo for pdo in cell.port().plan.active if "target_velocity" in pdo.values)
    cell.faults.lose(pdo.target.cob_id)


def test_a_lost_target_pdo_is_found_while_the_velocity_changes(scenario):
    cell = turning(scenario)
    lose_the_targets(cell)
    error = cell.failure_of(cell.x.cyclic_velocity(0.0))
    assert isinstance(error, FollowingError | MotionTimeout)
    cell.must_be_still(within=4.0, stages=OFF)


def test_a_halt_whose_targets_are_lost_ends_in_a_harder_stop(scenario):
    cell = turning(scenario)
    lose_the_targets(cell)
    halt = cell.x.halt()
    assert "harder stop" in str(cell.failure_of(halt))
    cell.must_be_still(within=1.0, stages=OFF)


def test_a_node_that_dies_in_csv_is_reported_and_the_scan_survives(scenario):
    cell = turning(scenario)
    cell.device().dials.dead = True
    cell.run(5.0)
    assert cell.x.error is not None
    assert cell.scan_runs


def test_a_fault_of_another_axis_ramps_it_down(scenario):
    cell = scenario.simulated("xy").enabled()
    cell["x"].cyclic_velocity(100.0).wait(5)
    start, moment = cell.where("x"), cell.moment("x")
    cell.drive("y").fault(0x2310)
    cell.must_be_still("x", within=1.0, stages=ENABLED)
    cell.must_have_moved("x", start, (10.0, 16.0))
    assert cell.hardest_change("x", since=moment) <= JOLT


def test_a_fault_of_its_drive_stops_a_cyclic_velocity(scenario):
    cell = turning(scenario)
    cell.drive().fault(0x2310)
    cell.must_be_still(within=1.0, stages=FAULT)
    assert cell.x.state is AxisState.ERRORSTOP


def test_ctrl_c_ramps_a_cyclic_velocity_down_and_disables_the_drive(scenario):
    cell = turning(scenario)
    moment = cell.moment()
    assert cell.ctrl_c(10.0) == []
    cell.must_be_still(within=0.1, stages=OFF)
    assert cell.hardest_change(since=moment) <= JOLT


def test_an_exception_ramps_it_down(scenario):
    cell = turning(scenario)
    moment = cell.moment()
    with pytest.raises(ZeroDivisionError), cell.machine:
        _ = 1 / 0
    assert cell.speed() == 0.0
    assert cell.stage() in OFF
    assert cell.hardest_change(since=moment) <= JOLT


def test_a_quick_stop_is_the_drives_own(scenario):
    cell = turning(scenario)
    start = cell.where()
    cell.x.quick_stop().wait(5)
    cell.must_be_still(within=0.1, stages=OFF)
    cell.must_have_moved("x", start, (5.0, 8.0))  # 1000 deg/s²


@pytest.mark.parametrize("seconds", [0.4, 2.0])
def test_a_program_that_did_not_run_for_a_while_ramps_the_axis_down(scenario, seconds):
    cell = turning(scenario)
    moment = cell.moment()
    cell.faults.stall(seconds)
    cell.run(0.05)
    cell.must_be_still(within=3.0, stages=(ENABLED, *OFF))
    assert cell.hardest_change(since=moment) <= 2.2 * RAMP  # at worst the drive's own quick stop


def test_a_drive_that_leaves_the_commanded_mode_is_stopped(scenario):
    cell = turning(scenario)
    cell.drive().dials.spontaneous_mode = 1
    cell.must_be_still(within=2.0, stages=OFF)
    assert "left mode 9 (csv)" in str(cell.x.error)


def test_a_tpdo_that_stops_stops_the_axis(scenario):
    cell = turning(scenario, axis="position_limits = [-3000.0, 3000.0]", port={"apart": ("position",)})
    cell.device().dials.tpdos_stop = frozenset({2})
    cell.must_be_still(within=4.0, stages=(ENABLED, *OFF))
    assert cell.x.state is AxisState.ERRORSTOP


def test_a_mode_display_that_is_lost_while_it_brakes_is_no_jolt(scenario):
    cell = turning(scenario, port={"apart": ("mode",)})
    moment = cell.moment()
    cell.device().dials.tpdos_stop = frozenset({2})
    halt = cell.x.halt()
    cell.must_be_still(within=3.0, stages=(ENABLED, *OFF))
    cell.end_of(halt)
    assert cell.hardest_change(since=moment) <= 2.2 * RAMP


@pytest.mark.parametrize("holds", ["false", '"brake"', '"torque"'])
@pytest.mark.parametrize("velocity", [60.0, -60.0])
def test_a_load_is_held_before_during_and_after(scenario, holds, velocity):
    cell = cell_on(scenario, PLANTS["sagging"], axis=f"holds_load = {holds}", stop='quick_stop = "ramp-hold"')
    moment = cell.moment()
    cell.x.cyclic_velocity(velocity).wait(5)
    cell.run(0.5)
    cell.x.halt().wait(5)
    cell.must_be_still(within=0.1, stages=ENABLED)
    assert cell.hardest_change(since=moment) <= JOLT
    low, high = cell.farthest(since=moment)
    assert high - low == pytest.approx(abs(cell.where() - cell.positions(since=moment)[0]), abs=0.1)


# -- velocity: limits ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("speed", [60.0, 250.0, 400.0])
def test_a_cyclic_velocity_ends_at_standstill_within_the_position_limits(scenario, speed, direction):
    cell = scenario.simulated("x", axis="position_limits = [-300.0, 300.0]").enabled()
    cell.x.cyclic_velocity(direction * speed)
    cell.must_move(faster_than=-1.0)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 10.0)
    cell.must_be_still(within=2.0, stages=ENABLED)
    assert isinstance(cell.x.error, LimitError)
    low, high = cell.farthest()
    assert low >= -300.0
    assert high <= 300.0
    assert max(-low, high) > 280.0
    cell.x.reset().wait(2)
    cell.x.cyclic_velocity(-direction * 50.0).wait(3)  # back is allowed


def test_a_weaker_deceleration_near_the_limit_is_refused_and_the_axis_continues(scenario):
    cell = scenario.simulated("x", axis="position_limits = [-300.0, 300.0]").enabled()
    cell.x.cyclic_velocity(200.0).wait(5)
    cell.until(lambda: cell.where() > 220.0)
    error = cell.failure_of(cell.x.cyclic_velocity(190.0, deceleration=50.0))
    assert isinstance(error, LimitError)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 10.0)
    cell.must_be_still(within=2.0, stages=ENABLED)
    assert cell.farthest()[1] <= 300.0


def test_limits_of_the_axis_hold_at_the_call(scenario):
    cell = scenario.simulated("x", axis="max_acceleration = 600.0").enabled()
    with pytest.raises(LimitError):
        cell.x.cyclic_velocity(400.1)
    with pytest.raises(LimitError):
        cell.x.cyclic_velocity(10.0, acceleration=601.0)
    for wrong in (float("nan"), float("inf"), "fast"):
        with pytest.raises(ArgumentError):
            cell.x.cyclic_velocity(wrong)
    with pytest.raises(ArgumentError):
        cell.x.cyclic_velocity(10.0, deceleration=0.0)


def test_a_drive_that_is_faster_than_max_velocity_is_stopped(scenario):
    cell = turning(scenario, velocity=390.0)
    cell.device().write(0x60B1, 0, 10000)  # another tool's velocity offset
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 3.0)
    assert "max_velocity" in str(cell.x.error)


# -- torque --------------------------------------------------------------------------------------------------------------


def test_the_drive_gets_the_slope_and_the_handle_is_done_in_torque(scenario):
    cell = scenario.simulated("x", axis=RATED + "max_torque = 5.0").enabled()
    sent = sent_torques(cell)
    cell.x.cyclic_torque(0.3, slope=1.0).wait(5)
    assert cell.drive().mode_display == CST
    assert cell.torque() == pytest.approx(30.0, abs=1.0)
    assert max(abs(after - before) for before, after in pairwise(sent)) <= 1  # 100 ‰ per s, in 10 ms
    cell.x.cyclic_torque(-0.3, slope=5.0).wait(5)
    cell.run(0.05)
    assert cell.torque() == pytest.approx(-30.0, abs=1.0)
    assert max(abs(after - before) for before, after in pairwise(sent)) <= 5
    with pytest.raises(LimitError):
        cell.x.cyclic_torque(5.1, slope=1.0)
    with pytest.raises(ArgumentError):
        cell.x.cyclic_torque(1.0, slope=0.0)


def sent_torques(cell: Cell) -> list[int]:
    """The values of 6071h in each cycle from now on."""
    values: list[int] = []
    cell.each_cycle(lambda *_: values.append(cell.drive().target_torque))
    return values


def test_a_cyclic_torque_without_rated_torque_is_refused_at_the_call(scenario):
    with pytest.raises(ArgumentError, match="rated_torque"):
        scenario.simulated("x").enabled().x.cyclic_torque(0.1, slope=1.0)


@pytest.mark.parametrize("how", ["halt", "stop", "disable", "quick_stop"])
def test_every_stop_of_a_pushed_axis_ends_at_standstill(scenario, how):
    cell = pushing(scenario)
    cell.end_of(getattr(cell.x, how)())
    cell.must_be_still(within=1.0, stages=(ENABLED, *OFF))


@pytest.mark.parametrize("holds", ["brake", "torque"])
def test_a_load_does_not_fall_when_its_axis_is_halted(scenario, holds):
    cell = cell_on(
        scenario, PLANTS["sagging"], axis=f'holds_load = "{holds}"', stop='quick_stop = "ramp-hold"'
    )
    start, moment = cell.where(), cell.moment()
    cell.x.cyclic_torque(3.0, slope=5.0).wait(5)  # the torque that holds it
    cell.must_not_leap(since=moment, way=2.0)
    cell.x.cyclic_torque(3.3, slope=5.0)
    cell.until(lambda: cell.speed() > 10.0, 5.0)
    halted = cell.moment()
    cell.x.halt().wait(5)
    cell.must_be_still(within=1.0, stages=ENABLED)
    assert cell.farthest(since=halted)[0] >= start - 2.0
    assert cell.drive().mode_display != CST


def test_a_cyclic_torque_ends_at_standstill_within_the_position_limits(scenario):
    cell = pushing(scenario, 0.3, axis="position_limits = [-300.0, 300.0]\n")
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 10.0)
    cell.must_be_still(within=3.0, stages=(ENABLED, *OFF))
    assert cell.farthest()[1] <= 300.0


def test_a_pushed_axis_does_not_get_faster_than_it_may(scenario):
    cell = pushing(scenario, 1.5)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 10.0)
    assert "max_velocity" in str(cell.x.error)
    cell.must_be_still(within=3.0, stages=(ENABLED, *OFF))
    assert cell.top_speed() <= 440.0


def test_a_torque_that_the_drive_does_not_give_is_reported(scenario):
    cell = scenario.simulated("x", axis=RATED).enabled()
    cell.device().write(0x6072, 0, 20)
    cell.jam()
    error = cell.failure_of(cell.x.cyclic_torque(1.0, slope=10.0, timeout=0.6))
    assert isinstance(error, MotionTimeout)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)


@pytest.mark.parametrize("happens", ["fault", "dead", "ctrl-c", "exception"])
def test_a_fault_a_dead_node_and_each_end_of_the_program_stop_a_cyclic_torque(scenario, happens):
    cell = pushing(scenario)
    if happens == "fault":
        cell.drive().fault(0x2310)
    elif happens == "dead":
        cell.device().dials.dead = True
        cell.run(5.0)
        assert cell.x.error is not None
        return
    elif happens == "ctrl-c":
        cell.ctrl_c(10.0)
    else:
        with pytest.raises(ZeroDivisionError), cell.machine:
            _ = 1 / 0
    cell.must_be_still(within=3.0, stages=OFF)


@pytest.mark.parametrize("command", ["move_velocity", "move_relative"])
def test_a_move_takes_over_from_a_torque(scenario, command):
    cell = pushing(scenario)
    moment = cell.moment()
    getattr(cell.x, command)(60.0).wait(8)
    assert cell.hardest_change(since=moment) <= 1.6 * RAMP


# -- requirements --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "lacks", "names"),
    [
        ("csv", {"outputs": {"target_velocity": "SDO"}}, "60FFh"),
        ("csv", {"inputs": {"velocity": "EVENT_PDO"}}, "606Ch"),
        ("csv", {"inputs": {"position": "EVENT_PDO"}}, "6064h"),
        ("cst", {"outputs": {"target_torque": "EVENT_PDO"}}, "6071h"),
        ("cst", {"inputs": {"torque": "NONE"}}, "6077h"),
    ],
)
def test_values_must_travel_with_sync(scenario, mode, lacks, names):
    from axisbus.cia402.port import ValueTransport

    port = {
        side: {name: ValueTransport[source] for name, source in values.items()}
        for side, values in lacks.items()
    }
    cell = scenario.simulated("x", axis=RATED, port=port).enabled()
    handle = cell.x.cyclic_velocity(10.0) if mode == "csv" else cell.x.cyclic_torque(0.1, slope=1.0)
    error = cell.failure_of(handle)
    assert isinstance(error, StateError)
    assert names in error.message
    assert next(iter(next(iter(lacks.values())))) in error.observed
    assert cell.top_speed() == 0.0


def test_the_error_names_the_mode_that_a_drive_lacks(scenario):
    cell = scenario.simulated("x", axis=RATED + 'modes = ["pp", "pv"]').enabled()
    for handle, name in (
        (cell.x.cyclic_velocity(10.0), "csv"),
        (cell.x.cyclic_torque(0.1, slope=1.0), "cst"),
    ):
        error = cell.failure_of(handle)
        assert isinstance(error, StateError)
        assert name in error.message


def test_a_drive_that_does_not_take_the_mode_does_not_move(scenario):
    cell = scenario.simulated("x").enabled()
    cell.drive().dials.modes_refused = frozenset({CSV})
    error = cell.failure_of(cell.x.cyclic_velocity(10.0))
    assert isinstance(error, AxisbusError)
    assert "mode 9 (csv)" in error.message
    assert cell.top_speed() == 0.0
