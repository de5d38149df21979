"""``axisbus gim6010 params set``: write parameters by name, and read each back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options, opened
from axisbus.cli.shared.common import OK, say, say_error, say_next

if TYPE_CHECKING:
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters, Value


@click.command("set")
@click.argument("settings", nargs=-1, required=True, metavar="PATH=VALUE...")
@module_options
@click.option(
    "--save", is_flag=True, help="Then save RAM to flash; the module restarts, and all values are read again."
)
def command(asked: ModuleSelection, settings: tuple[str, ...], save: bool) -> int:
    """Write parameters into RAM, each read back; only to a module that is idle. Without --save a restart undoes it.

    Settings measured on this module, its zero, and its address and interface may be written here, because each is named;
    parameters that move or enable it may not. All are checked before the first is written.
    """
    from axisbus.drives.gim6010.parameters import values

    with opened(asked) as module:
        wanted = [_parsed(module, text) for text in settings]
        done = 0
        try:
            for path, value in wanted:
                before = module.read(path)
                held = module.write(path, value, by_name=True)
                say(f"{path} = {values.show(held)} (was {values.show(before)})")
                _warn(path)
                done += 1
            if save:
                module.save()
        except BaseException:
            if done:
                say_error(
                    f"{done} of {len(wanted)} were written into RAM before the error; switching it off and on undoes them"
                )
            raise
    _end(module, asked, saved=save)
    return OK


def _parsed(module: ModuleParameters, text: str) -> tuple[str, Value]:
    """Return path and value of ``PATH=VALUE``.

    Raises:
        UsageError, ArgumentError: the text has another form, the parameter is unknown, or it must not be written.
    """
    from axisbus.drives.gim6010.can_simple.endpoint_messages import value_bytes
    from axisbus.drives.gim6010.parameters import rules, values

    path, sign, value = text.partition("=")
    if not sign or not value:
        raise click.UsageError(f"{text}: write PATH=VALUE")
    endpoint = module.endpoint(path.strip())
    rules.require_setting(endpoint, by_name=True)
    found = values.parse(endpoint, value.strip())
    value_bytes(endpoint, found, module.widest)
    return endpoint.path, found


def _warn(path: str) -> None:
    from axisbus.drives.gim6010.can_simple.protected import protected

    found = protected(path)
    if found is not None:
        say(f"  note: {found.why}")


def _end(module: ModuleParameters, asked: ModuleSelection, *, saved: bool) -> None:
    if saved:
        say(f"saved: module {module.serial:08X}h restarted, and has all of it")
    else:
        say("in RAM only: it is lost at the next start")
        say_next(f"save it: axisbus gim6010 params set ... {asked.words} --save")
