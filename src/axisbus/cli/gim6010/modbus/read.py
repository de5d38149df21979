"""``axisbus gim6010 modbus read``: read registers, and parameters by name."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, list_options, opened, parameters
from axisbus.cli.gim6010.modbus.values import is_parameter, show
from axisbus.cli.shared.common import OK, say, say_json


@click.command("read")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@list_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def command(target: ModbusTarget, names: tuple[str, ...], as_json: bool) -> int:
    """Read values by name: registers (all without a NAME), and with --list parameters by their USB names.

    Values of several registers are read whole. Position and velocity are only updated in closed loop, and may be outdated
    otherwise; in JSON they are null then.
    """
    from axisbus.drives.gim6010.can_simple.states import CLOSED_LOOP
    from axisbus.drives.gim6010.modbus.registers import ALIVE_IN_CLOSED_LOOP, REGISTERS, named
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
                dead = name in ALIVE_IN_CLOSED_LOOP and module.state != CLOSED_LOOP
                found[name] = None if dead else values.plain(number)
                text = show(named(name), number) + (" (may be outdated: not in closed loop)" if dead else "")
            if not as_json:
                say(f"{name} = {text}")
    if as_json:
        say_json(found)
    return OK


def _require_list(name: str) -> None:
    from axisbus.drives.gim6010.modbus.registers import BY_NAME

    raise click.UsageError(
        f"{name!r} is not a register ({', '.join(BY_NAME)}); a parameter of the firmware needs its list of endpoints: --list"
    )
