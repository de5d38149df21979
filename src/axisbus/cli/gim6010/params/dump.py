"""``axisbus gim6010 params dump``: read every parameter of a module."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options, opened
from axisbus.cli.shared.common import OK, WRONG, progress_bar, say, say_json


@click.command("dump")
@click.argument("under", default="")
@module_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def command(asked: ModuleSelection, under: str, as_json: bool) -> int:
    """Read every parameter that can be read, or those UNDER a path (axis0.motor); writes nothing.

    Parameters of more than 32 bits can be read only over USB, and are left out otherwise. Exit code 1 when one is not answered.
    """
    from axisbus.drives.gim6010.parameters import backup, values
    from axisbus.errors import ArgumentError

    with opened(asked) as module, progress_bar("reading", quiet=as_json) as tell:
        wanted = module.listed.under(under)
        if not wanted:
            raise ArgumentError(f"there is nothing under {under!r} in {module.listed.source}")
        many = backup.read_all(module, wanted, tell)
    if as_json:
        say_json({path: values.plain(value) for path, value in many.values.items()})
    else:
        for path, value in many.values.items():
            say(f"{path} = {values.show(value)}")
        for path in many.silent:
            say(f"{path}: not answered")
    return WRONG if many.silent else OK
