"""``axisbus gim6010 modbus write``: write settings by name, read each back, set another node ID, and save."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, list_options, opened, parameters
from axisbus.cli.gim6010.modbus.values import is_parameter, pair, parse, show
from axisbus.cli.shared.common import OK, say, say_next

if TYPE_CHECKING:
    from axisbus.drives.gim6010.modbus.module import ModbusModule
    from axisbus.drives.gim6010.modbus.parameters import ModbusParameters

_NODE_ID = "node_id"


@click.command("write")
@click.argument("pairs", nargs=-1, metavar="[NAME=VALUE]...")
@list_options
@click.option("--save", is_flag=True, help="Save RAM to flash at the end; the module restarts.")
def command(target: ModbusTarget, pairs: tuple[str, ...], save: bool) -> int:
    """Write settings into RAM by name, each read back: registers, and with --list parameters by their USB names.

    node_id=NEW is written alone: no other module may have that ID, and the command finds the module under it. Values that
    enable, move or stop are not settings, and are not written here. Modes, parameters, node ID and saving need a module in
    idle.
    """
    from axisbus.drives.gim6010.modbus.registers import named

    wanted = dict(map(pair, pairs))
    if not wanted and not save:
        raise click.UsageError("give NAME=VALUE, or --save")
    if _NODE_ID in wanted:
        if len(pairs) > 1:
            raise click.UsageError(
                "node_id must be the only NAME=VALUE: it moves the module to another address"
            )
        return rename(target, int(parse(named(_NODE_ID), wanted[_NODE_ID])), save=save)
    _check({name: text for name, text in wanted.items() if not is_parameter(name)})
    with opened(target) as module:
        known = parameters(target, module) if any(map(is_parameter, wanted)) else None
        for name, text in wanted.items():
            say(_written(module, known, name, text))
        if save:
            say(_saved(module, known))
        else:
            say_next(
                f"in RAM only, lost at the next start; to save it: axisbus gim6010 modbus write --save {target.words}"
            )
    return OK


def _check(wanted: dict[str, str]) -> None:
    """Refuse invalid settings before the port is opened."""
    from axisbus.drives.gim6010.modbus.module import require_setting
    from axisbus.drives.gim6010.modbus.registers import named
    from axisbus.drives.gim6010.modbus.requests import write

    for name, text in wanted.items():
        register = named(name)
        require_setting(register)
        write(register, parse(register, text))


def _written(module: ModbusModule, known: ModbusParameters | None, name: str, text: str) -> str:
    from axisbus.drives.gim6010.modbus.registers import named
    from axisbus.drives.gim6010.parameters import values

    if known is not None and is_parameter(name):
        endpoint = known.endpoint(name)
        before = values.show(known.read(name))
        return f"{name} = {values.show(known.write(name, values.parse(endpoint, text), by_name=True))} (was {before})"
    register = named(name)
    before = show(register, module.read(name))
    return f"{name} = {show(register, module.write(name, parse(register, text)))} (was {before})"


def _saved(module: ModbusModule, known: ModbusParameters | None) -> str:
    if known is not None:
        known.save()
        return "saved, and read again"
    return (
        "saved: it restarted, and answers" if module.save() else "saved: it answers, and no restart was seen"
    )


def rename(target: ModbusTarget, new: int, *, save: bool) -> int:
    """Set another node ID in a module, and print how to reach it then; return the exit code."""
    from axisbus.drives.gim6010.modbus.set_node_id import set_node_id

    with opened(target) as module:
        found = set_node_id(module, new, save=save)
    if save:
        say(f"module {target.node} is now module {new}, saved")
        say_next(f"label it {new}; then axisbus gim6010 modbus state --port {target.port} --node {new}")
        return OK
    say(f"module {target.node} has node ID {new} in RAM, and answers to {found.device}")
    say(f"after switching it off and on, it has {target.node} again")
    return OK
