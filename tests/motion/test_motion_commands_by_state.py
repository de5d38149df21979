"""Each command in each situation, by a table: how its handle ends, in which state the axis is then, and what moves.

The table is ``commands_by_state.csv``; with ``AXISBUS_UPDATE_GOLDEN=1`` it is written anew, to be read before it is kept.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from rig import Rig, rig
from watch import Watch

from axisbus.errors import DriveError
from axisbus.motion.parameters import HoldsLoad, Homing
from axisbus.motion.trajectory import Trapezoid
from axisbus.sim.motor import MotorParams

TABLE = Path(__file__).parent / "commands_by_state.csv"
COLUMNS = ["situation", "command", "ends", "because", "axis", "transitions", "modes", "moves"]


def _disabled() -> Rig:
    r = rig()
    r.run(0.1)
    return r


def _standing() -> Rig:
    return rig().enabled()


def _turning() -> Rig:
    r = _standing()
    r.axis.move_velocity(50.0).wait(3)
    return r


def _moving() -> Rig:
    r = _standing()
    r.axis.move_relative(50.0)
    r.run(0.3)
    return r


def _pushed() -> Rig:
    r = _standing()
    r.axis.torque_control(0.5)
    r.run(0.3)
    return r


def _halting() -> Rig:
    r = _turning()
    r.axis.halt()
    r.run(0.05)
    return r


def _halted() -> Rig:
    r = _moving()
    r.axis.halt().wait(3)
    return r


def _stopping() -> Rig:
    r = _turning()
    r.axis.stop()
    r.run(0.05)
    return r


def _stopped() -> Rig:
    r = _turning()
    r.axis.stop().wait(3)
    return r


def _quick_stopping() -> Rig:
    r = _turning()
    r.axis.quick_stop()
    r.run(0.05)
    return r


def _enabling() -> Rig:
    r = rig()
    r.run(0.1)
    r.axis.enable()
    r.run(0.03)
    return r


def _disabling() -> Rig:
    r = _turning()
    r.axis.disable()
    r.run(0.05)
    return r


def _coasting() -> Rig:
    r = _turning()
    r.axis.disable(coast=True)
    r.run(0.05)
    return r


def _found_turning() -> Rig:
    r = rig()
    r.drive.target_velocity = 50_000
    r.drive.start_enabled(3)
    r.run(0.5)
    return r


def _homing() -> Rig:
    switches = MotorParams(limit_switches=(-40_000.0, 30_000.0), increments_per_turn=16_384)
    search = Homing(method=37, speed_switch=30.0, speed_zero=5.0, acceleration=100.0)
    r = rig(motor=switches, homing=search).enabled()
    r.axis.home(17)
    r.run(0.3)
    return r


def _following() -> Rig:
    r = _standing()
    r.axis.follow(Trapezoid(0.0, 40.0, 50.0, 200.0))
    r.run(0.3)
    return r


def _jogging() -> Rig:
    r = _standing()
    r.axis.jog(30.0)
    r.run(0.1)
    return r


def _resetting() -> Rig:
    r = _in_fault()
    r.drive.dials.fault_persists = True
    r.axis.reset()
    r.run(0.02)
    return r


def _in_fault() -> Rig:
    r = _turning()
    r.drive.fault(0x2310)
    r.run(1.5)
    return r


def _error_stop() -> Rig:
    r = _turning()
    r.scan.axes[r.axis.name].fail(DriveError("made by hand"))
    r.run(1.5)
    return r


def _found_enabled() -> Rig:
    r = rig()
    r.drive.start_enabled(1)
    r.run(0.3)
    return r


def _held() -> Rig:
    """In quick stop active, where its option code leaves it."""
    r = rig(quick_stop_holds=True)
    r.device.write(0x605A, 0, 6)
    r.enabled()
    r.axis.quick_stop().wait(3)
    return r


def _loaded() -> Rig:
    return rig(holds_load=HoldsLoad.TORQUE).enabled()


SITUATIONS: dict[str, Callable[[], Rig]] = {
    "disabled": _disabled,
    "standing": _standing,
    "turning": _turning,
    "moving": _moving,
    "pushed": _pushed,
    "halting": _halting,
    "halted": _halted,
    "stopping": _stopping,
    "stopped": _stopped,
    "quick stopping": _quick_stopping,
    "enabling": _enabling,
    "in fault": _in_fault,
    "error stop": _error_stop,
    "loaded": _loaded,
    "found enabled": _found_enabled,
    "held": _held,
    "disabling": _disabling,
    "coasting": _coasting,
    "found turning": _found_turning,
    "homing": _homing,
    "following": _following,
    "jogging": _jogging,
    "resetting": _resetting,
}
COMMANDS: dict[str, Callable] = {
    "enable": lambda x: x.enable(),
    "enable moving": lambda x: x.enable(moving=True),
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
    "home": lambda x: x.home(37),
    "set position": lambda x: x.set_position(1.0),
    "follow": lambda x: x.follow(Trapezoid(x.position, x.position + 2.0, 20.0, 100.0)),
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
def test_a_command_does_in_each_situation_what_the_table_says(situation, command):
    assert tried(situation, command) == KNOWN[situation, command]


def write() -> None:
    """Write the table anew."""
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
