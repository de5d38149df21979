"""``axisbus gim6010 watchdog``: the watchdog by which a module detects that it gets no more commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options
from axisbus.cli.gim6010.settings.common import end, put, save_option, show, with_module
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.numbers import Seconds

if TYPE_CHECKING:
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters


@click.command("watchdog")
@click.option(
    "--break-timeout", "broken", type=Seconds(), help="For can.config.break_timeout, such as 500ms."
)
@click.option("--axis-timeout", "axis", type=Seconds(), help="For the axis's watchdog, such as 500ms.")
@click.option(
    "--off", "switched_off", is_flag=True, help="Switch both off, and clear the error that they have caused."
)
@module_options
@save_option
def command(
    asked: ModuleSelection, broken: float | None, axis: float | None, switched_off: bool, save: bool
) -> int:
    """Arm the watchdogs that disarm a module when no set-point arrives within a time, or switch them off; with no option, show
    them.

    Written as parameters and read back, only to a module that is idle. An armed watchdog runs from then on, also in idle.
    """
    from axisbus.drives.gim6010.settings import watchdog

    if switched_off and (broken is not None or axis is not None):
        raise click.UsageError("--off excludes the times")
    if broken is None and axis is None and not switched_off:
        return show(asked, watchdog.PATHS)
    wanted = watchdog.off() if switched_off else watchdog.wanted(broken, axis)

    def act(module: ModuleParameters) -> None:
        put(module, wanted, save=save)
        if switched_off and not save:
            _clear(module)

    code = with_module(asked, act, wanted.over_usb)
    if code == OK:
        given = (("--break-timeout", broken), ("--axis-timeout", axis))
        times = " ".join(f"{name} {value:g}s" for name, value in given if value is not None)
        end(asked, f"watchdog {times or '--off'}", saved=save)
    return code


def _clear(module: ModuleParameters) -> None:
    """Clear the error of a watchdog trip, if the axis reports no other one."""
    from axisbus.drives.gim6010.settings.watchdog import LATCHED

    error = module.axis_error
    if error and not error & ~LATCHED:
        module.clear_errors()
        say("the error that it had caused is cleared")
