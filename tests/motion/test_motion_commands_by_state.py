"""Each command in each situation, by a table: the end of its handle, the state of the axis afterwards, and the motion.

The table is ``commands_by_state.csv``; with ``AXISBUS_UPDATE_GOLDEN=1`` it is written again, to be read before it is kept.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.motion.plant_recorder import Watch
from kit.motion.situations import SITUATIONS

TABLE = Path(__file__).parent / "commands_by_state.csv"
COLUMNS = ["situation", "command", "ends", "because", "axis", "transitions", "modes", "moves"]


COMMANDS: dict[str, Callable] = {
    "enable": lambda x: x.enable(),
    "enable moving": lambda x: x.enable(allow_moving=True),
    "disable": lambda x: x.disable(),
    "coast": lambda x: x.disable(coast=True),
    "reset": lambda x: x.reset(),
    "halt": lambda x: x.halt(),
    "stop": lambda x: x.stop(),
    "release": lambda x: x.release(),
    "quick stop": lambda x: x.quick_stop(),
    "move absolute": lambda x: x.move_absolute(5.0),
    "move relative": lambda x: x.move_relative(5.0),
    "move additive": lambda x: x.move_additive(5.0),
    "move velocity": lambda x: x.move_velocity(20.0),
    "torque": lambda x: x.torque_control(0.2),
    "cyclic velocity": lambda x: x.cyclic_velocity(20.0),
    "cyclic torque": lambda x: x.cyclic_torque(0.2, slope=5.0),
    "home": lambda x: x.home(37),
    "set position": lambda x: x.set_position(1.0),
    "probe": lambda x: x.probe(),
    "probe abort": lambda x: x.probe_abort(),
    "superimposed": lambda x: x.move_superimposed(5.0),
    "halt superimposed": lambda x: x.halt_superimposed(),
    "follow": lambda x: x.follow(TrapezoidalTrajectory(x.position, x.position + 2.0, 20.0, 100.0)),
}


def tried(situation: str, command: str) -> dict[str, str]:
    """Return the table's row as it is today."""
    r = SITUATIONS[situation]()
    watch = Watch(r)
    handle = COMMANDS[command](r.axis)
    r.run(2.0)
    error = None if handle.busy else handle.exception()
    moved = watch.displacement / 1000.0
    return {
        "situation": situation,
        "command": command,
        "ends": handle.status.name.lower(),
        "because": "" if error is None else error.message,
        "axis": r.axis.state.name.lower(),
        "transitions": " ".join(map(str, watch.transitions)),
        "modes": " ".join(map(str, watch.modes)),
        "moves": f"{moved:.0f}",
    }


def rows() -> list[dict[str, str]]:
    with TABLE.open(newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


KNOWN = {(row["situation"], row["command"]): row for row in rows()} if TABLE.exists() else {}


@pytest.mark.parametrize("situation", SITUATIONS)
@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_in_each_situation_ends_as_in_the_table(situation, command):
    assert tried(situation, command) == KNOWN[situation, command]


def write() -> None:
    """Write the table again."""
    with TABLE.open("w", newline="") as file:
        file.write(
            "# What each command does in each situation, within 2 s: its handle's end, the axis's state, the transitions\n"
        )
        file.write(
            "# of the power stage, the modes that were asked for, and how far the motor goes (degrees).\n"
        )
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(tried(situation, command) for situation in SITUATIONS for command in COMMANDS)


if os.environ.get("AXISBUS_UPDATE_GOLDEN"):
    write()
