"""``axisbus gim6010``: find and inspect modules of this product family, in any of their protocols."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "find": ("axisbus.drives.gim6010.cli.find", "Find the modules on a bus, and show the protocol of each."),
    "errors": ("axisbus.drives.gim6010.cli.errors", "Show every error of a module, and what to check."),
    "params": (
        "axisbus.drives.gim6010.cli.params.group",
        "Read, write, back up and restore parameters by name.",
    ),
    "set-id": ("axisbus.drives.gim6010.cli.set_id", "Give a module that speaks CAN Simple another node ID."),
    "set-bitrate": (
        "axisbus.drives.gim6010.cli.settings.set_bitrate",
        "Give a module that is alone another bit rate.",
    ),
    "zero": ("axisbus.drives.gim6010.cli.settings.zero", "Set the present position of a module as its zero."),
    "limits": (
        "axisbus.drives.gim6010.cli.settings.commands:limits_command",
        "Show or set a module's limits of velocity and current.",
    ),
    "termination": (
        "axisbus.drives.gim6010.cli.settings.commands:termination_command",
        "Switch a module's terminating resistor.",
    ),
    "watchdog": (
        "axisbus.drives.gim6010.cli.settings.commands:watchdog_command",
        "Show, arm or switch off the watchdogs that detect a dead master.",
    ),
    "endstops": (
        "axisbus.drives.gim6010.cli.settings.commands:endstops_command",
        "Switch a module's own limit switches.",
    ),
    "brake-resistor": (
        "axisbus.drives.gim6010.cli.settings.commands:brake_resistor_command",
        "Switch a braking resistor.",
    ),
    "pwm": (
        "axisbus.drives.gim6010.cli.settings.commands:pwm_command",
        "Map the pulses of a remote control, and show the steps.",
    ),
    "pulses": (
        "axisbus.drives.gim6010.cli.settings.commands:pulses_command",
        "Show the size of a pulse of pulse and direction, and the steps.",
    ),
    "calibrate": (
        "axisbus.drives.gim6010.cli.calibrate",
        "Calibrate a module, which turns its motor; asks before.",
    ),
    "modbus": (
        "axisbus.drives.gim6010.cli.modbus.group",
        "Read, write, move and stop a module over RS485 (Modbus RTU).",
    ),
    "tune": (
        "axisbus.drives.gim6010.cli.tune",
        "Try gains by a measured step, which turns a module; asks before.",
    ),
    "to-canopen": (
        "axisbus.drives.gim6010.cli.protocol_change:to_canopen_command",
        "Change a module from CAN Simple to CANopen.",
    ),
    "to-can-simple": (
        "axisbus.drives.gim6010.cli.protocol_change:to_can_simple_command",
        "Change a module back to CAN Simple, or show the steps.",
    ),
}


@click.group(cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """Find and inspect GIM6010-8 modules, in any of their protocols.

    No command here enables or turns a module, except those that ask before, and modbus move, velocity and torque. All of it was
    tried on simulated modules only.
    """
