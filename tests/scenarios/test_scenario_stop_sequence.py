"""The stop sequence against drives that do not obey, and against gravity."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus import eds
from axisbus.cia301.nmt import NmtState
from axisbus.eds.builtin import resolve
from axisbus.errors import DriveError, StateError
from axisbus.motion.states import AxisState
from axisbus.sim.build import device_from_eds, motor_from_eds
from axisbus.sim.device import Device
from kit.campaign.cells.files import variant
from kit.cell import GENERIC, cell_text
from kit.plant_probe import ENABLED, OFF, QUICK_STOP, SWITCH_ON_DISABLED, PlantMoves

TIMES = 'halt_time = "500ms"\nquick_stop_time = "400ms"\ndisable_time = "600ms"'
LOAD = 300.0  # ‰ of the rated torque, downwards


def deaf(cell, *commands: str) -> None:
    for command in commands:
        setattr(cell.drive().dials, f"ignore_{command}", True)


# -- step by step --------------------------------------------------------------------------------------------------------


@pytest.mark.nets("the stop sequence")
def test_a_drive_that_ignores_halt_gets_a_quick_stop(scenario, golden):
    cell = scenario.simulated("x", stop=TIMES)
    cell.travelling()
    deaf(cell, "halt")
    halt = cell.x.halt()
    took = cell.must_be_still(within=1.2, stages=SWITCH_ON_DISABLED)
    assert 0.5 < took < 0.75
    error = cell.failure_of(halt)
    assert isinstance(error, DriveError)
    golden("stop_sequence_quick_stop", error)


def test_a_path_that_brakes_too_slowly_for_halt_time_ends_in_a_quick_stop_with_that_reason(scenario):
    cell = scenario.simulated("x", stop=TIMES).enabled()
    cell.machine.group("x").move_linear([400.0], velocity=100.0, acceleration=50.0)
    cell.run(2.5)
    halt = cell.x.halt()
    cell.must_be_still(within=1.2, stages=SWITCH_ON_DISABLED)
    error = cell.failure_of(halt)
    assert isinstance(error, DriveError)
    assert error.remedy.startswith("braking along its path took longer than halt_time")


def test_a_quick_stop_with_an_unknown_ramp_out_of_a_path_is_confirmed_by_its_standstill(scenario):
    """The last target lies behind the axis; neither 6085h (missing) nor 6062h (ignored) shows that it does not pull."""
    dictionary = scenario.folder / "drive.eds"
    dictionary.write_text(variant((0x6085,), (), 0, None), encoding="ascii")
    text = cell_text("x", eds=str(dictionary), axis='demand = "ignore"', stop='quick_stop = "ramp-hold"')
    cell = scenario.simulated(text=text.replace("deceleration = 1000.0\n", "")).enabled()
    cell.device().write(0x6084, 0, 20_000)  # 200 deg/s², with which this drive brakes
    cell.machine.group("x").move_linear([400.0], velocity=100.0, acceleration=500.0)
    cell.run(1.0)
    assert cell.end_of(cell.x.quick_stop(), 1.0) is None
    cell.must_be_still(within=0.01, stages=QUICK_STOP)
    assert cell.where("x") == pytest.approx(106.5, abs=2.0)  # 25 deg behind the last target


@pytest.mark.nets("the stop sequence")
def test_a_drive_that_ignores_quick_stop_too_loses_its_power(scenario, golden):
    cell = scenario.simulated("x", stop=TIMES)
    cell.travelling()
    deaf(cell, "halt", "quick_stop")
    halt = cell.x.halt()
    cell.run(0.95)
    cell.must_be(OFF)
    cell.must_be_still(within=5.0, stages=SWITCH_ON_DISABLED)  # nothing brakes it: it coasts
    golden("stop_sequence_disable_voltage", cell.failure_of(halt))


@pytest.mark.nets("the stop sequence")
def test_a_drive_that_ignores_everything_is_left_to_its_reaction_to_nmt_stop(scenario, golden):
    cell = scenario.simulated("x", stop=TIMES)
    cell.travelling()
    deaf(cell, "halt", "quick_stop", "disable_voltage")
    halt = cell.x.halt()
    took = cell.must_be_still(within=2.5, stages=(QUICK_STOP, *OFF))  # 6007h: quick stop
    assert 1.5 < took < 2.0
    assert cell.device().nmt is NmtState.STOPPED
    golden("stop_sequence_nmt_stop", cell.failure_of(halt))


def test_a_drive_that_nothing_stops_is_reported_as_moving(scenario, golden):
    cell = scenario.simulated("x", stop=TIMES)
    cell.travelling()
    cell.device().write(0x6007, 0, 0)
    deaf(cell, "halt", "quick_stop", "disable_voltage")
    halt = cell.x.stop()
    error = cell.failure_of(halt)
    cell.must_move()
    assert "TREAT THE AXIS AS MOVING" in error.remedy
    golden("stop_sequence_in_vain", error)


@pytest.mark.nets("the stop sequence")
def test_a_drive_that_does_not_switch_off_is_reported_as_energised(scenario, golden):
    cell = scenario.simulated("x", stop=TIMES)
    cell.travelling()
    cell.drive().dials.transition_delay = {5: float("inf")}
    deaf(cell, "disable_voltage")
    disable = cell.x.disable()
    cell.must_be_still(within=2.0, stages=(ENABLED, *OFF))
    golden("stop_sequence_stays_energised", cell.failure_of(disable))


@pytest.mark.nets("the stop sequence")
def test_the_end_of_the_program_runs_the_same_stop_sequence(scenario, golden):
    cell = scenario.simulated("x", stop=TIMES)
    cell.travelling()
    deaf(cell, "halt")
    failure = None
    try:
        cell.machine.close()
    except DriveError as error:
        failure = error
    cell.must_be_still(within=0.01, stages=SWITCH_ON_DISABLED)
    golden("stop_sequence_on_exit", failure)


# -- after a quick stop --------------------------------------------------------------------------------------------------

WORDS = (
    "coast",
    "slow-ramp",
    "ramp",
    "current-limit",
    "voltage-limit",
    "slow-ramp-hold",
    "ramp-hold",
    "current-limit-hold",
    "voltage-limit-hold",
)


@pytest.mark.parametrize("option", range(9))
@pytest.mark.nets("the stop sequence")
def test_a_quick_stop_ends_disabled_or_held_according_to_605ah(scenario, option):
    cell = scenario.simulated("x", stop=f'quick_stop = "{WORDS[option]}"')
    assert cell.device().read(0x605A) == option
    cell.turning()
    stop = cell.x.quick_stop()
    held = option >= 5
    cell.must_be_still(within=5.0 if option == 0 else 1.0, stages=QUICK_STOP if held else SWITCH_ON_DISABLED)
    stop.wait(3)
    assert cell.x.state is (AxisState.STOPPING if held else AxisState.DISABLED)
    cell.x.enable().wait(3)  # by transition 16, or from the beginning
    assert cell.stage() == ENABLED
    cell.x.move_relative(5.0).wait(3)


def test_a_quick_stop_of_a_disabled_axis_has_nothing_to_do(scenario):
    cell = scenario.simulated("x")
    cell.run(0.1)
    cell.x.quick_stop().wait(1)
    assert cell.stage() == SWITCH_ON_DISABLED


# -- gravity -------------------------------------------------------------------------------------------------------------


def hanging(stage, *, brake: bool):
    """A vertical axis: a load that falls as soon as neither motor nor brake holds it."""

    def make() -> dict[int, Device]:
        model = eds.load(resolve(GENERIC, stage.folder))
        params = replace(motor_from_eds(model), load=LOAD, brake=brake, brake_opens=0.05, brake_closes=0.05)
        return {1: device_from_eds(model, 1, params)}

    return make


BRAKE = 'holds_load = "brake"\nrated_torque = 10.0'
TORQUE = 'holds_load = "torque"\nrated_torque = 10.0'
HOLD = 'quick_stop = "ramp-hold"'


def vertical(stage, holds: str, stop: str = ""):
    brake = holds == BRAKE
    stop = stop if brake else f"{HOLD}\n{stop}"
    cell = stage.simulated("x", axis=holds, stop=stop, devices=hanging(stage, brake=brake))
    if not brake:  # it is held by hand until it is enabled
        cell.drive().dials.blocked = True
    cell.x.enable().wait(3)
    cell.drive().dials.blocked = False
    return cell


class Fall:
    """How far the load has ever been below where it was, in degrees."""

    def __init__(self, cell) -> None:
        self._cell = cell
        self.highest, self.deepest = cell.where(), 0.0
        step = cell.drive().step

        def watched(dt: float) -> None:
            step(dt)
            here = cell.where()
            self.highest = max(self.highest, here)
            self.deepest = max(self.deepest, self.highest - here)

        cell.drive().step = watched

    def must_be_below(self, limit: float) -> None:
        if self.deepest > limit:
            raise PlantMoves(f"the load fell by {self.deepest:g} deg: {self._cell.told()}")


def rising(cell) -> Fall:
    """Let it rise; count a fall from here on."""
    cell.x.move_velocity(60.0).wait(3)
    cell.must_move(faster_than=55.0)
    fall = Fall(cell)
    cell.run(0.1)
    return fall


WAYS = {
    "halt": lambda x: x.halt(),
    "stop": lambda x: x.stop(),
    "quick_stop": lambda x: x.quick_stop(),
    "disable": lambda x: x.disable(),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.nets("the stop sequence")
def test_a_load_on_a_brake_is_stopped_and_held_by_every_stop(scenario, way):
    cell = vertical(scenario, BRAKE)
    fall = rising(cell)
    handle = WAYS[way](cell.x)
    cell.must_be_still(within=1.5, stages=(ENABLED, QUICK_STOP, *OFF), for_good=2.0)
    handle.wait(2)
    fall.must_be_below(0.2)


@pytest.mark.parametrize("way", ["halt", "stop", "quick_stop"])
@pytest.mark.nets("the stop sequence")
def test_a_load_on_the_motor_alone_is_stopped_and_held(scenario, way):
    cell = vertical(scenario, TORQUE)
    fall = rising(cell)
    handle = WAYS[way](cell.x)
    cell.must_be_still(within=1.5, stages=(ENABLED, QUICK_STOP), for_good=2.0)
    handle.wait(2)
    fall.must_be_below(0.2)


@pytest.mark.nets("the stop sequence")
def test_a_load_on_the_motor_alone_stays_held_when_the_program_ends(scenario):
    cell = vertical(scenario, TORQUE)
    fall = rising(cell)
    cell.machine.close()
    cell.must_be_still(within=0.01, stages=(ENABLED, QUICK_STOP), for_good=3.0)
    fall.must_be_below(0.2)


def test_a_hanging_axis_is_never_switched_off_before_standstill(scenario, golden):
    """Neither halt nor quick stop is obeyed: a loss of power would drop the load, so the stop sequence ends with that reason."""
    cell = vertical(scenario, TORQUE, stop=TIMES)
    cell.x.move_relative(2000.0, velocity=60.0)
    cell.run(0.5)
    fall = Fall(cell)
    deaf(cell, "halt", "quick_stop")
    error = cell.failure_of(cell.x.stop())
    cell.run(2.0)
    assert cell.stage() == ENABLED
    fall.must_be_below(0.2)
    golden("stop_sequence_ends_for_a_load", error)


def test_a_load_held_at_standstill_is_not_dropped_by_a_quick_stop_that_is_ignored(scenario):
    cell = vertical(scenario, TORQUE, stop=TIMES)
    cell.run(0.5)
    fall = Fall(cell)
    deaf(cell, "quick_stop")
    cell.end_of(cell.x.quick_stop())
    cell.run(2.0)
    assert cell.stage() in (ENABLED, QUICK_STOP)
    fall.must_be_below(0.2)


def test_coasting_is_refused_while_a_load_moves(scenario, golden):
    cell = vertical(scenario, BRAKE)
    rising(cell)
    refused = cell.failure_of(cell.x.disable(coast=True))
    assert isinstance(refused, StateError)
    golden("coast_with_load", refused)
    cell.must_move(faster_than=55.0)


@pytest.mark.parametrize("way", ["halt", "stop"])
@pytest.mark.nets("the stop sequence")
def test_torque_control_under_a_load_is_stopped_by_a_mode_that_holds(scenario, way):
    cell = vertical(scenario, TORQUE)
    fall = Fall(cell)
    lift = 1.1 * LOAD / 1000 * 10.0  # N·m: somewhat more than the load and its friction
    cell.x.torque_control(lift)
    cell.until(lambda: cell.speed() > 20.0)
    handle = WAYS[way](cell.x)
    cell.must_be_still(within=2.0, stages=ENABLED, for_good=2.0)
    handle.wait(2)
    fall.must_be_below(0.6)
    assert cell.drive().mode_display in (1, 3, 8)  # pp, pv, csp: not a torque mode


@pytest.mark.nets("the stop sequence")
def test_a_load_in_torque_mode_is_held_after_a_quick_stop(scenario):
    cell = vertical(scenario, TORQUE)
    fall = Fall(cell)
    cell.x.torque_control(1.1 * LOAD / 1000 * 10.0)
    cell.until(lambda: cell.speed() > 20.0)
    handle = cell.x.quick_stop()
    cell.must_be_still(within=2.0, stages=QUICK_STOP, for_good=2.0)
    handle.wait(2)
    fall.must_be_below(0.6)


def test_a_load_in_torque_mode_is_not_dropped_by_a_drive_that_ignores_the_stop(scenario, golden):
    cell = vertical(scenario, TORQUE, stop=TIMES)
    fall = Fall(cell)
    cell.x.torque_control(1.1 * LOAD / 1000 * 10.0)
    cell.until(lambda: cell.speed() > 20.0)
    deaf(cell, "quick_stop")
    golden("stop_sequence_load_in_torque_mode", cell.failure_of(cell.x.quick_stop()))
    assert cell.stage() == ENABLED
    fall.must_be_below(0.6)
