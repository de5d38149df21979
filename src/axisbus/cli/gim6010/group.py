"""``axisbus gim6010``: find and inspect modules of this product family, in any of their protocols."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "find": ("axisbus.cli.gim6010.find", "Find the modules on a bus, and show the protocol of each."),
    "errors": ("axisbus.cli.gim6010.errors", "Show every error of a module, and what to check."),
    "params": ("axisbus.cli.gim6010.params.group", "Read, write, back up and restore parameters by name."),
    "set-id": ("axisbus.cli.gim6010.set_id", "Give a module that speaks CAN Simple another node ID."),
    "set-bitrate": (
        "axisbus.cli.gim6010.settings.set_bitrate",
        "Give a module that is alone another bit rate.",
    ),
    "zero": ("axisbus.cli.gim6010.settings.zero", "Set the present position of a module as its zero."),
    "limits": (
        "axisbus.cli.gim6010.settings.commands:limits_command",
        "Show or set a module's limits of velocity and current.",
    ),
    "termination": (
        "axisbus.cli.gim6010.settings.commands:termination_command",
        "Switch a module's terminating resistor.",
    ),
    "watchdog": (
        "axisbus.cli.gim6010.settings.commands:watchdog_command",
        "Show, arm or switch off the watchdogs that detect a dead master.",
    ),
    "endstops": (
        "axisbus.cli.gim6010.settings.commands:endstops_command",
        "Switch a module's own limit switches.",
    ),
    "brake-resistor": (
        "axisbus.cli.gim6010.settings.commands:brake_resistor_command",
        "Switch a braking resistor.",
    ),
    "pwm": (
        "axisbus.cli.gim6010.settings.commands:pwm_command",
        "Map the pulses of a remote control, and show the steps.",
    ),
    "pulses": (
        "axisbus.cli.gim6010.settings.commands:pulses_command",
        "Show the size of a pulse of pulse and direction, and the steps.",
    ),
    "calibrate": ("axisbus.cli.gim6010.calibrate", "Calibrate a module, which turns its motor; asks before."),
    "modbus": (
        "axisbus.cli.gim6010.modbus.group",
        "Read, write, move and stop a module over RS485 (Modbus RTU).",
    ),
    "tune": (
        "axisbus.cli.gim6010.tune",
        "Try gains by a measured step, which turns a module; asks before.",
    ),
    "to-canopen": (
        "axisbus.cli.gim6010.protocol_change:to_canopen_command",
        "Change a module from CAN Simple to CANopen.",
    ),
    "to-can-simple": (
        "axisbus.cli.gim6010.protocol_change:to_can_simple_command",
        "Change a module back to CAN Simple, or show the steps.",
    ),
}


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Find and inspect GIM6010-8 modules, in any of their protocols.

    No command here enables or turns a module, except those that ask before, and modbus move, velocity and torque. All of it was
    tried on simulated modules only.
    """
