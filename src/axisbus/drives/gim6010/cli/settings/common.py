"""Common parts of the commands that set parameters: write, read back and save; if that fails, print the steps over USB."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import click

from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_next
from axisbus.drives.gim6010.cli.module_selection import ModuleSelection, opened, require_list
from axisbus.drives.gim6010.parameters import rules
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.settings import zero
from axisbus.drives.gim6010.settings.parameter_settings import ParameterBatch, apply, shown
from axisbus.errors import NodeError, StateError

Act = Callable[["ModuleParameters"], None]


save_option = click.option(
    "--save",
    is_flag=True,
    help="Afterwards save RAM to flash; the module restarts, and all values are read again.",
)


def over_usb(steps: Sequence[str]) -> None:
    say("do this over USB:")
    for step in steps:
        say(f"  {step}")


def with_module(asked: ModuleSelection, act: Act, steps: Sequence[str]) -> int:
    """Open a module and run ``act`` on its parameters; after a NodeError, print the ``steps`` over USB.

    Raises:
        UsageError, UserError, AdapterError: as ``opened``, or from ``act``.
    """
    require_list(asked)
    try:
        with opened(asked) as module:
            act(module)
    except NodeError as error:
        say_error(str(error))
        over_usb(steps)
        return FAILURE
    return OK


def show(asked: ModuleSelection, paths: tuple[str, ...]) -> int:
    def act(module: ModuleParameters) -> None:
        for line in shown(module, paths):
            say(line)

    return with_module(asked, act, [f"odrv0.{path}, typed in odrivetool, shows it" for path in paths])


def put(module: ModuleParameters, wanted: ParameterBatch, *, save: bool) -> None:
    """Write all parameters, and save them if requested; if that fails midway, print how many are in RAM. Then print the notes."""
    told: list[str] = []

    def tell(text: str) -> None:
        told.append(text)
        say(text)

    try:
        apply(module, wanted, tell)
        if save:
            module.save()
    except BaseException:
        if told:
            say_error(
                f"{len(told)} of {len(wanted.values)} were written into RAM before the error; switching it off and on undoes this"
            )
        raise
    finally:
        for note in wanted.notes if told else ():
            say(f"  note: {note}")


def change(
    asked: ModuleSelection,
    wanted: ParameterBatch,
    command: str,
    *,
    save: bool,
    afterwards: Act | None = None,
) -> int:
    """Write all parameters, and save them if requested; print how to save them with ``command``, as typed."""

    def act(module: ModuleParameters) -> None:
        put(module, wanted, save=save)
        if afterwards is not None:
            afterwards(module)

    code = with_module(asked, act, wanted.over_usb)
    if code == OK:
        end(asked, command, saved=save)
    return code


def pair(text: str, form: str) -> tuple[str, str]:
    """Return both sides of a text such as ``PATH=VALUE``, which is its ``form``. Raises UsageError: the text has another form."""
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise click.UsageError(f"{text!r}: write {form}")
    return name.strip(), value.strip()


def end(asked: ModuleSelection, command: str, *, saved: bool) -> None:
    """Print where the settings are now, and how to save them."""
    if saved:
        say("saved: it restarted, and has all written values")
    else:
        say("in RAM only: it is lost at the next start")
        say_next(f"save it: axisbus gim6010 {command} {asked.words} --save")


_BETWEEN = 0.3  # s between two readings that show whether it turns


def set_zero(module: ModuleParameters) -> None:
    """Set and save a module's zero, and check its position after the restart; blocks.

    Raises:
        StateError: it is not idle, turns, or reports no credible position: then the steps over USB are printed.
        NodeError: it does not answer, or is not at its zero afterwards.
    """
    module.require_idle()
    first = zero.look(module)
    time.sleep(_BETWEEN)
    try:
        wanted = zero.wanted(first, zero.look(module))
    except StateError:
        over_usb(zero.STEPS)
        raise
    put(module, wanted, save=True)
    zero.verify(int(module.read(rules.NODE_ID)), float(wanted.values[0][1]), zero.look(module))
