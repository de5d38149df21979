"""``axisbus gim6010 params diff``: compare two backups, or a backup and a module."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, backup_of, module_options, opened
from axisbus.cli.shared.common import OK, WRONG, say
from axisbus.cli.shared.paths import PATH
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.drives.gim6010.parameters.interface import Value


@click.command("diff")
@click.argument("one", type=PATH)
@click.argument("other", type=PATH, required=False)
@module_options
def command(asked: ModuleSelection, one: Path, other: Path | None) -> int:
    """Show the differences between the backups ONE and OTHER, or between ONE and the named module; writes nothing.

    Exit code 1 when something differs.
    """
    from axisbus.drives.gim6010.parameters.backup import differences

    if other is not None and (asked.line.interface is not None or not asked.over_can):
        raise click.UsageError(
            "give a second file, or a module with -i and -c (or --modbus), --node and --list, or --usb, not both"
        )
    first = backup_of(one)
    second: Mapping[str, Value] = backup_of(other).values if other is not None else _of_module(asked)
    found = differences(first.values, second)
    for each in found:
        say(each.words)
    say(f"{counted(len(found), 'setting differs', 'settings differ')}")
    return WRONG if found else OK


def _of_module(asked: ModuleSelection) -> Mapping[str, Value]:
    from axisbus.drives.gim6010.parameters import backup

    with opened(asked) as module:
        return backup.take(module).values
