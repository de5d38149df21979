"""``axisbus gim6010 modbus``: the subcommands for a module with Modbus RTU."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

_HERE = "axisbus.cli.gim6010.modbus"
COMMANDS = {
    "find": (f"{_HERE}.find", "Ask one node ID after the other who is there, and how it is."),
    "state": (f"{_HERE}.state", "Tell how a module is: state, errors, modes, position, supply."),
    "errors": (f"{_HERE}.errors", "Tell every error of a module, and what to check; clear them."),
    "read": (f"{_HERE}.read", "Read registers, and parameters by their names."),
    "write": (f"{_HERE}.write", "Write settings, each read back; give it another node ID; save."),
    "move": (f"{_HERE}.move", "Enable a module and move it to a position."),
    "velocity": (f"{_HERE}.velocity", "Enable a module and let it turn."),
    "torque": (f"{_HERE}.torque", "Enable a module and let it push."),
    "zero": (f"{_HERE}.zero", "Let the position where it stands be 0, and save it."),
    "calibrate": (
        f"{_HERE}.calibrate",
        "Calibrate motor and encoder: the output may turn by itself; asks first.",
    ),
    "stop": (f"{_HERE}.stop", "Stop a module, whoever enabled it."),
}


@click.group(
    "modbus", cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]}
)
def command() -> None:
    """Reach a GIM6010-8 over RS485, by Modbus RTU: needs the extra axisbus[modbus].

    Only move, velocity, torque and calibrate give power to its motor. Nothing in a module notices a dead master over Modbus.
    Positions and velocities are turns of the rotor, 8 of which are one of the output. All was tried on simulated modules only.
    """
