"""``axisbus gim6010 termination``: the module's own resistor of 120 Ω, on or off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options
from axisbus.cli.gim6010.settings.common import end, put, save_option, show, with_module
from axisbus.cli.shared.common import OK

if TYPE_CHECKING:
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters


@click.command("termination")
@click.argument("state", type=click.Choice(["on", "off"]), required=False)
@module_options
@save_option
def command(asked: ModuleSelection, state: str | None, save: bool) -> int:
    """Switch the module's own terminating resistor of 120 Ω on or off; without ON or OFF, show it.

    Written as a parameter and read back, only to a module that is idle. If it answers no endpoint, the steps over USB are
    shown.
    """
    from axisbus.drives.gim6010.settings import termination

    if state is None:
        return show(asked, (termination.ENABLED, termination.PIN))
    wanted = termination.wanted(on=state == "on")

    def act(module: ModuleParameters) -> None:
        termination.require_switch(module)
        put(module, wanted, save=save)

    code = with_module(asked, act, wanted.over_usb)
    if code == OK:
        end(asked, f"termination {state}", saved=save)
    return code
