"""``axisbus gim6010 modbus``: the subcommands for a module with Modbus RTU."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

_HERE = "axisbus.drives.gim6010.cli.modbus"
COMMANDS = {
    "find": (f"{_HERE}.find", "Ask one node ID after the other; show the state of each module found."),
    "state": (f"{_HERE}.registers:state_command", "Show a module: state, errors, modes, position, supply."),
    "errors": (
        f"{_HERE}.registers:errors_command",
        "Show every error of a module, and what to check; clear them.",
    ),
    "read": (f"{_HERE}.registers:read_command", "Read registers, and parameters by their names."),
    "write": (
        f"{_HERE}.registers:write_command",
        "Write settings, each read back; give it another node ID; save.",
    ),
    "move": (f"{_HERE}.motion:move_command", "Enable a module and move it to a position."),
    "velocity": (f"{_HERE}.motion:velocity_command", "Enable a module and turn it at a velocity."),
    "torque": (f"{_HERE}.motion:torque_command", "Enable a module and apply a torque."),
    "zero": (f"{_HERE}.registers:zero_command", "Set the present position to 0, and save it."),
    "calibrate": (
        f"{_HERE}.motion:calibrate_command",
        "Calibrate motor and encoder: the output may turn; asks first.",
    ),
    "stop": (f"{_HERE}.motion:stop_command", "Stop a module, whichever master enabled it."),
}


@click.group("modbus", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """Use a GIM6010-8 over RS485, by Modbus RTU: needs the extra axisbus[modbus].

    Only move, velocity, torque and calibrate energise its motor. A module cannot detect a dead master over Modbus. Positions
    and velocities are turns of the rotor; 8 of these are one turn of the output. All was tried on simulated modules only.
    """
