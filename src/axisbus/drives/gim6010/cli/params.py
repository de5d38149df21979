"""The commands of ``axisbus gim6010 params``."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.shared.common import OK, WRONG, progress_bar, say, say_json, say_next
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.drives.gim6010.can_simple.endpoints import protected
from axisbus.drives.gim6010.cli.module_selection import ModuleSelection, backup_of, module_options, opened
from axisbus.drives.gim6010.cli.settings.common import pair, put, save_option
from axisbus.drives.gim6010.parameters import backup, rules, values
from axisbus.drives.gim6010.parameters.backup import RestorePlan, differences
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.drives.gim6010.settings.parameter_settings import ParameterBatch
from axisbus.errors import ArgumentError
from axisbus.wording import counted

# -- ``axisbus gim6010 params get``: read parameters by name -----------------------------------------------------------


@click.command("get")
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@module_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def get_command(asked: ModuleSelection, paths: tuple[str, ...], as_json: bool) -> int:
    """Read parameters by PATH, such as axis0.controller.config.vel_limit, as they are in RAM."""
    with opened(asked) as module:
        found = {path: module.read(path) for path in paths}
    if as_json:
        say_json({path: values.plain(value) for path, value in found.items()})
        return OK
    for path, value in found.items():
        say(f"{path} = {values.show(value)}")
    return OK


# -- ``axisbus gim6010 params set``: write parameters by name, and read each back --------------------------------------


@click.command("set")
@click.argument("settings", nargs=-1, required=True, metavar="PATH=VALUE...")
@module_options
@save_option
def set_command(asked: ModuleSelection, settings: tuple[str, ...], save: bool) -> int:
    """Write parameters into RAM, each read back; only to a module that is idle. Without --save a restart undoes it.

    Settings measured on this module, its zero, and its address and interface may be written here, because each is named;
    parameters that move or enable it may not. All are checked before the first is written.
    """
    with opened(asked) as module:
        wanted = tuple(_parsed(module, text) for text in settings)
        notes = tuple(f"{path} {found.why}" for path, _ in wanted if (found := protected(path)) is not None)
        put(module, ParameterBatch(wanted, notes), save=save)
    if save:
        say(f"saved: module {module.serial:08X}h restarted, and has all written values")
    else:
        say("in RAM only: it is lost at the next start")
        say_next(f"save it: axisbus gim6010 params set ... {asked.words} --save")
    return OK


def _parsed(module: ModuleParameters, text: str) -> tuple[str, Value]:
    """Return path and value of ``PATH=VALUE``; raises as ``pair``, ``ModuleParameters.endpoint`` and ``values.parse``."""
    path, value = pair(text, "PATH=VALUE")
    endpoint = module.endpoint(path)
    return endpoint.path, values.parse(endpoint.path, endpoint.type, value)


# -- ``axisbus gim6010 params dump``: read every parameter of a module -------------------------------------------------


@click.command("dump")
@click.argument("under", default="")
@module_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def dump_command(asked: ModuleSelection, under: str, as_json: bool) -> int:
    """Read every parameter that can be read, or those UNDER a path (axis0.motor); writes nothing.

    Parameters of more than 32 bits can be read only over USB, and are left out otherwise. Exit code 1 when one is not answered.
    """
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


# -- ``axisbus gim6010 params backup``: write the settings of a module to a file ---------------------------------------


@click.command("backup")
@module_options
@output_option("The file; by default named by the module's serial number and firmware.")
@force_option
def backup_command(asked: ModuleSelection, output: Path | None, force: bool) -> int:
    """Write the settings of a module, as they are in RAM, into a file; writes nothing to the module.

    The settings in flash may differ: to back up those of the flash, save first, or switch the module off and on.
    """
    require_free(output, force=force)
    with opened(asked) as module, progress_bar("reading") as tell:
        taken = backup.take(module, tell)
    path = output or Path(taken.name)
    require_free(path, force=force)
    write_whole(path, taken.text().encode())
    say(
        f"{path}: {counted(len(taken.values), 'setting')} of module {taken.serial:08X}h, firmware {taken.firmware}, from its RAM"
    )
    say_next(f"axisbus gim6010 params diff {path} {asked.words}")
    return OK


# -- ``axisbus gim6010 params restore``: restore the settings of a module from a backup --------------------------------


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
@save_option
def restore_command(
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
    kept = backup_of(file)
    with opened(asked) as module:
        backup.require_same(kept, module, other_module=other_module, other_firmware=other_firmware)
        present = backup.read_all(module, filter(rules.kept, module.listed.endpoints.values())).values
        plan = backup.plan(kept, module, present, frozenset(include))
        _tell(plan, dry_run=dry_run)
        if not dry_run and plan.writes:
            put(module, ParameterBatch(plan.writes), save=save)
            where = (
                "saved: the module restarted, and has all written values"
                if save
                else "in RAM only: --save stores it"
            )
            say(f"{counted(len(plan.writes), 'setting')} restored, {where}")
    return OK


def _tell(plan: RestorePlan, *, dry_run: bool) -> None:
    for path, why in plan.left:
        say(f"left: {path}: {why}")
    for path, value in plan.writes if dry_run else ():
        say(f"would write {path} = {values.show(value)}")
    if not plan.writes:
        say("there is nothing to be written")


# -- ``axisbus gim6010 params diff``: compare two backups, or a backup and a module ------------------------------------


@click.command("diff")
@click.argument("one", type=PATH)
@click.argument("other", type=PATH, required=False)
@module_options
def diff_command(asked: ModuleSelection, one: Path, other: Path | None) -> int:
    """Show the differences between the backups ONE and OTHER, or between ONE and the named module; writes nothing.

    Exit code 1 when something differs.
    """
    if other is not None and (asked.line.interface is not None or not asked.over_can):
        raise click.UsageError(
            "give a second file, or a module with -i and -c (or --modbus), --node and --list, or --usb, not both"
        )
    first = backup_of(one)
    if other is not None:
        second = backup_of(other)
    else:
        with opened(asked) as module:
            second = backup.take(module)
    found = differences(first.values, second.values)
    for each in found:
        say(each.words)
    say(f"{counted(len(found), 'setting differs', 'settings differ')}")
    return WRONG if found else OK
