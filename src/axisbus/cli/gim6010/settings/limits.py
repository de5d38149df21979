"""``axisbus gim6010 limits``: the module's own limits of velocity and current."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options
from axisbus.cli.gim6010.settings.common import end, put, save_option, show, with_module
from axisbus.cli.shared.common import OK, say

if TYPE_CHECKING:
    from axisbus.cli.gim6010.modbus.target_module import ModbusTarget


@click.command("limits")
@click.option("--velocity", type=float, help="In turns/s of the rotor.")
@click.option("--current", type=float, help="In A of the motor, at most 50.")
@module_options
@save_option
def command(asked: ModuleSelection, velocity: float | None, current: float | None, save: bool) -> int:
    """Set the module's own limits of velocity and motor current, only while it is idle; with neither, show them.

    With --list, or over --usb, they are written as parameters and read back. Otherwise both have to be given, and are sent in
    one message (Set_Limits) that owners have seen to work, but that nothing confirms: the limits apply until the next start,
    and --save is refused. Over --modbus they are registers, read back.
    """
    from axisbus.drives.gim6010.settings import limits

    if velocity is None and current is None:
        return show(asked, limits.PATHS)
    wanted = limits.wanted(velocity, current)
    _say_output(velocity)
    if asked.listed is None and asked.serial is not None:
        return _by_register(asked, asked.serial, {"velocity": velocity, "current": current}, save=save)
    if asked.listed is None and asked.usb is None:
        return _by_message(asked, velocity, current, save=save)
    code = with_module(asked, lambda module: put(module, wanted, save=save), wanted.over_usb)
    if code == OK:
        end(asked, _typed({"velocity": velocity, "current": current}), saved=save)
    return code


def _typed(limits: Mapping[str, float | None]) -> str:
    return " ".join(
        ["limits", *(f"--{name} {value:g}" for name, value in limits.items() if value is not None)]
    )


def _by_register(
    asked: ModuleSelection, serial: ModbusTarget, limits: Mapping[str, float | None], *, save: bool
) -> int:
    from axisbus.cli.gim6010.modbus.target_module import opened
    from axisbus.cli.gim6010.modbus.values import show
    from axisbus.drives.gim6010.modbus.registers import named

    with opened(serial) as module:
        module.require_idle("its limits are set")
        for name, value in ((f"{name}_limit", value) for name, value in limits.items() if value is not None):
            before = show(named(name), module.read(name))
            say(f"{name} = {show(named(name), module.write(name, value))} (was {before})")
        if save:
            module.save()
    end(asked, _typed(limits), saved=save)
    return OK


def _say_output(velocity: float | None) -> None:
    from axisbus.drives.gim6010.make import GEAR_RATIO

    if velocity is not None:
        say(
            f"{velocity:g} turns/s of the rotor are {velocity / GEAR_RATIO:g} turns/s of the output at {GEAR_RATIO}:1"
        )


def _by_message(asked: ModuleSelection, velocity: float | None, current: float | None, *, save: bool) -> int:
    if velocity is None or current is None:
        raise click.UsageError(
            "without --list both limits go out in one message: give --velocity and --current"
        )
    if save:
        raise click.UsageError(
            "unconfirmed limits are not saved: give the firmware's list with --list, or save over USB"
        )
    from axisbus.bus.gim6010.limits_by_message import ModuleByMessage
    from axisbus.cli.gim6010.settings.message_client import line_of

    with ExitStack() as stack:
        line = line_of(asked, stack)
        module = ModuleByMessage(line)
        stack.enter_context(line)
        module.set_limits(velocity, current)
    say(
        f"sent to module {asked.node}: {velocity:g} turns/s and {current:g} A; nothing confirms it, and its next start undoes it"
    )
    return OK
