"""``axisbus gim6010 modbus errors``: print every error of a module with its name and explanation, and clear them."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, opened, target_options
from axisbus.cli.shared.common import OK, WRONG, say, say_json


@click.command("errors")
@target_options
@click.option("--clear", is_flag=True, help="Clear them, and show those that remain; in idle only.")
@click.option("--json", "as_json", is_flag=True, help="Print the error words as JSON.")
def command(target: ModbusTarget, clear: bool, as_json: bool) -> int:
    """Show every error of a module: its category, the meaning of each bit, and what to check. Exit code 1 when there is one."""
    return tell_errors(target, clear=clear, as_json=as_json)


def tell_errors(target: ModbusTarget, *, clear: bool = False, as_json: bool = False) -> int:
    """Print a module's errors, after clearing them if requested; return the exit code."""
    with opened(target) as module:
        found = module.errors()
        if clear and not as_json:
            for line in found.lines:
                say(f"was: {line}")
        if clear:
            found = module.clear_errors()
    if as_json:
        say_json({"flags": found.flags, **found.words})
    else:
        for line in found.lines or ["no error"]:
            say(line)
    return WRONG if found.any else OK
