"""Invalid arguments are refused at the call, by name and with the limit, and nothing is sent to the drive."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from unittest.mock import patch

import pytest

from axisbus.errors import ArgumentError, AxisbusError, CommandError, LimitError
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.cell import SCALE

LIMITED = "position_limits = [-90.0, 90.0]\nmax_torque = 2.0\nrated_torque = 5.0\nmax_acceleration = 3000.0"

NAN, INF = math.nan, math.inf
HUGE = 2**31 / SCALE  # degrees: one increment more than INTEGER32 holds

# Name of the golden message: the call that must be refused.
REFUSED = {
    "position_beyond_limits": lambda x: x.move_absolute(90.1),
    "position_nan": lambda x: x.move_absolute(NAN),
    "position_infinite": lambda x: x.move_absolute(-INF),
    "position_no_number": lambda x: x.move_absolute("90"),
    "position_missing": lambda x: x.move_absolute(None),
    "distance_nan": lambda x: x.move_relative(NAN),
    "distance_overflow": lambda x: x.move_relative(HUGE),
    "additive_infinite": lambda x: x.move_additive(INF),
    "velocity_above_max": lambda x: x.move_absolute(1.0, velocity=400.1),
    "velocity_zero": lambda x: x.move_absolute(1.0, velocity=0.0),
    "velocity_negative": lambda x: x.move_absolute(1.0, velocity=-5.0),
    "velocity_nan": lambda x: x.move_velocity(NAN),
    "turning_above_max": lambda x: x.move_velocity(-400.1),
    "jog_above_max": lambda x: x.jog(1000.0),
    "acceleration_above_max": lambda x: x.move_absolute(1.0, acceleration=3001.0),
    "deceleration_infinite": lambda x: x.move_absolute(1.0, deceleration=INF),
    "timeout_nan": lambda x: x.move_absolute(1.0, timeout=NAN),
    "timeout_zero": lambda x: x.move_velocity(1.0, timeout=0.0),
    "torque_above_max": lambda x: x.torque_control(2.1),
    "torque_nan": lambda x: x.torque_control(NAN),
    "slope_nan": lambda x: x.torque_control(1.0, slope=NAN),
    "torque_timeout_negative": lambda x: x.torque_control(1.0, timeout=-1.0),
    "homing_method_overflow": lambda x: x.home(200),
    "homing_without_speeds": lambda x: x.home(17),
    "homing_timeout_nan": lambda x: x.home(35, timeout=NAN),
    "set_position_infinite": lambda x: x.set_position(INF),
    "follow_without_end": lambda x: x.follow(Endless()),
    "position_beyond_every_float": lambda x: x.move_relative(10**400),
    "position_yes": lambda x: x.move_absolute(True),
    "distance_huge": lambda x: x.move_relative(1e300),
    "set_position_overflow": lambda x: x.set_position(HUGE),
    "set_position_huge": lambda x: x.set_position(1e306),
    "homing_method_half": lambda x: x.home(17.5),
}


class Endless:
    """A trajectory that never ends."""

    duration = INF

    def position(self, t: float) -> float:
        return 0.0


def sends_nothing(cell, call) -> Exception:
    """Return the exception that ``call`` raises; the port must get the same outputs before and after it."""
    cell.run(0.2)
    given = []
    write = cell.port().write

    def watched(outputs):
        given.append(outputs)
        write(outputs)

    with patch.object(cell.port(), "write", watched):
        cell.run(0.05)
        before = given[-1]
        with pytest.raises(Exception) as caught:  # which one is for the scenario to say
            call()
        cell.run(0.2)
    assert len(given) > 20
    assert set(given) == {before}
    return caught.value


@pytest.mark.parametrize("name", REFUSED)
def test_an_invalid_value_is_refused_at_the_call(scenario, golden, name):
    cell = scenario.simulated("x", axis=LIMITED).enabled()
    error = sends_nothing(cell, lambda: REFUSED[name](cell.x))
    assert isinstance(error, ArgumentError)
    assert isinstance(error, ValueError)
    assert str(error).startswith("x.")
    golden(f"argument_{name}", error)


def test_an_absolute_target_that_int32_cannot_hold_is_refused(scenario, golden):
    cell = scenario.simulated("x").enabled()
    error = sends_nothing(cell, lambda: cell.x.move_absolute(HUGE))
    assert isinstance(error, LimitError)
    golden("argument_target_overflow", error)


def test_a_velocity_that_unsigned32_cannot_hold_is_refused(scenario, golden):
    text = scenario_text(scenario, max_velocity=1e9)
    cell = scenario.simulated(text=text).enabled()
    golden("argument_velocity_overflow", sends_nothing(cell, lambda: cell.x.move_absolute(1.0, velocity=5e7)))


def test_a_torque_that_int16_cannot_hold_is_refused(scenario, golden):
    cell = scenario.simulated(
        "x", axis="rated_torque = 0.01", more='[axes.x.objects]\n"6072" = 0\n'
    ).enabled()
    golden("argument_torque_overflow", sends_nothing(cell, lambda: cell.x.torque_control(1.0)))


def test_torque_without_a_rated_torque_is_refused(scenario, golden):
    cell = scenario.simulated("x").enabled()
    golden("argument_no_rated_torque", sends_nothing(cell, lambda: cell.x.torque_control(1.0)))


def test_a_missing_default_is_never_guessed(scenario, golden):
    text = scenario_text(scenario).replace("velocity = 100.0\n", "", 1)
    cell = scenario.simulated(text=text).enabled()
    golden("argument_missing_default", sends_nothing(cell, lambda: cell.x.move_absolute(1.0)))


def test_an_absolute_move_waits_for_homing_if_the_cell_file_promises_a_position_by_its_limits(
    scenario, golden
):
    text = scenario_text(scenario, axis=LIMITED).replace("required = false", "required = true")
    cell = scenario.simulated(text=text).enabled()
    golden("argument_not_homed", sends_nothing(cell, lambda: cell.x.move_absolute(1.0)))
    golden(
        "argument_not_homed_follow",
        sends_nothing(cell, lambda: cell.x.follow(TrapezoidalTrajectory(0, 1, 1, 1))),
    )
    cell.x.home().wait(3)
    cell.x.move_absolute(1.0).wait(3)


def test_a_relative_move_beyond_the_limits_ends_its_handle_and_moves_nothing(scenario, golden):
    cell = scenario.simulated("x", axis=LIMITED).enabled()
    cell.x.move_absolute(80.0).wait(5)
    cell.run(0.3)
    failed = cell.failure_of(cell.x.move_relative(10.1))
    assert isinstance(failed, LimitError)
    golden("relative_beyond_limits", failed)
    cell.run(0.3)
    assert abs(cell.where() - 80.0) < 0.05
    cell.x.move_relative(9.9).wait(5)  # the axis is not in ErrorStop for that


class Odd(float):
    """A number of a kind of its own, as numpy has them."""


ABSURD = {
    "huge": 1e300,
    "the largest": 1.7976931348623157e308,
    "the smallest": 5e-324,
    "negative and huge": -1e306,
    "beyond every float": 10**400,
    "of five thousand digits": 10**5000,
    "a fraction": Fraction(1, 3),
    "a fraction beyond every float": Fraction(10**400, 3),
    "a decimal": Decimal("0.5"),
    "yes": True,
    "a complex one": 1j,
    "a list": [1.0],
    "a kind of its own": Odd(0.5),
    "nothing": None,
    "text": "0.5",
    "not a number": NAN,
    "without end": INF,
}
GIVEN = {
    "move_absolute": lambda x, value: x.move_absolute(value),
    "move_relative": lambda x, value: x.move_relative(value),
    "move_additive": lambda x, value: x.move_additive(value),
    "velocity": lambda x, value: x.move_relative(1.0, velocity=value),
    "acceleration": lambda x, value: x.move_relative(1.0, acceleration=value),
    "deceleration": lambda x, value: x.move_relative(1.0, deceleration=value),
    "timeout": lambda x, value: x.move_relative(1.0, timeout=value),
    "move_velocity": lambda x, value: x.move_velocity(value),
    "jog": lambda x, value: x.jog(value),
    "torque": lambda x, value: x.torque_control(value),
    "slope": lambda x, value: x.torque_control(0.5, slope=value),
    "method": lambda x, value: x.home(value),
    "homing timeout": lambda x, value: x.home(35, timeout=value),
    "set_position": lambda x, value: x.set_position(value),
    "probe_move": lambda x, value: x.probe_move(value),
    "span": lambda x, value: x.follow(TrapezoidalTrajectory(x.position, value, 1.0, 1.0)),
    "speed": lambda x, value: x.follow(TrapezoidalTrajectory(x.position, 1.0, value, 1.0)),
    "ramp": lambda x, value: x.follow(TrapezoidalTrajectory(x.position, 1.0, 1.0, value)),
}
IN_A_GROUP = {
    "line": lambda group, value: group.move_linear((value, 1.0), velocity=10.0),
    "path velocity": lambda group, value: group.move_linear((1.0, 1.0), velocity=value),
    "path acceleration": lambda group, value: group.move_linear(
        (1.0, 1.0), velocity=10.0, acceleration=value
    ),
    "direct": lambda group, value: group.move_direct((1.0, value)),
    "direct velocity": lambda group, value: group.move_direct((1.0, 1.0), velocity=value),
}


@pytest.mark.parametrize("what", [*GIVEN, *IN_A_GROUP])
def test_no_absurd_number_ends_the_scan_or_raises_a_foreign_error(scenario, what):
    """The command is refused at the call or executed; in both cases the next command finds an axis that works."""
    for name, value in ABSURD.items():
        cell = scenario.simulated("xy", axis=LIMITED).enabled()
        cell.run(0.1)
        group = cell.machine.group("x", "y")
        refused, handle = None, None
        try:
            handle = GIVEN[what](cell.x, value) if what in GIVEN else IN_A_GROUP[what](group, value)
        except Exception as error:  # noqa: BLE001  # its type is asserted below
            refused = error
        cell.run(0.5)
        if handle is None:
            assert isinstance(refused, ArgumentError), name
            assert len(str(refused)) < 1000, name
            assert cell.top_speed() < 0.1, name
        else:
            assert not isinstance(handle.error, CommandError), name
        assert cell.top_speed() <= 400.0 * 1.1, name
        must_work(cell)


def must_work(cell) -> None:
    """Whatever state the axis is in, it stops on command, and executes the next command."""
    cell.x.stop()
    cell.run(1.0)
    cell.x.reset().wait(1)
    cell.x.release().wait(1)
    cell.x.enable().wait(5)
    cell.x.move_relative(-3.0).wait(5)
    assert cell.scan_runs


def test_a_straight_line_out_of_the_limits_is_refused(scenario, golden):
    cell = scenario.simulated("xy", axis=LIMITED).enabled()
    group = cell.machine.group("x", "y")
    golden("line_beyond_limits", sends_nothing(cell, lambda: group.move_linear((10.0, 91.0), velocity=50.0)))
    golden("line_nan", sends_nothing(cell, lambda: group.move_linear((10.0, NAN), velocity=50.0)))
    golden("line_velocity", sends_nothing(cell, lambda: group.move_linear((10.0, 1.0), velocity=NAN)))
    golden("line_count", sends_nothing(cell, lambda: group.move_linear((10.0,), velocity=50.0)))


def test_a_path_longer_than_half_the_drive_s_count_ends_the_handle(scenario, golden):
    cell = scenario.simulated("x")
    cell.drive().axis.motor.position = -2.0e9  # the actual position, in increments
    cell.run(0.1)
    cell.x.enable().wait(5)
    failed = cell.failure_of(cell.x.move_absolute(2.0e9 / SCALE))
    assert isinstance(failed, LimitError)
    golden("way_too_long", failed)
    assert cell.speed() == 0


@pytest.mark.nets("the stop sequence")
def test_a_trajectory_that_raises_while_it_runs_stops_only_its_axis_and_its_group(scenario, golden):
    cell = scenario.simulated("xy").enabled()
    cell["y"].move_velocity(90.0).wait(3)

    class Breaks:
        duration = 60.0

        def position(self, t: float) -> float:
            if t > 1.0:
                raise ZeroDivisionError("division by zero")
            return 25.0 * t * t

    handle = cell.x.follow(Breaks())
    cell.run(1.0)
    cell.must_move("x")
    cell.must_be_still("x", within=1.5, stages=(1, 4, 5))
    cell.must_be_still("y", within=1.5, stages=4)
    failed = cell.failure_of(handle)
    assert isinstance(failed, AxisbusError)
    golden("trajectory_breaks", failed)
    assert cell.scan_runs  # one program's mistake does not end the bus


def scenario_text(scenario, *, max_velocity: float = 400.0, axis: str = "") -> str:
    from kit.cell import cell_text

    return cell_text("x", axis=axis).replace("max_velocity = 400.0", f"max_velocity = {max_velocity}")
