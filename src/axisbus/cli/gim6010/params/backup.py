"""``axisbus gim6010 params backup``: write the settings of a module to a file."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options, opened
from axisbus.cli.shared.common import OK, progress_bar, say, say_next
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.wording import counted


@click.command("backup")
@module_options
@output_option("The file; by default named by the module's serial number and firmware.")
@force_option
def command(asked: ModuleSelection, output: Path | None, force: bool) -> int:
    """Write the settings of a module, as they are in RAM, into a file; writes nothing to the module.

    The settings in flash may differ: to back up those of the flash, save first, or switch the module off and on.
    """
    from axisbus.drives.gim6010.parameters import backup

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
