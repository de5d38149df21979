"""Opening a drawn cell: its EDS files, its cell file, its simulated drives, and how their values travel."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from axisbus import eds
from axisbus.cia402.port import INPUT_OBJECTS, ValueTransport
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, DriveError, ModeError, SdoAbort
from axisbus.machine.machine import Machine
from axisbus.sim.build import device_from_eds, motor_from_eds
from axisbus.sim.control_bits import as_int32
from axisbus.sim.device import Device
from axisbus.sim.drive import Drive
from kit.campaign import can_simple_rules, output_rules
from kit.campaign.cells.files import BUILTIN, GENERIC, model_of, motor_of, path_of, variant
from kit.campaign.cells.recipe import FIRST_NODE, GIM, NORM, AxisRecipe, CellRecipe
from kit.campaign.scenes import NotHere
from kit.campaign.violation import Violation
from kit.cell import Cell, Stage
from kit.gantry.beam import tied

PAIR = "beam"
ENCODER, VIRTUAL = "belt", "clock"
_PP = 1
_FAR = (
    2**30
)  # increments; drives that start farther away take the long direction to a target past the end of their count
_SOFT_BEAM = 0.02  # ‰ of rated torque per increment of the usual motor
# increments/s² per increment: with a stiffer beam the steps of the simulation would add energy
_STIFFEST = 2000.0
# A following error of the drive's own that never trips, and no limits of a maker's, which may be narrower than the cell file.
_WIDE = ((0x6065, 0, 0xFFFF_FFFF), (0x607D, 1, 0), (0x607D, 2, 0), (0x607F, 0, 0))
_OBJECTS = {"quick_stop": 0x605A, "halt": 0x605D, "disable": 0x605C, "fault": 0x605E, "deceleration": 0x6085}


class Refused(NotHere):
    """A cell that ``check`` or ``boot`` refuses."""


class DrawnCell(Cell):
    """A drawn cell; the plants are looked at in norm degrees (see ``recipe``).

    ``pulled``: when (by the plant's clock) the beam of a gantry last pulled each motor with more than its friction.
    """

    def __init__(self, machine: Machine, recipe: CellRecipe) -> None:
        self.recipe = recipe
        self.pulled: dict[str, float] = {}
        super().__init__(machine)

    def note_pull(self) -> None:
        """Note the time if the beam pulls; to be called after its pull was computed."""
        for name in "ab":
            motor = self.drive(name).axis.motor
            if abs(motor.pull) > motor.params.friction:
                self.pulled[name] = self.drive(name).time

    def scale_of(self, name: str) -> float:
        """Increments per norm degree of an axis."""
        return self.recipe.axis(name).increments

    def factor(self, name: str) -> float:
        """Increments of the drive's count per unit, below 0 where the master turns the direction."""
        axis = self.recipe.axis(name)
        return -axis.scale if axis.invert == "master" else axis.scale


def open_cell(stage: Stage, recipe: CellRecipe) -> DrawnCell:
    """Open the cell, enable its axes, and home those that need it at their present position.

    Raises:
        Refused: it cannot be brought into service.
    """
    models = _models(recipe, stage.folder)
    devices = _devices(recipe, models)
    try:
        opened = stage.simulated(
            text=cell_text(recipe, models), devices=lambda: devices, port=partial(_travels, recipe, devices)
        )
    except (AxisbusError, ExceptionGroup) as error:
        raise Refused(f"{type(error).__name__}: {str(error).splitlines()[0]}") from error
    cell = DrawnCell(opened.machine, recipe)
    for name in recipe.names:
        _misbehave(cell, recipe, name)
    if recipe.gantry:
        gain = cell.drive("a").axis.motor.params.rated_acceleration / 1000.0
        stiff = min(_SOFT_BEAM * 100.0 / recipe.axes[0].increments, _STIFFEST / gain)
        tied(cell.device("a"), cell.device("b"), stiff, 0.02 * stiff)
        cell.device("b").step_hooks.append(cell.note_pull)
    _bring_up(cell)
    return cell


def _bring_up(cell: DrawnCell) -> None:
    """Enable all, and home those that must be.

    Raises:
        Violation: a healthy drive cannot be enabled, or moved while it was.
        Refused: something of it is not possible with this drive.
    """
    try:
        if cell.recipe.gantry:
            pair = cell.machine.gantry(PAIR)
            pair.enable().wait(5)
            pair.set_position(_inside(cell.recipe, "a"), square=True).wait(5)
        for axis in cell.machine:
            if not (cell.recipe.gantry and axis.name in "ab") and axis.name != ENCODER:
                axis.enable().wait(5)
        for name in cell.recipe.names:
            if cell.core(name).parameters.homing.required and not cell.core(name).homed:
                if not cell.recipe.axis(name).modes:
                    cell[name].home().wait(5)
                else:
                    cell[name].set_position(_inside(cell.recipe, name)).wait(5)
    except ModeError as error:
        raise Refused(f"a mode that the file claims and its simulated drive has not: {error}") from error
    except (DriveError, TimeoutError) as error:
        raise Violation("a healthy axis comes into service", f"{error}", error) from error
    except AxisbusError as error:
        raise Refused(f"not in service: {type(error).__name__}: {str(error).splitlines()[0]}") from error
    cell.run(0.3)


def _inside(recipe: CellRecipe, name: str) -> float:
    edges = recipe.axis(name).edges
    return 0.0 if edges is None else min(max(0.0, edges[0]), edges[1])


# -- files and drives ----------------------------------------------------------------------------------------------------


def _models(recipe: CellRecipe, folder: Path) -> dict[str, tuple[str, Eds]]:
    """Each axis's file as the cell file names it, and as it is read."""
    return {name: _model(recipe.axis(name), folder, name) for name in recipe.names}


def _model(axis: AxisRecipe, folder: Path, name: str) -> tuple[str, Eds]:
    if path_of(axis.file) is None:
        raise Refused(f"the EDS corpus, or a file of it, is not here: {axis.file}")
    if axis.file != GENERIC:
        file = f"builtin:{axis.file}" if axis.file == GIM else str(path_of(axis.file))
        return file, model_of(axis.file)
    values = tuple(
        (index, _fixed(axis, index, share)) for index, share in axis.fixed if index not in axis.without
    )
    if not (axis.without or values or axis.modes or axis.rpm is not None):
        return f"builtin:{GENERIC}", model_of(GENERIC)
    path = folder / f"{name}.eds"
    path.write_text(variant(axis.without, values, axis.modes, axis.rpm), encoding="ascii")
    return path.name, eds.load(path)


def _fixed(axis: AxisRecipe, index: int, share: int) -> int:
    """The value of a read-only object: an acceleration is a share of the axis's own."""
    if index == 0x605A:
        return 2
    if index == 0x6065:
        return round(axis.speed)
    return max(1, round(axis.acceleration * velocity_unit(axis) / share))


def velocity_unit(axis: AxisRecipe) -> float:
    """Velocity increments of the drive per increment/s."""
    if axis.rpm is not None:
        return 60.0 / motor_of(axis.file)[0] * 10.0**-axis.rpm
    return motor_of(axis.file)[1]


def is_slow(axis: AxisRecipe) -> bool:
    """Whether the velocities of the cell file are those of the recipe: others may be so fast that any lag is a following error."""
    return axis.counted or velocity_unit(axis) >= 1.0


def _devices(recipe: CellRecipe, models: Mapping[str, tuple[str, Eds]]) -> dict[int, Device]:
    made = {}
    for number, name in enumerate(recipe.names):
        axis, model = recipe.axis(name), models[name][1]
        given = motor_from_eds(model)
        motor = replace(
            given,
            start_position=float(axis.start),
            lag=min(axis.lag, given.lag) if axis.file != GENERIC or not is_slow(axis) else axis.lag,
            rated_acceleration=20.0 * axis.acceleration / (1.0 if axis.counted else velocity_unit(axis)),
            noise=axis.noise,
            wraps=abs(axis.start) < _FAR,
        )
        made[FIRST_NODE + number] = device_from_eds(model, FIRST_NODE + number, motor, seed=number)
    if recipe.beside in ("io", "encoder"):
        made[output_rules.NODE] = device_from_eds(eds.load(_cia401()), output_rules.NODE)
    return made


def _cia401() -> Path:
    from axisbus.eds.builtin import resolve

    return resolve("builtin:generic-cia401", Path())


def _travels(recipe: CellRecipe, devices: Mapping[int, Device], node: int, _axis: int) -> Mapping[str, Any]:
    """Return how the values of an axis travel, as ``kit.value_transport``; empty if as usual."""
    made = recipe.axes[node - FIRST_NODE]
    has = devices[node].dictionary.has
    inputs = dict.fromkeys(INPUT_OBJECTS, ValueTransport.EVENT_PDO) if made.event_timer else {}
    inputs |= {name: ValueTransport.SDO for name in made.polled if has(INPUT_OBJECTS[name])}
    options = {
        "inputs": {name: how for name, how in inputs.items() if has(INPUT_OBJECTS[name])},
        "every": {
            name: every for name, every in made.slow if name not in inputs and has(INPUT_OBJECTS[name])
        },
        "apart": tuple(name for name in made.apart if has(INPUT_OBJECTS[name])),
        "outputs": dict.fromkeys(made.written, ValueTransport.SDO),
        "controlword_first": made.word_first,
    }
    if not any(options.values()):
        return {}
    return options | {"event_timer": made.event_timer / 1000.0}


def _misbehave(cell: DrawnCell, recipe: CellRecipe, name: str) -> None:
    """Let 6062h show the configured value, and let the drive itself limit nothing that the cell file allows."""
    axis, drive = recipe.axis(name), cell.drive(name)
    for index, sub, value in _WIDE:
        with suppress(SdoAbort):
            cell.device(name).write(index, sub, value)
    if axis.demand == "real":
        return
    shows = _zero if axis.demand == "zero" else _Target()
    publish: Callable[[], None] = drive._publish

    def published() -> None:
        publish()
        drive.position_demand = shows(drive)

    drive._publish = published  # type: ignore[method-assign]
    published()


def _zero(_: Drive) -> int:
    return 0


class _Target:
    """Shows the target of a pp move from its acknowledgement on, before it the position; in other modes the correct demand."""

    def __init__(self) -> None:
        self._taken: int | None = None

    def __call__(self, drive: Drive) -> int:
        if drive.power.stage.name != "ENABLED" or drive.mode_display != _PP:
            self._taken = None
            return drive.position_demand
        if drive.statusword & 0x1000:
            self._taken = as_int32(drive.target_position)
        return drive.position if self._taken is None else self._taken


# -- the cell file -------------------------------------------------------------------------------------------------------


def cell_text(recipe: CellRecipe, models: Mapping[str, tuple[str, Eds]]) -> str:
    """Return the cell file."""
    lines = [
        "[bus]",
        'interface = "sim"',
        "bitrate = 1_000_000",
        f'scan_period = "{recipe.period}ms"',
        'heartbeat = "100ms"',
    ]
    for name in recipe.names:
        lines += _axis_lines(recipe, name, *models[name])
    if recipe.group:
        names = ", ".join(f'"{name}"' for name in recipe.names[: recipe.group])
        lines += ["[groups.all]", f"axes = [{names}]"]
        lines += [f'on_fault = "{recipe.on_fault}"'] if recipe.on_fault else []
        lines += _KINEMATICS.get(recipe.kinematics, [])
    if recipe.gantry:
        skew = 8.0 * recipe.axes[0].velocity / NORM * max(1.0, recipe.period / 10.0)
        lines += [f"[gantries.{PAIR}]", 'axes = ["a", "b"]', f"max_skew = {skew:.9g}"]
    return "\n".join(lines) + "\n" + _BESIDE.get(recipe.beside, "")


def _axis_lines(recipe: CellRecipe, name: str, file: str, model: Eds) -> list[str]:
    axis, node = recipe.axis(name), FIRST_NODE + recipe.names.index(name)
    speed, ramp = axis.speed / axis.scale, axis.acceleration / axis.scale
    lines = [
        f"[nodes.{node}]",
        f'eds = "{file}"',
        *(['rejoin = "automatic"'] if axis.rejoin else []),
        f"[axes.{name}]",
        f"node = {node}",
        f'unit = "{axis.unit}"',
    ]
    if axis.unit != "increments":
        lines.append(f"scale = {axis.scale!r}")
    if axis.scaled:
        per = axis.scale * velocity_unit(axis)
        lines += [f"velocity_scale = {per:.12g}", f"acceleration_scale = {per:.12g}"]
    if axis.invert == "master" or (axis.invert and _writable(model, 0x607E)):
        lines.append(f'invert = "{axis.invert}"')
    if 0x6076 in model:
        lines.append("rated_torque = 10.0")
    if axis.edges is not None:
        lines.append(f"position_limits = [{axis.edges[0]!r}, {axis.edges[1]!r}]")
    if axis.endless:
        lines.append(f"modulo = {float(f'{speed:.3g}')!r}")
    lines += [f"max_velocity = {speed:.9g}", f"max_acceleration = {ramp:.9g}"]
    lines += [
        f"[axes.{name}.defaults]",
        f"velocity = {axis.ease[0] * speed:.9g}",
        f"acceleration = {axis.ease[1] * ramp:.9g}",
    ]
    if axis.jerk:
        lines.append(f"jerk = {axis.jerk * ramp:.9g}")
    lines += [f"[axes.{name}.homing]"]
    if 0x6098 in model and (axis.file in BUILTIN or axis.homed):
        lines.append("method = 35")
    if not axis.homed or recipe.gantry:
        lines.append("required = false")
    if axis.absolute:
        lines.append("absolute = true")
    stop = {
        "quick_stop": f'"{axis.words[0]}"',
        "halt": f'"{axis.words[1]}"',
        "disable": '"slow-ramp"',
        "fault": '"ramp"',
        "deceleration": f"{axis.stop * ramp:.9g}",
    }
    lines += [f"[axes.{name}.stop]"]
    lines += [f"{key} = {value}" for key, value in stop.items() if _writable(model, _OBJECTS[key])]
    # A command may ask for a fifth of max_acceleration, from max_velocity.
    times = max(2.0, 6.0 * axis.speed / axis.acceleration / min(1.0, axis.ease[1]))
    return [*lines, f'halt_time = "{times:.3g}s"', f'quick_stop_time = "{times:.3g}s"']


def _writable(model: Eds, index: int) -> bool:
    variable = model.get(index, 0)
    return variable is not None and variable.access.lower() in ("rw", "rww", "rwr")


_KINEMATICS = {
    "corexy": ["[groups.all.kinematics]", 'kind = "corexy"'],
    "scara": ["[groups.all.kinematics]", 'kind = "scara"', "upper = 200.0", "fore = 150.0"],
    "delta": [
        "[groups.all.kinematics]",
        'kind = "delta"',
        "upper = 200.0",
        "fore = 400.0",
        "base = 100.0",
        "plate = 40.0",
    ],
}
_COUNT = f"""[nodes.{output_rules.NODE}]
eds = "builtin:generic-cia401"
on_lost = "report"
[io.count]
node = {output_rules.NODE}
object = "6401h:01"
[axes.{ENCODER}]
encoder = "count"
unit = "mm"
scale = 40.96
"""
_VIRTUAL = f"""[axes.{VIRTUAL}]
virtual = true
unit = "mm"
max_velocity = 400.0
max_acceleration = 2000.0
[axes.{VIRTUAL}.defaults]
velocity = 100.0
acceleration = 500.0
[axes.{VIRTUAL}.stop]
deceleration = 2000.0
"""
_BESIDE = {"io": output_rules.TOML, "module": can_simple_rules.TOML, "encoder": _COUNT, "virtual": _VIRTUAL}
