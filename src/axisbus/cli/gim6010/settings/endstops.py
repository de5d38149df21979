"""``axisbus gim6010 endstops``: the module's own two limit switches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options
from axisbus.cli.gim6010.settings.common import end, put, save_option, show, with_module
from axisbus.cli.shared.common import OK

if TYPE_CHECKING:
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters

_SWITCH = click.Choice(["on", "off"])


@click.command("endstops")
@click.option("--min", "lowest", type=_SWITCH, help="LW1, at the lowest position.")
@click.option("--max", "highest", type=_SWITCH, help="LW2, at the highest position.")
@module_options
@save_option
def command(asked: ModuleSelection, lowest: str | None, highest: str | None, save: bool) -> int:
    """Switch the module's own limit switches on or off; with neither option, show them.

    Written as parameters and read back, only to a module that is idle. Refused for hardware that has none (3.7).
    """
    from axisbus.drives.gim6010.settings import endstops

    if lowest is None and highest is None:
        return show(asked, endstops.PATHS)
    wanted = endstops.wanted(*(None if each is None else each == "on" for each in (lowest, highest)))

    def act(module: ModuleParameters) -> None:
        endstops.require_hardware(module)
        put(module, wanted, save=save)

    code = with_module(asked, act, wanted.over_usb)
    if code == OK:
        given = (("--min", lowest), ("--max", highest))
        words = " ".join(f"{name} {state}" for name, state in given if state is not None)
        end(asked, f"endstops {words}", saved=save)
    return code
