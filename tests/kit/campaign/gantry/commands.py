"""The commands of a pair, and of groups that hold it, by name; each begins with ``pair_``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle
from kit.campaign.gantry.scene import AXES, NAME
from kit.cell import Cell

WIDE = 40.0  # deg: of an enable with a wider bound
GOAL = 150.0  # deg: the goal of move_absolute for the beam, times its number
Give = Callable[[Cell, float], Handle]


def _enable(cell: Cell, value: float) -> Handle:
    return cell.machine.gantry(NAME).enable(skew=WIDE if value > 0.3 else None)


def _square(cell: Cell, value: float) -> Handle:
    """One axis, by a distance or until the beam is square."""
    axis = "x" if value < -0.3 else None
    return cell.machine.gantry(NAME).square(axis, 6.0 * value if abs(value) > 0.8 else None, velocity=30.0)


def _velocity(cell: Cell, value: float) -> Handle:
    """Until something else is wanted, or for some seconds: far away there is a limit switch."""
    cell.after(8.0, lambda: _try(cell.machine.gantry(NAME).halt))
    return cell.machine.gantry(NAME).move_velocity(200.0 * value)


def _try(give: Callable[[], object]) -> None:
    with suppress(AxisbusError):
        give()


def _override(cell: Cell, value: float) -> Handle:
    return cell.machine.gantry(NAME).set_override(0.0 if value < -0.8 else 0.1 + 1.4 * abs(value))


def _group_line(cell: Cell, value: float) -> Handle:
    """All axes along a line that keeps the beam square; each fifth does not, and is refused."""
    names = [axis.name for axis in cell.machine]
    bent = 3.0 if round(abs(value) * 100) % 5 == 0 else 0.0
    ends = {"x": 100.0 * value, "y": 100.0 * value + cell.machine.cell.gantries[NAME].offset + bent}
    group = cell.machine.group(*names)
    return group.move_linear([ends.get(name, -80.0 * value) for name in names], velocity=100.0)


PAIR: Mapping[str, Give] = {
    "pair_enable": _enable,
    "pair_disable": lambda cell, _: cell.machine.gantry(NAME).disable(),
    "pair_reset": lambda cell, _: cell.machine.gantry(NAME).reset(),
    "pair_halt": lambda cell, _: cell.machine.gantry(NAME).halt(),
    "pair_stop": lambda cell, _: cell.machine.gantry(NAME).stop(),
    "pair_release": lambda cell, _: cell.machine.gantry(NAME).release(),
    "pair_quick_stop": lambda cell, _: cell.machine.gantry(NAME).quick_stop(),
    "pair_move_absolute": lambda cell, value: cell.machine.gantry(NAME).move_absolute(
        GOAL * value, velocity=50.0 + 150.0 * abs(value)
    ),
    "pair_move_relative": lambda cell, value: cell.machine.gantry(NAME).move_relative(
        80.0 * value, acceleration=300.0 + 700.0 * abs(value)
    ),
    "pair_move_additive": lambda cell, value: cell.machine.gantry(NAME).move_additive(40.0 * value),
    "pair_move_softly": lambda cell, value: cell.machine.gantry(NAME).move_relative(
        80.0 * value, jerk=4000.0 + 16000.0 * abs(value)
    ),
    "pair_move_waiting": lambda cell, value: cell.machine.gantry(NAME).move_relative(
        30.0 * value, buffer=True
    ),
    "pair_move_velocity": _velocity,
    "pair_resume": lambda cell, _: cell.machine.gantry(NAME).resume(),
    "pair_override": _override,
    "pair_home": lambda cell, _: cell.machine.gantry(NAME).home(),
    "pair_set_position": lambda cell, value: cell.machine.gantry(NAME).set_position(60.0 * value),
    "pair_set_square": lambda cell, value: cell.machine.gantry(NAME).set_position(60.0 * value, square=True),
    "pair_square": _square,
    "pair_group_line": _group_line,
    "pair_group_enable": lambda cell, _: cell.machine.group(*AXES).enable(),
    "pair_group_halt": lambda cell, _: cell.machine.group(*(axis.name for axis in cell.machine)).halt(),
}

MOTIONS = (
    *("pair_move_absolute", "pair_move_absolute", "pair_move_relative", "pair_move_additive"),
    *("pair_move_softly", "pair_move_waiting", "pair_move_velocity", "pair_move_velocity", "pair_resume"),
    *("pair_override", "pair_home", "pair_home", "pair_square", "pair_group_line", "pair_group_line"),
)
STOPS = ("pair_halt", "pair_halt", "pair_stop", "pair_quick_stop", "pair_disable", "pair_group_halt")
# Commands that an axis of the pair refuses alone, and commands that stop both.
ALONE = (
    *("move_relative", "move_absolute", "move_velocity", "jog", "torque", "cyclic_velocity", "home", "gear"),
    *(
        "follow",
        "set_position",
        "enable",
        "halt",
        "stop",
        "quick_stop",
        "disable",
        "coast",
        "reset",
        "release",
    ),
    *("axis_override", "probe", "controller"),
)


def kind_and_axes(what: str, names: str) -> tuple[str, str]:
    """Return the kind of a command of a pair for the rules, and its axes; ``names``: all."""
    plain = what.removeprefix("pair_")
    together = plain.startswith("group_") and plain != "group_enable"
    return plain.removeprefix("group_"), names if together else AXES
