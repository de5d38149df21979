"""``axisbus gim6010 modbus zero``: define the present position of a module as 0, and save it."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, list_options, opened, parameters
from axisbus.cli.gim6010.settings.zero import set_zero
from axisbus.cli.shared.common import OK, say, say_next


@click.command("zero")
@list_options
def command(target: ModbusTarget) -> int:
    """Set the present position of a module to 0, by its parameters (--list); the module saves it, and restarts.

    In idle only. After a start a module knows its position within one turn of the rotor, so it is the zero of this turn.
    Refused if its position does not agree with its encoder's count; then set it over USB.
    """
    with opened(target) as module:
        set_zero(parameters(target, module))
    say(f"module {target.node}: its zero is the present position; saved")
    say_next(f"axisbus gim6010 modbus state {target.words}")
    return OK
