"""``axisbus gim6010 params restore``: restore the settings of a module from a backup."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, backup_of, module_options, opened
from axisbus.cli.shared.common import OK, say, say_error
from axisbus.cli.shared.paths import PATH
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.drives.gim6010.parameters.backup import RestorePlan
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters


@click.command("restore")
@click.argument("file", type=PATH)
@module_options
@click.option(
    "--include",
    multiple=True,
    metavar="PATH",
    help="Also write this protected setting; one option per setting.",
)
@click.option("--other-module", is_flag=True, help="Allow a backup of another module.")
@click.option("--other-firmware", is_flag=True, help="Allow a backup of another firmware.")
@click.option("--dry-run", is_flag=True, help="Show the values that would be written, and write nothing.")
@click.option(
    "--save", is_flag=True, help="Then save RAM to flash; the module restarts, and all values are read again."
)
def command(
    asked: ModuleSelection,
    file: Path,
    include: tuple[str, ...],
    other_module: bool,
    other_firmware: bool,
    dry_run: bool,
    save: bool,
) -> int:
    """Write the settings that differ from the backup FILE into RAM, each read back; only to a module that is idle.

    Refused if the backup is of another module, by its serial number, or of another firmware, unless you allow it. Settings
    measured on a module, its zero, and its address and interface are not written, unless each is named with --include.
    """
    from axisbus.drives.gim6010.parameters import backup, rules
    from axisbus.drives.gim6010.parameters import backup as bulk_read

    kept = backup_of(file)
    with opened(asked) as module:
        backup.require_same(kept, module, other_module=other_module, other_firmware=other_firmware)
        present = bulk_read.read_all(module, filter(rules.kept, module.listed.endpoints.values())).values
        plan = backup.plan(kept, module, present, frozenset(include))
        _tell(plan, dry_run=dry_run)
        if not dry_run and plan.writes:
            _write(module, plan, frozenset(include), save=save)
    return OK


def _tell(plan: RestorePlan, *, dry_run: bool) -> None:
    from axisbus.drives.gim6010.parameters import values

    for path, why in plan.left:
        say(f"left: {path}: {why}")
    for path, value in plan.writes if dry_run else ():
        say(f"would write {path} = {values.show(value)}")
    if not plan.writes:
        say("there is nothing to be written")


def _write(module: ModuleParameters, plan: RestorePlan, named: frozenset[str], *, save: bool) -> None:
    from axisbus.drives.gim6010.parameters import values

    done = 0
    try:
        for path, value in plan.writes:
            say(f"{path} = {values.show(module.write(path, value, by_name=path in named))}")
            done += 1
        if save:
            module.save()
    except BaseException:
        if done:
            say_error(
                f"{done} of {len(plan.writes)} were written into RAM before the error; switching it off and on undoes them"
            )
        raise
    where = "saved: the module restarted, and has all of it" if save else "in RAM only: --save stores it"
    say(f"{counted(done, 'setting')} restored, {where}")
