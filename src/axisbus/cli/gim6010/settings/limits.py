"""``axisbus gim6010 limits``: the module's own limits of velocity and current."""

from __future__ import annotations

from contextlib import ExitStack

import click

from axisbus.cli.gim6010.params.module import Asked, module_options
from axisbus.cli.gim6010.settings.common import end, put, save_option, show, with_module
from axisbus.cli.shared.common import OK, say


@click.command("limits")
@click.option("--velocity", type=float, help="In turns/s of the rotor.")
@click.option("--current", type=float, help="In A of the motor, at most 50.")
@module_options
@save_option
def command(asked: Asked, velocity: float | None, current: float | None, save: bool) -> int:
    """Set the module's own limits of velocity and motor current, only where it is idle; with neither, show them.

    With --list they are written as parameters and read back. Without, both have to be given, and go out in one message (Set_Limits)
    that owners saw at work and that nothing confirms: they hold until the next start, and --save is refused.
    """
    from axisbus.drives.gim6010.settings import limits

    if velocity is None and current is None:
        return show(asked, limits.PATHS)
    wanted = limits.wanted(velocity, current)
    _say_output(velocity)
    if asked.listed is None:
        return _by_message(asked, velocity, current, save=save)
    code = with_module(asked, lambda module: put(module, wanted, save=save), wanted.over_usb)
    if code == OK:
        given = (("--velocity", velocity), ("--current", current))
        end(
            asked,
            " ".join(["limits", *(f"{name} {value:g}" for name, value in given if value is not None)]),
            saved=save,
        )
    return code


def _say_output(velocity: float | None) -> None:
    from axisbus.drives.gim6010.make import GEAR_RATIO

    if velocity is not None:
        say(
            f"{velocity:g} turns/s of the rotor are {velocity / GEAR_RATIO:g} turns/s of the output at {GEAR_RATIO}:1"
        )


def _by_message(asked: Asked, velocity: float | None, current: float | None, *, save: bool) -> int:
    if velocity is None or current is None:
        raise click.UsageError(
            "without --list both limits go out in one message: give --velocity and --current"
        )
    if save:
        raise click.UsageError(
            "what nothing confirms is not saved: give the firmware's list with --list, or save over USB"
        )
    from axisbus.bus.dialogue.by_message import ModuleByMessage
    from axisbus.cli.gim6010.settings.line import line_of

    with ExitStack() as stack:
        line = line_of(asked, stack)
        module = ModuleByMessage(line)
        stack.enter_context(line)
        module.set_limits(velocity, current)
    say(
        f"sent to module {asked.node}: {velocity:g} turns/s and {current:g} A; nothing confirms it, and its next start undoes it"
    )
    return OK
