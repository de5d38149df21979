"""The cells of the campaign, by name: their parts, how they are opened, and how exactly they can be judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from axisbus import eds
from axisbus.cia402.port import ValueTransport
from axisbus.errors import AxisbusError, ConfigError, SdoAbort
from kit.campaign import can_simple_rules, feed_forward_rules, output_rules
from kit.campaign.gantry.scene import AXES, open_pair
from kit.cell import Cell, Stage, cell_text
from kit.corpus import corpus_files
from kit.plants import PLANTS, Plant, bring_up, cell_on
from kit.sim.interpolated import write_eds
from kit.two_axis_drive import two_axis_cell

ROOT = Path(__file__).parents[3]
ACCELERATION = 1000.0  # deg/s²: max_acceleration and the quick stop's deceleration of the usual cell
_LIMITED = f"max_acceleration = {ACCELERATION}"
_STIFF = ("stiff", "stiff", "lagging", "lagging-much", "coasting", "compliant", "late-feedback")
_NO_DEMAND: Mapping[str, object] = {"inputs": {"demand": ValueTransport.NONE}}
_ON_CHANGE: Mapping[str, object] = {
    "event_timer": 0.1,
    "inputs": {
        "statusword": ValueTransport.EVENT_PDO,
        "mode": ValueTransport.EVENT_PDO,
        "position": ValueTransport.EVENT_PDO,
        "velocity": ValueTransport.SDO,
        "torque": ValueTransport.NONE,
        "demand": ValueTransport.SDO,
    },
    "outputs": {
        "controlword": ValueTransport.EVENT_PDO,
        "mode": ValueTransport.SDO,
        "target_position": ValueTransport.EVENT_PDO,
    },
}


class NotHere(Exception):
    """A scene that cannot be played on this computer, or not at all: its file is missing, or is no drive for this cell."""


@dataclass(frozen=True)
class Scene:
    """A kind of cell: its axes (one letter each), its possible plants, and its constructor.

    ``exact``: the plants follow their demands without ringing and without delay, so that jolts and limits can be judged.
    ``there``: deg within which a move that is done must be at its target. ``period``: seconds of its scan.
    ``pair``: the axes that carry one beam. ``travel``: the rules of motion, if they are not the usual ones.
    """

    open: Callable[[Stage, Plant], Cell]
    names: str = "xy"
    plants: tuple[str, ...] = ("stiff",)
    exact: bool = True
    there: float = 1.0
    period: float = 0.01
    pair: str = ""
    weight: int = 1
    travel: Callable[..., Any] | None = None


def _usual(stage: Stage, plant: Plant, *, limits: str = "", **changes: str) -> Cell:
    axis = "\n".join((_LIMITED, changes.pop("axis", "")))
    return cell_on(stage, plant, "xy", limits=limits, axis=axis, **changes)


def _with_outputs(stage: Stage, plant: Plant) -> Cell:
    return cell_on(stage, plant, "xy", axis=_LIMITED, more=output_rules.TOML, modules=(output_rules.NODE,))


def _beside_a_module(stage: Stage, plant: Plant) -> Cell:
    cell = cell_on(stage, plant, "xy", axis=_LIMITED, more=can_simple_rules.TOML)
    cell.machine[can_simple_rules.NAME].enable().wait(5)
    return cell


def _feeding_forward(stage: Stage, plant: Plant) -> Cell:
    return cell_on(stage, plant, "xy", axis=_LIMITED, more=feed_forward_rules.TOML)


def _interpolated(stage: Stage, plant: Plant) -> Cell:
    return cell_on(stage, plant, "xy", axis=_LIMITED, eds=write_eds(stage.folder))


def _by_port(stage: Stage, plant: Plant, *, port: Mapping[str, object]) -> Cell:
    return cell_on(stage, plant, "xy", axis=_LIMITED, port=port)


def _example(stage: Stage, _plant: Plant) -> Cell:
    """The cell of the examples as it is; its axes are homed at their positions."""
    cell = stage.simulated(text=(ROOT / "examples" / "cell.toml").read_text(encoding="utf-8"))
    for axis in cell.machine:
        axis.enable().wait(5)
        axis.home().wait(5)
    return cell


def _two_axes(stage: Stage, plant: Plant) -> Cell:
    text = two_axis_cell(stage.folder, axis=f"{_LIMITED}\nrated_torque = 10.0\nstandstill_window = 0.5")
    cell = stage.simulated("xy", text=text)
    return bring_up(cell, plant, "xy")


def _of_maker(stage: Stage, _plant: Plant, *, file: str) -> Cell:
    """Two drives of a maker's file, written only with objects of the file."""
    path = next((path for path in corpus_files() if path.name == file), None)
    if path is None:
        raise NotHere(f"{file} is not here")
    try:
        cell = stage.simulated("xy", text=_text_for(path))
    except ConfigError as error:
        raise NotHere(f"{file} is no drive for this cell: {error.message}") from error
    for axis in cell.machine:
        with suppress(SdoAbort):  # the file's own window may be smaller than the lag of our motor
            cell.device(axis.name).write(0x6065, 0, 0xFFFF_FFFF)
        try:
            axis.enable().wait(5)
        except AxisbusError as error:
            raise NotHere(f"{file} makes a drive that cannot be enabled: {error.message}") from error
    return cell


