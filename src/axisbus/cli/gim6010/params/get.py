"""``axisbus gim6010 params get``: read parameters by name."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options, opened
from axisbus.cli.shared.common import OK, say, say_json


@click.command("get")
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@module_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def command(asked: ModuleSelection, paths: tuple[str, ...], as_json: bool) -> int:
    """Read parameters by PATH, such as axis0.controller.config.vel_limit, as they are in RAM."""
    from axisbus.drives.gim6010.parameters import values

    with opened(asked) as module:
        found = {path: module.read(path) for path in paths}
    if as_json:
        say_json({path: values.plain(value) for path, value in found.items()})
        return OK
    for path, value in found.items():
        say(f"{path} = {values.show(value)}")
    return OK
