"""Every argument of every public call, with invalid values: the error is one of the library, and names the valid ones."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any

import pytest

from axisbus import Cam, Machine, TrajectoryPoint, wait
from axisbus.errors import ArgumentError, SignalTimeout, UserError
from kit.cell import cell_file
from kit.io_module import LEVEL, MODULE

AXIS = "max_acceleration = 2000.0\nposition_limits = [-3000.0, 3000.0]\nrated_torque = 10.0"
MORE = (MODULE.format(node="") + LEVEL).replace("nodes.5", "nodes.9").replace("node = 5", "node = 9") + (
    '[io.valve]\nnode = 9\nobject = "6411h:01"\nscale = 1000\nsafe = 0.5\n'
    '[groups.zw]\naxes = ["z", "w"]\n[gantries.b]\naxes = ["x", "y"]\nmax_skew = 8.0\n'
)


class Odd:
    """A type of the program's own that is no number in any way."""

    def __float__(self) -> float:
        raise ZeroDivisionError


ABSURD: list[object] = [
    10**400,
    -(10**400),
    10**5000,  # too long to be printed
    math.nan,
    math.inf,
    -math.inf,
    True,
    None,
    "1",
    b"1",
    1j,
    [],
    {},
    (),
    Odd(),
]
ABSURD.append(pytest.importorskip("numpy").array([1.0, 2.0]))
Call = Callable[[Machine, Any], Any]


def each_argument(of: Callable[[Machine], Any], method: str, **others: Any) -> dict[str, Call]:
    """One call for each argument of a method, the others as given; a value that is a function of the machine is computed."""

    def call(machine: Machine, name: str, value: object) -> Any:
        made = {key: other(machine) if callable(other) else other for key, other in others.items()}
        return getattr(of(machine), method)(**{**made, name: value})

    kind = {axis: "Axis", group: "Group", beam: "Gantry", itself: "Machine"}[of]
    import axisbus
    from axisbus.machine.gantry import Gantry

    names = inspect.signature(
        getattr({"Gantry": Gantry}.get(kind) or getattr(axisbus, kind), method)
    ).parameters
    return {
        f"{kind}.{method}({name})": lambda machine, value, name=name: call(machine, name, value)
        for name in names
        if name not in ("self", "options")
    }


def axis(machine: Machine) -> Any:
    return machine["z"]


def group(machine: Machine) -> Any:
    return machine.group("zw")


def beam(machine: Machine) -> Any:
    return machine.gantry("b")


def itself(machine: Machine) -> Any:
    return machine


def master(machine: Machine) -> Any:
    return machine["v"]