_NEEDS = {"quick_stop": 0x605A, "halt": 0x605D, "disable": 0x605C, "fault": 0x605E, "rated_torque": 0x6076}


@cache
def _text_for(path: Path) -> str:
    model = eds.load(path)
    text = cell_text("xy", eds=str(path), axis="standstill_window = 0.5\nrated_torque = 10.0\n" + _LIMITED)
    lines = [line for line in text.splitlines() if _NEEDS.get(line.split(" =")[0], 0x1000) in model]
    kept = "\n".join(lines) + "\n"
    return kept if 0x6085 in model else kept.replace("deceleration = 1000.0\n", "")


_MORE: Mapping[str, Plant] = {"braked": Plant({"load": 300.0, "brake": True}, loaded=True)}


def plant_of(name: str) -> Plant:
    """Return a plant by its name."""
    return _MORE.get(name) or PLANTS[name]


_PAIR_PLANTS = ("stiff", "stiff", "lagging")  # a bent beam turns a motor that coasts for long
_PAIRS: Mapping[str, Scene] = {
    "gantry": Scene(open_pair, plants=_PAIR_PLANTS, pair=AXES, weight=0),
    "gantry-homed": Scene(partial(open_pair, homes=True), plants=_PAIR_PLANTS, pair=AXES, weight=0),
    "gantry-beside": Scene(
        partial(open_pair, names="xyz", stiff=0.0, offset=3.0, bus='on_lost_node = "report"'),
        "xyz",
        plants=_PAIR_PLANTS,
        pair=AXES,
        weight=0,
    ),
    "gantry-soft": Scene(partial(open_pair, stiff=0.02), plants=_PAIR_PLANTS, pair=AXES, weight=0),
}
SCENES: Mapping[str, Scene] = {
    "usual": Scene(_usual, plants=_STIFF, weight=4),
    "ranged": Scene(
        partial(_usual, limits="position_limits = [-150.0, 150.0]"),
        plants=("stiff", "lagging", "coasting"),
        weight=3,
    ),
    "example": Scene(_example, names="xyz", period=0.004),
    "free-running": Scene(partial(_usual, bus="sync = false"), plants=("stiff", "lagging")),
    "on-change": Scene(partial(_by_port, port=_ON_CHANGE)),
    "no-demand": Scene(partial(_by_port, port=_NO_DEMAND), plants=("stiff", "lagging")),
    "endless": Scene(partial(_usual, limits="modulo = 360.0"), plants=("stiff", "coasting")),
    "held-by-torque": Scene(
        partial(_usual, axis='holds_load = "torque"', stop='quick_stop = "ramp-hold"'),
        plants=("sagging", "compliant"),
        exact=False,
    ),
    "held-by-brake": Scene(partial(_usual, axis='holds_load = "brake"'), plants=("braked",), exact=False),
    "two-axes": Scene(_two_axes),
    "outputs": Scene(_with_outputs, plants=_STIFF, weight=0),  # instead of some usual ones
    "module": Scene(_beside_a_module, plants=_STIFF, weight=0),  # as well
    "feed-forward": Scene(_feeding_forward, plants=_STIFF, weight=0),  # as well
    "interpolated": Scene(
        _interpolated, plants=("stiff", "lagging", "coasting"), weight=0
    ),  # instead of some ranged ones
    **_PAIRS,  # of some seeds
}


def makers() -> tuple[str, ...]:
    """The names of the makers' files that may be drives, in order; none where the collection is not here."""
    return tuple(sorted(path.name for path in corpus_files()))


def scene_of(name: str) -> Scene:
    """Return a scene by its name; ``of:FILE`` is one on drives of a maker's file."""
    if name.startswith("of:"):
        return Scene(partial(_of_maker, file=name.removeprefix("of:")), exact=False)
    return SCENES[name]
