"""``axisbus gim6010 zero``: define the present position of a module as its zero."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.common import OK, say
from axisbus.drives.gim6010.cli.params.module import ModuleSelection, by_message, module_options
from axisbus.drives.gim6010.cli.settings.common import over_usb, put, with_module
from axisbus.errors import StateError

if TYPE_CHECKING:
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters

_BETWEEN = 0.3  # s between two readings that show whether it turns


@click.command("zero")
@module_options
@click.option(
    "--until-restart",
    is_flag=True,
    help="Set the count to 0 by a message, without --list; the next start undoes it.",
)
def command(asked: ModuleSelection, until_restart: bool) -> int:
    """Set the present position of a module as its zero; only while it is idle and does not turn.

    With --list, or over --usb, the user's zero (index_offset) is written, read back and saved, which restarts the module, and
    its position is checked after that. It is written only if the estimate of its position agrees with its encoder's count.
    """
    from axisbus.drives.gim6010.settings import zero

    if until_restart:
        return _until_restart(asked)
    code = with_module(asked, set_zero, zero.STEPS)
    if code == OK:
        say("saved: it restarted, and its position is 0 here")
    return code


def set_zero(module: ModuleParameters) -> None:
    """Set and save a module's zero, and check its position after the restart; blocks.

    Raises:
        StateError: it is not idle, turns, or reports no credible position: then the steps over USB are printed.
        NodeError: it does not answer, or is not at its zero afterwards.
    """
    from axisbus.drives.gim6010.parameters import rules
    from axisbus.drives.gim6010.settings import zero

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


def _until_restart(asked: ModuleSelection) -> int:
    with by_message(asked) as module:
        module.set_zero()
    say(f"module {asked.node} counts from 0 at its present position, until its next start")
    return OK
