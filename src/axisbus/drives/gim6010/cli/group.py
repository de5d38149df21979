"""``axisbus gim6010`` with its groups ``params`` and ``modbus``: find and inspect modules, in any of their protocols."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup, Table


def _table(**rows: tuple[str, str]) -> Table:
    """Return the table of a group; each row is a module of this package (or ``module:name``), and its line of help."""
    return {name.replace("_", "-"): (f"{__package__}.{place}", text) for name, (place, text) in rows.items()}


@click.group(
    cls=LazyGroup,
    table=_table(
        find=("find", "Find the modules on a bus, and show the protocol of each."),
        errors=("find:errors_command", "Show every error of a module, and what to check."),
        params=("group:params", "Read, write, back up and restore parameters by name."),
        set_id=(
            "settings.connection:set_id_command",
            "Give a module that speaks CAN Simple another node ID.",
        ),
        set_bitrate=(
            "settings.connection:set_bitrate_command",
            "Give a module that is alone another bit rate.",
        ),
        zero=("settings.commands:zero_command", "Set the present position of a module as its zero."),
        limits=("settings.commands:limits_command", "Show or set a module's limits of velocity and current."),
        termination=("settings.commands:termination_command", "Switch a module's terminating resistor."),
        watchdog=(
            "settings.commands:watchdog_command",
            "Show, arm or switch off the watchdogs that detect a dead master.",
        ),
        endstops=("settings.commands:endstops_command", "Switch a module's own limit switches."),
        brake_resistor=("settings.commands:brake_resistor_command", "Switch a braking resistor."),
        pwm=("settings.commands:pwm_command", "Map the pulses of a remote control, and show the steps."),
        pulses=(
            "settings.commands:pulses_command",
            "Show the size of a pulse of pulse and direction, and the steps.",
        ),
        calibrate=("calibrate", "Calibrate a module, which turns its motor; asks before."),
        modbus=("group:modbus", "Read, write, calibrate and stop a module over RS485 (Modbus RTU)."),
        tune=("tune", "Try gains by a measured step, which turns a module; asks before."),
        to_canopen=("settings.connection:to_canopen_command", "Change a module from CAN Simple to CANopen."),
        to_can_simple=(
            "settings.connection:to_can_simple_command",
            "Change a module back to CAN Simple, or show the steps.",
        ),
    ),
)
def command() -> None:
    """Find and inspect GIM6010-8 modules, in any of their protocols.

    No command here enables or turns a module, except those that ask before. All commands were tried on simulated modules only.
    """


@click.group(
    cls=LazyGroup,
    table=_table(
        get=("params:get_command", "Read parameters by name."),
        set=("params:set_command", "Write parameters by name, each read back; --save stores them."),
        dump=("params:dump_command", "Read every parameter that can be read."),
        backup=("params:backup_command", "Write the settings of a module into a file."),
        restore=("params:restore_command", "Write the settings of a backup to a module."),
        diff=(
            "params:diff_command",
            "Show the differences between backups, or a backup and a module.",
        ),
    ),
)
def params() -> None:
    """Read and write a module's parameters by their names (without odrv0.), over CAN Simple, Modbus RTU (--modbus) or USB
    (--usb).

    Except over USB, the list of endpoints (--list) is needed, the maker's file for exactly this firmware. A list of another
    firmware is refused: the numbers differ, and a wrong number may erase the module. No function of the module is called.
    """


@click.group(
    cls=LazyGroup,
    table=_table(
        find=(
            "modbus.registers:find_command",
            "Ask one node ID after the other; show the state of each module found.",
        ),
        state=("modbus.registers:state_command", "Show a module: state, errors, modes, position, supply."),
        errors=(
            "modbus.registers:errors_command",
            "Show every error of a module, and what to check; clear them.",
        ),
        read=("modbus.registers:read_command", "Read registers, and parameters by their names."),
        write=(
            "modbus.registers:write_command",
            "Write settings, each read back; give it another node ID; save.",
        ),
        zero=("modbus.registers:zero_command", "Set the present position to 0, and save it."),
        calibrate=(
            "calibrate:modbus_calibrate_command",
            "Calibrate motor and encoder: the output may turn; asks first.",
        ),
        stop=("modbus.registers:stop_command", "Stop a module, whichever program enabled it."),
    ),
)
def modbus() -> None:
    """Use a GIM6010-8 over RS485, by Modbus RTU: needs the extra axisbus[modbus].

    Only calibrate energises its motor. To move a module, make it an axis of a cell file: interface = "modbus" in [bus], then
    axisbus check, boot and move. A module cannot detect a dead master over Modbus. Positions and velocities are turns of the
    rotor; 8 of these are one turn of the output. All commands were tried on simulated modules only.
    """
