"""``axisbus gim6010 modbus stop``: velocity 0, idle, emergency stop, until a module is at standstill without power."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, opened, target_options
from axisbus.cli.shared.common import OK, say


@click.command("stop")
@target_options
def command(target: ModbusTarget) -> int:
    """Stop a module, whichever master enabled it: velocity 0 on its own ramp, then idle, then emergency stop if idle is not
    confirmed.

    Each Ctrl-C goes to the next step at once. The stop is also sent if the module does not answer. Exit code 3 if it is not
    confirmed as stopped. Another master that continues to command the module enables it again: stop that master first.
    """
    from axisbus.drives.gim6010.modbus.motion.stopping import stop

    with opened(target) as module:
        stop(module, tell=say)
    return OK
