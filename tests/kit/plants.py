"""Plants that resist, by name: the motors behind the drives of a scenario's cell, and the commands that move them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace

from axisbus import eds
from axisbus.eds.builtin import resolve
from axisbus.machine.handle import Handle
from axisbus.sim.build import device_from_eds, motor_from_eds
from axisbus.sim.device import Device
from kit.cell import GENERIC, Cell, Stage, cell_text

MODULE = "builtin:generic-cia401"
SWITCH = 1.0e6  # increments: the position of the limit switch of a homing, far away
_LIMITS = "position_limits = [-3000.0, 3000.0]"
_OBJECTS = {0x6065: 0xFFFF_FFFF}  # a drive that pushes on, as many do
_HOMING = "method = 35\n"
_SEARCH = "method = 18\nspeed_switch = 60.0\nspeed_zero = 10.0\nacceleration = 500.0\n"


@dataclass(frozen=True)
class Plant:
    """Differences from the usual motor, and from the properties of the drive in the cell file.

    ``objects`` with other values, its fault settings ``dials``, and those set ``on_jam``; ``window``: the standstill window
    in deg, by which an axis at standstill may be pulled. ``loaded``: held by hand until it is enabled. ``jams``: so many seconds
    before the stop (after it, if negative) the scenario jams it.
    """

    motor: Mapping[str, float] = field(default_factory=dict)
    objects: Mapping[int, int] = field(default_factory=dict)
    dials: Mapping[str, object] = field(default_factory=dict)
    on_jam: Mapping[str, object] = field(default_factory=dict)
    window: float = 0.5
    loaded: bool = False
    jams: float | None = None


# 10 000 increments per turn, 100 per degree: a load of 60 ‰ behind 20 ‰ per increment droops by 0.03 deg, of 100 behind 1 by 1 deg.
# Without power friction holds these two; the sagging one falls.
PLANTS: Mapping[str, Plant] = {
    "stiff": Plant(),
    "lagging": Plant({"lag": 0.05}),
    "lagging-much": Plant({"lag": 0.2}),
    "coasting": Plant({"friction": 0.5, "coasting": 20.0}),
    "coasting-by-its-options": Plant({"friction": 2.0, "coasting": 5.0}, {0x605A: 0, 0x605C: 0, 0x605D: 0}),
    "jammed": Plant(jams=0.6),
    "jammed-just-before": Plant(jams=0.05),
    "jammed-while-it-stops": Plant(jams=-0.05),
    "jammed-with-a-lag": Plant({"lag": 0.2}, jams=0.05),
    "jammed-6062h-is-actual": Plant(dials={"demand_is_actual": True}, jams=0.6),
    "jammed-6062h-stuck": Plant(on_jam={"demand_frozen": True}, jams=0.6),
    "sticking": Plant({"lag": 0.05}, dials={"sticks": 60.0}),
    "late-feedback": Plant(dials={"feedback_delay": 0.15}),
    "creeping": Plant(dials={"drift_velocity": 500.0}),
    "creeping-openly": Plant(dials={"drift_velocity": 500.0, "creep_shown": True}),
    "compliant": Plant({"stiffness": 20.0, "damping": 0.1, "load": 60.0, "friction": 150.0}, loaded=True),
    "soft": Plant(
        {"stiffness": 1.0, "damping": 0.4, "load": 100.0, "friction": 150.0}, window=1.5, loaded=True
    ),
    "sagging": Plant({"load": 300.0}, loaded=True),
}


def devices(
    plant: Plant, names: str, folder: object, modules: Collection[int] = (), file: str = GENERIC
) -> Callable[[], Mapping[int, Device]]:
    """Return a function that makes the simulated drives of a cell, one node for each letter of ``names``, and I/O ``modules``."""

    def make() -> dict[int, Device]:
        model = eds.load(resolve(file, folder))  # type: ignore[arg-type]
        motor = replace(motor_from_eds(model), limit_switches=(None, SWITCH), **plant.motor)  # type: ignore[arg-type]
        made = {node: device_from_eds(model, node, motor, seed=node) for node, _ in enumerate(names, start=1)}
        module = eds.load(resolve(MODULE, folder))  # type: ignore[arg-type]
        return {**made, **{node: device_from_eds(module, node) for node in modules}}

    return make


def cell_on(
    stage: Stage,
    plant: Plant,
    names: str = "x",
    *,
    search: bool = False,
    limits: str = "",
    port: Mapping[str, object] | None = None,
    modules: Collection[int] = (),
    **changes: str,
) -> Cell:
    """Open a simulated cell on plants of this kind, enabled; the fault settings of the first are set.

    ``search``: its homing goes for a switch. ``limits``: the line of the axes' position limits. ``port``: as in
    ``Stage.simulated``. ``modules``: the nodes of ``more`` that are I/O modules.
    """
    axis = (
        "rated_torque = 10.0",
        f"standstill_window = {plant.window}",
        limits or _LIMITS,
        changes.pop("axis", ""),
    )
    text = cell_text(names, axis="\n".join(axis), **changes)
    if search:
        text = text.replace(_HOMING, _SEARCH)
    made = devices(plant, names, stage.folder, modules, changes.get("eds", GENERIC))
    cell = stage.simulated(names, text=text, devices=made, port=port)
    return bring_up(cell, plant, names)


def bring_up(cell: Cell, plant: Plant, names: str) -> Cell:
    """Write the plant's objects, enable every axis, and set the fault settings of the first."""
    for axis in cell.machine:
        if axis.name not in names:
            continue
        for index, value in {**_OBJECTS, **plant.objects}.items():
            cell.device(axis.name).write(index, 0, value)
        cell.drive(axis.name).dials.blocked = plant.loaded  # it is held by hand until it is enabled
        axis.enable().wait(5)
        cell.drive(axis.name).dials.blocked = False
    cell.run(1.0)
    for dial, value in plant.dials.items():
        setattr(cell.drive(names[0]).dials, dial, value)
    return cell


