"""A refused command changes nothing: no state, no mode, no motion, and no running command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from axisbus import Cam, Handle
from axisbus.errors import AxisbusError, LimitError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.cell import Cell, Stage, cell_text
from kit.io_module import LEVEL, MODULE

AXIS = "max_acceleration = 2000.0\nposition_limits = [-3000.0, 3000.0]\nrated_torque = 10.0"
MORE = '[groups.zw]\naxes = ["z", "w"]\n[gantries.b]\naxes = ["x", "y"]\nmax_skew = 8.0\n'
CAM = Cam([(0, 0), (90, 20), (180, 0)], periodic=True)
Call = Callable[[Machine], Any]


def of(name: str, call: Callable[[Axis, Axis], Any]) -> Call:
    """A command of an axis; its master is v."""
    return lambda machine: call(machine[name], machine["v"])


AXIS_COMMANDS: dict[str, Callable[[Axis, Axis], Any]] = {
    "enable": lambda axis, _: axis.enable(),
    "release": lambda axis, _: axis.release(),
    "move": lambda axis, _: axis.move_absolute(5.0),
    "move too far": lambda axis, _: axis.move_absolute(1e6),
    "relative too far": lambda axis, _: axis.move_relative(6000.0),
    "buffered": lambda axis, _: axis.move_absolute(5.0, buffer=True),
    "with jerk": lambda axis, _: axis.move_absolute(5.0, jerk=1000.0),
    "velocity": lambda axis, _: axis.move_velocity(20.0),
    "jog": lambda axis, _: axis.jog(5.0),
    "torque": lambda axis, _: axis.torque_control(0.2),
    "cyclic velocity": lambda axis, _: axis.cyclic_velocity(20.0),
    "cyclic torque": lambda axis, _: axis.cyclic_torque(0.2, slope=5.0),
    "controller": lambda axis, _: axis.controller(lambda _: 1.0).handle,
    "home": lambda axis, _: axis.home(),
    "set position": lambda axis, _: axis.set_position(1.0),
    "follow": lambda axis, _: axis.follow([(0.0, axis.position), (1.0, axis.position)]),
    "gear": lambda axis, master: axis.gear_in(master, 0.5),
    "cam": lambda axis, master: axis.cam_in(master, CAM, master_offset=90.0),
    "out of a gear": lambda axis, _: axis.gear_out(),
    "torque offset": lambda axis, _: axis.set_torque_offset(0.0),
    "phase": lambda axis, _: axis.phasing_relative(5.0, velocity=5.0, acceleration=5.0),
    "superimposed": lambda axis, _: axis.move_superimposed(5.0),
    "until an edge": lambda axis, _: axis.probe_move(5.0, input=2),
    "override": lambda axis, _: axis.set_override(9.0),
}
GROUP_COMMANDS: dict[str, Call] = {
    "group enable": lambda machine: machine.group("zw").enable(),
    "group line": lambda machine: machine.group("zw").move_linear((5.0, 5.0), velocity=10.0),
    "group line too far": lambda machine: machine.group("zw").move_linear((1e6, 5.0), velocity=10.0),
    "group direct": lambda machine: machine.group("zw").move_direct((5.0, 5.0)),
    "group path": lambda machine: machine.group("zw").move_path([(5.0, 5.0), (9.0, 0.0)], velocity=10.0),
    "group extend": lambda machine: machine.group("zw").extend_path([(5.0, 5.0), (9.0, 0.0)]),
    "group stream": lambda machine: machine.group("zw").stream(period=0.01).handle,
    "group resume": lambda machine: machine.group("zw").resume(),
    "group override": lambda machine: machine.group("zw").set_override(9.0),
    "beam enable": lambda machine: machine.gantry("b").enable(skew=20.0),
    "beam move": lambda machine: machine.gantry("b").move_absolute(5.0),
    "beam too far": lambda machine: machine.gantry("b").move_relative(5000.0),
    "beam velocity": lambda machine: machine.gantry("b").move_velocity(20.0),
    "beam home": lambda machine: machine.gantry("b").home(),
    "beam position": lambda machine: machine.gantry("b").set_position(1.0),
    "beam square": lambda machine: machine.gantry("b").square(velocity=5.0),
    "beam resume": lambda machine: machine.gantry("b").resume(),
    "axis of a beam": of("x", lambda axis, _: axis.move_absolute(5.0)),
    "input": lambda machine: machine.io["part"].set(True),
    "outputs, one of them wrong": lambda machine: machine.io.set({"lamp": True, "level": 1.0}),
    "outputs, one of them unknown": lambda machine: machine.io.set({"lamp": True, "nothing": 1.0}),
    "output beyond its range": lambda machine: machine.io["lamp"].set(2),
}
NEEDS_REST = "cyclic velocity,cyclic torque,controller,home,set position,follow,until an edge"
NEVER = "move too far,relative too far,out of a gear,torque offset,phase,override"
NEEDS_POWER = (
    "move,buffered,with jerk,velocity,jog,torque,cyclic velocity,cyclic torque,controller,home,follow,gear,cam,superimposed,"
    "until an edge"
)
GROUP_NEEDS_POWER = "group line,group direct,group path,group stream"
NEVER_OF_ALL = (
    "group line too far,group override,beam too far,axis of a beam,beam home,input,outputs\\, one of them wrong,"
    "outputs\\, one of them unknown,output beyond its range"
).replace("\\,", "\0")


def names(*texts: str) -> list[str]:
    return [name.replace("\0", ",") for text in texts for name in text.split(",")]


# The commands that are refused in each situation, of z and w each, and of the group, the beam and the module.
REFUSED: dict[str, tuple[list[str], list[str]]] = {
    "disabled": (
        names(NEVER, NEEDS_POWER),
        names(
            NEVER_OF_ALL, GROUP_NEEDS_POWER, "group resume,beam move,beam velocity,beam resume,beam square"
        ),
    ),
    "standing": (names(NEVER, "cam,superimposed"), names(NEVER_OF_ALL, "group extend,group resume")),
    "profiles": (
        names(NEVER, NEEDS_REST, "superimposed,gear,cam"),
        names(NEVER_OF_ALL, "group line,group path,group stream,beam position,beam square"),
    ),
    "halted": (names(NEVER, "cam,superimposed"), names(NEVER_OF_ALL, "group extend")),
    "locked": (names(NEVER, NEEDS_POWER, "set position"), names(NEVER_OF_ALL, GROUP_NEEDS_POWER)),
    "one in fault": ([], names(NEVER_OF_ALL, GROUP_NEEDS_POWER, "group enable,beam enable,beam move")),
}


def opened(scenario: Stage, situation: str) -> tuple[Cell, list[Handle]]:
    """A cell in a situation, and the handles of the motions that must continue."""
    more = MODULE.format(node="").replace("nodes.5", "nodes.9").replace("node = 5", "node = 9")
    level = LEVEL.replace("node = 5", "node = 9")
    cell = scenario.simulated(text=cell_text("xyzwv", axis=AXIS, more=more + level + MORE))
    machine, goes_on = cell.machine, [cell["v"].probe(1)]
    if situation != "disabled":
        machine.gantry("b").enable().wait(5)
        cell["v"].enable().wait(5)
        machine.group("zw").enable().wait(5)
        goes_on += [cell["z"].probe(2)]
    if situation == "profiles":
        goes_on += [cell["z"].move_absolute(2000.0, velocity=20.0), machine.gantry("b").move_velocity(20.0)]
        cell["w"].move_velocity(20.0).wait(5)
    elif situation == "halted":
        machine.group("zw").move_linear((100.0, 50.0), velocity=20.0)
        cell.run(0.5)
        machine.group("zw").halt().wait(5)
    elif situation == "locked":
        machine.group("zw").stop().wait(5)
    elif situation == "one in fault":
        goes_on += [cell["w"].move_absolute(2000.0, velocity=20.0)]
        cell.drive("z").fault(0x2310)
        cell.drive("x").fault(0x2310)
        cell.run(0.5)
        goes_on = [handle for handle in goes_on if handle.busy]
    cell.run(0.5)
    return cell, goes_on


def seen(cell: Cell, goes_on: list[Handle]) -> dict[str, object]:
    """The observable state that a command could change."""
    found: dict[str, object] = {handle.name: handle.status for handle in goes_on}
    for axis in cell.machine:
        snapshot = axis.snapshot
        mode = cell.drive(axis.name).mode_display
        target = None if axis.state is AxisState.SYNCHRONIZED_MOTION else axis.target
        found[axis.name] = (
            *(axis.state, str(axis.error), snapshot.power_state, axis.homed, axis.override, mode, target),
            round(cell.speed(axis.name)),
        )
    found |= {name: cell.machine.io[name].value for name in ("part", "lamp", "level")}
    return found


@pytest.mark.parametrize("situation", REFUSED)
def test_a_refused_command_changes_nothing(scenario, situation):
    cell, goes_on = opened(scenario, situation)
    of_axis, of_all = REFUSED[situation]
    calls = {f"{name}: {each}": of(name, AXIS_COMMANDS[each]) for name in "zw" for each in of_axis}
    calls |= {each: GROUP_COMMANDS[each] for each in of_all}
    for text, call in calls.items():
        before = seen(cell, goes_on)
        with pytest.raises(AxisbusError):
            call(cell.machine).wait(0.2)
            pytest.fail(f"{text} is not refused")
        cell.run(0.1)
        assert seen(cell, goes_on) == before, text
    if situation == "halted":
        cell.end_of(cell.machine.group("zw").resume(), 20)
        assert cell.where("z") == pytest.approx(100.0, abs=0.1)


def at_standstill_in_csp(scenario: Stage) -> Cell:
    cell = scenario.simulated("xy", axis=AXIS).enabled()
    cell.x.follow([(0.0, 0.0), (1.0, 10.0), (2.0, 10.0)]).wait(5)
    return cell


def test_a_trajectory_that_begins_elsewhere_leaves_the_axis_at_standstill(scenario):
    cell = at_standstill_in_csp(scenario)
    with pytest.raises(LimitError, match="does not begin at the position of the axis"):
        cell.x.follow([(0.0, 90.0), (1.0, 90.0)]).wait(2)
    cell.run(0.3)
    assert cell.x.state is AxisState.STANDSTILL
    assert cell.where("x") == pytest.approx(10.0, abs=0.05)


def test_a_slave_that_cannot_synchronise_is_left_at_standstill(scenario):
    cell = at_standstill_in_csp(scenario)
    waits = cell.x.gear_in(cell["y"], 1.0, sync_positions=(20.0, 30.0), master_start_distance=90.0)
    cell.run(0.3)
    cell["y"].move_absolute(50.0)
    assert isinstance(cell.failure_of(waits), LimitError)
    cell.run(0.3)
    assert cell.x.state is AxisState.STANDSTILL
    assert cell.where("x") == pytest.approx(10.0, abs=0.05)


@pytest.mark.parametrize("couple", ["gear", "cam"])
def test_a_slave_whose_master_is_in_fault_is_left_as_it_is(scenario, couple):
    cell = at_standstill_in_csp(scenario)
    cell.drive("y").fault(0x2310)
    cell.run(0.5)
    with pytest.raises(StateError, match="its master is lost"):
        (cell.x.gear_in(cell["y"], 1.0) if couple == "gear" else cell.x.cam_in(cell["y"], CAM)).wait(2)
    assert cell.x.state is AxisState.STANDSTILL


def test_a_synchronised_slave_stays_so_if_another_cam_is_refused(scenario):
    cell = at_standstill_in_csp(scenario)
    cell.x.gear_in(cell["y"], 1.0).wait(5)
    with pytest.raises(LimitError):
        cell.x.cam_in(cell["y"], CAM, master_offset=90.0).wait(2)
    assert cell.x.state is AxisState.SYNCHRONIZED_MOTION
    cell["y"].move_absolute(30.0).wait(5)
    cell.run(0.3)
    assert cell.where("x") == pytest.approx(40.0, abs=0.2)


def test_a_group_that_one_axis_keeps_from_starting_replaces_no_motion_of_another(scenario):
    cell = scenario.simulated(
        "xy", axis=AXIS, more='[groups.xy]\naxes = ["x", "y"]\non_fault = "each"\n'
    ).enabled()
    cell["y"].disable().wait(5)
    move = cell.x.move_absolute(500.0, velocity=50.0)
    cell.run(0.5)
    with pytest.raises(StateError, match=r"\[y\]"):
        cell.machine.group("xy").move_direct((5.0, 5.0)).wait(2)
    cell.run(0.5)
    assert move.busy
    cell.must_move("x")
