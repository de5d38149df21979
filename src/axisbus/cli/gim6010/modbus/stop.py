"""``axisbus gim6010 modbus stop``: velocity 0, idle, emergency stop, until a module is at standstill without power."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, opened, target_options
from axisbus.cli.shared.common import OK, say


@click.command("stop")
@target_options
def command(target: ModbusTarget) -> int:
    """Stop a module, whoever enabled it: velocity 0 on its own ramp, then idle, then emergency stop where idle is not seen.

    Each Ctrl-C goes a step further at once. Sent also where it does not answer. Exit code 3 where it is not confirmed as stopped.
    Another master that goes on commanding it enables it again: stop that first.
    """
    from axisbus.drives.gim6010.modbus.motion.stopping import stop

    with opened(target) as module:
        stop(module, tell=say)
    return OK
