"""``axisbus gim6010 modbus read``: registers, and parameters by their names."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.modbus.line import Target, list_options, opened, parameters
from axisbus.cli.gim6010.modbus.values import is_parameter, show
from axisbus.cli.shared.common import OK, say, say_json


@click.command("read")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@list_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def command(target: Target, names: tuple[str, ...], as_json: bool) -> int:
    """Read values by name: registers (all without a NAME), and with --list parameters as they are called over USB.

    Values of several registers are read whole. Position and velocity count in closed loop only.
    """
    from axisbus.drives.gim6010.modbus.registers import REGISTERS, named
    from axisbus.drives.gim6010.parameters import values

    wanted = names or tuple(
        each.name for each in REGISTERS if each.readable and each.name != "endpoint_return"
    )
    if target.listed is None:
        for name in wanted:
            named(name.removeprefix("odrv0.")) if not is_parameter(name) else _require_list(name)
    with opened(target) as module:
        known = parameters(target, module) if any(map(is_parameter, wanted)) else None
        found: dict[str, object] = {}
        for name in wanted:
            if is_parameter(name) and known is not None:
                value = known.read(name)
                found[name] = values.plain(value)
                text = values.show(value)
            else:
                number = module.read(name)
                found[name] = values.plain(number)
                text = show(named(name), number)
            if not as_json:
                say(f"{name} = {text}")
    if as_json:
        say_json(found)
    return OK


def _require_list(name: str) -> None:
    from axisbus.drives.gim6010.modbus.registers import BY_NAME

    raise click.UsageError(
        f"{name!r} is no register ({', '.join(BY_NAME)}); a parameter of the firmware needs its list of endpoints: --list"
    )