def jam(cell: Cell, plant: Plant, name: str = "x") -> None:
    """Let an axis jam as the plant does."""
    cell.jam(name)
    for dial, value in plant.on_jam.items():
        setattr(cell.drive(name).dials, dial, value)


class Ramp:
    """A way of many seconds: it speeds up to 100 deg/s with 100 deg/s² and continues."""

    duration = 60.0

    def __init__(self, start: float) -> None:
        self._start = start

    def position(self, t: float) -> float:
        return self._start + (50.0 * t * t if t < 1.0 else 50.0 + 100.0 * (t - 1.0))


def _follow(cell: Cell, name: str) -> Handle:
    """Begin at the position that the master uses: the demand once it is trusted, else the actual position under load."""
    reference = cell.core(name).image.reference
    assert reference is not None
    return cell[name].follow(Ramp(reference / cell.scale_of(name)))


def _torque(cell: Cell, name: str) -> float:
    """A torque that overcomes the resistance of the motor and leaves 12 ‰ to accelerate it."""
    params, dials = cell.drive(name).params, cell.drive(name).dials
    return (params.load + params.friction + dials.sticks + 12.0) * 0.01


# By mode: the command that moves an axis at about 60 to 100 deg/s.
MOTIONS: Mapping[str, Callable[[Cell, str], Handle]] = {
    "pp": lambda cell, name: cell[name].move_relative(2000.0, velocity=100.0),
    "pv": lambda cell, name: cell[name].move_velocity(90.0),
    "csp": _follow,
    "csv": lambda cell, name: cell[name].cyclic_velocity(90.0),
    "tq": lambda cell, name: cell[name].torque_control(_torque(cell, name)),
    "cst": lambda cell, name: cell[name].cyclic_torque(_torque(cell, name), slope=10.0),
    "hm": lambda cell, name: cell[name].home(),
}


def set_in_motion(cell: Cell, mode: str, names: str = "x") -> list[Handle]:
    """Bring the axes into motion in a mode, and let them get up to their speed; return their handles."""
    handles = [MOTIONS[mode](cell, name) for name in names]
    for name in names:
        cell.until(lambda name=name: cell.speed(name) > 50.0, 5.0)
    cell.run(0.3)
    return handles