CAM = Cam([(0, 0), (1, 1)])
CALLS: dict[str, Call] = {
    **each_argument(axis, "enable"),
    **each_argument(axis, "disable"),
    **each_argument(axis, "move_absolute", position=1.0),
    **each_argument(axis, "move_relative", distance=1.0),
    **each_argument(axis, "move_additive", distance=1.0),
    **each_argument(axis, "move_velocity", velocity=1.0),
    **each_argument(axis, "jog", velocity=1.0),
    **each_argument(axis, "torque_control", torque=0.1),
    **each_argument(axis, "cyclic_velocity", velocity=1.0),
    **each_argument(axis, "cyclic_torque", torque=0.1),
    **each_argument(axis, "home"),
    **each_argument(axis, "set_position", position=0.0),
    **each_argument(axis, "follow", trajectory=[(0, 0), (1, 1)]),
    **each_argument(axis, "gear_in", master=master, ratio=1.0),
    **each_argument(axis, "cam_in", master=master, cam=CAM),
    **each_argument(axis, "set_override", factor=1.0),
    **each_argument(axis, "set_torque_offset", torque=0.0),
    **each_argument(axis, "phasing_relative", shift=1.0, velocity=1.0, acceleration=1.0),
    **each_argument(axis, "move_superimposed", distance=1.0),
    **each_argument(axis, "halt_superimposed"),
    **each_argument(axis, "probe"),
    **each_argument(axis, "probe_move", position=1.0),
    **each_argument(axis, "probe_abort"),
    **each_argument(axis, "room_from", start=0.0),
    **each_argument(group, "move_linear", positions=(1.0, 1.0), velocity=1.0),
    **each_argument(group, "move_path", points=((1.0, 1.0), (2.0, 1.0)), velocity=1.0),
    **each_argument(group, "extend_path", points=((1.0, 1.0),)),
    **each_argument(group, "move_circular", end=(10.0, 0.0), centre=(5.0, 0.0), velocity=1.0),
    **each_argument(group, "stream", period=0.01),
    **each_argument(group, "follow"),
    **each_argument(group, "move_direct", positions=(1.0, 1.0)),
    **each_argument(group, "set_override", factor=1.0),
    **each_argument(beam, "enable"),
    **each_argument(beam, "move_absolute", position=1.0),
    **each_argument(beam, "move_relative", distance=1.0),
    **each_argument(beam, "move_additive", distance=1.0),
    **each_argument(beam, "move_velocity", velocity=1.0),
    **each_argument(beam, "set_position", position=1.0),
    **each_argument(beam, "square", velocity=1.0),
    **each_argument(itself, "set_override", factor=1.0),
    **each_argument(itself, "hold_to_run", seconds=5.0),
    **each_argument(itself, "recording", path="run.mcap"),
    **each_argument(itself, "capture", path="run.mcap", when="fault"),
    **each_argument(itself, "node"),
    **each_argument(itself, "simulated_node"),
    **each_argument(itself, "gantry"),
    "machine[...]": lambda machine, value: machine[value],
    "machine.group": lambda machine, value: machine.group(value),
    "the master's place of a gear": lambda machine, value: axis(machine).gear_in(
        master(machine), 1.0, sync_positions=(value, 1.0), master_start_distance=5.0
    ),
    "a window of a probe": lambda machine, value: axis(machine).probe(window=(value, 5.0)),
    "a place of a trajectory": lambda machine, value: axis(machine).follow([(0.0, value), (1.0, 1.0)]),
    "a time of a trajectory": lambda machine, value: axis(machine).follow([(0.0, 0.0), (value, 1.0)]),
    "a coordinate of a line": lambda machine, value: group(machine).move_linear((value, 1.0), velocity=1.0),
    "a coordinate of a path": lambda machine, value: group(machine).move_path([(value, 1.0)], velocity=1.0),
    "a point of a path": lambda machine, value: group(machine).move_path([value, (1.0, 1.0)], velocity=1.0),
    "a coordinate of a centre": lambda machine, value: group(machine).move_circular(
        (10.0, 0.0), centre=(value, 0.0), velocity=1.0
    ),
    "a place of a timed point": lambda machine, value: group(machine).follow(
        [TrajectoryPoint(0.0, (value, 0.0)), TrajectoryPoint(1.0, (1.0, 1.0))]
    ),
    "a timed point": lambda machine, value: group(machine).follow([value, TrajectoryPoint(1.0, (1.0, 1.0))]),
    "a cam": lambda _, value: Cam(value),
    "a point of a cam": lambda _, value: Cam([(0, 0), (value, 1.0)]),
    "an output": lambda machine, value: machine.io["valve"].set(value),
    "an output of a bit": lambda machine, value: machine.io["lamp"].set(value),
    "several outputs": lambda machine, value: machine.io.set({"lamp": True, "valve": value}),
    "outputs": lambda machine, value: machine.io.set(value),
    "io[...]": lambda machine, value: machine.io[value],
    "a value waited for": lambda machine, value: machine.io["part"].wait(value, timeout=0.01),
}
WAITS: dict[str, Call] = {
    "an input": lambda machine, value: machine.io["part"].wait(False, timeout=value),
    "a handle": lambda machine, value: axis(machine).release().wait(value),
    "handles": lambda machine, value: wait(axis(machine).release(), timeout=value),
    "a probe": lambda machine, value: axis(machine).probe().wait_armed(value),
    "stopped": lambda machine, value: axis(machine).held_stopped(value).__enter__(),
}


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = cell_file(tmp_path_factory.mktemp("absurd"), "xyzwv", axis=AXIS, more=MORE)
    with Machine.simulated(path) as opened:
        yield opened


@pytest.mark.parametrize("text", CALLS)
def test_an_absurd_value_is_refused_with_a_readable_error(machine, text, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    texts = []
    for value in ABSURD:
        try:
            made = CALLS[text](machine, value)
        except (UserError, SignalTimeout) as error:
            texts.append(error.message)
        else:
            getattr(made, "exception", lambda: None)()
    assert all(len(each) < 400 for each in texts)
    machine.sleep(0.05)
    assert {each.snapshot.error for each in machine} == {None}


@pytest.mark.parametrize("text", WAITS)
@pytest.mark.parametrize(
    "value",
    [10**400, -(10**400), math.nan, -math.inf, True, "1", [], Odd()],
    ids=lambda value: str(type(value)),
)
def test_an_invalid_time_is_refused_before_anything_waits(machine, text, value):
    with pytest.raises(ArgumentError, match="not a number of seconds"):
        WAITS[text](machine, value)


@pytest.mark.parametrize("value", [*ABSURD[:6], "1", None, []], ids=lambda value: type(value).__name__)
def test_a_sleep_of_an_invalid_duration_is_refused_and_no_time_passes(machine, value):
    before = machine["z"].snapshot.now
    with pytest.raises(ArgumentError):
        machine.sleep(value)
    assert machine["z"].snapshot.now == before


def test_an_output_takes_a_number_of_numpy_and_a_fraction_of_its_scale(machine):
    numpy = pytest.importorskip("numpy")
    machine.io["valve"].set(numpy.float32(1.5)).wait(1)
    assert machine.io["valve"].value == 1.5
    machine.io["valve"].set(numpy.int16(2)).wait(1)
    assert machine.io["valve"].value == 2.0
