"""``axisbus gim6010 set-id``: set the node ID of a module with CAN Simple."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.common import OK, say, say_error, say_next
from axisbus.drives.gim6010.cli.discovery import BusOptions, line_options, survey
from axisbus.drives.gim6010.cli.modbus.registers import rename
from axisbus.drives.gim6010.cli.ports import modbus_options, on_usb, usb_options
from axisbus.drives.gim6010.cli.ports import usb_words_of as usb_words

if TYPE_CHECKING:
    from axisbus.drives.gim6010.cli.modbus.target_module import ModbusTarget


@click.command("set-id")
@click.argument("new", type=click.IntRange(0, 63))
@line_options
@modbus_options
@usb_options
@click.option("--node", type=click.IntRange(0, 63), help="Its present node ID; not with --usb.")
@click.option("--no-save", is_flag=True, help="Leave it in RAM: the next start restores the old one.")
def command(
    new: int,
    line: BusOptions,
    node: int | None,
    serial: ModbusTarget | None,
    usb: str | None,
    no_save: bool,
) -> int:
    """Give a module that speaks CAN Simple or Modbus RTU (--modbus) the node ID NEW, save it, and check that it comes back.

    First the command searches the whole bus (about 10 s). It refuses if NEW is taken or clashes with a CANopen node, if several
    modules have the old ID, or if the module is not idle. Over --modbus it looks for NEW only, over --usb there is no search.
    Saving restarts the module.
    """
    from axisbus.drives.gim6010 import node_id_preconditions
    from axisbus.drives.gim6010.bus.settings_by_message import set_node_id

    if usb is not None:
        return _over_usb(usb, new, save=not no_save)
    if node is None:
        raise click.UsageError("give its present node ID with --node (axisbus gim6010 find shows it)")
    if new == node:
        raise click.UsageError(f"{node} is already its node ID")
    if serial is not None:
        return rename(serial, new, save=not no_save)
    finder, found = survey(line)
    node_id_preconditions.require_one(finder, found, node)
    node_id_preconditions.require_free(finder, found, new)
    told: list[str] = []

    def tell(text: str) -> None:
        told.append(text)
        say(text)

    try:
        with ExitStack() as stack:
            set_node_id(open_bus(stack, None, *line), node, new, save=not no_save, tell=tell)
    except BaseException:
        if told:
            say_error(
                f"it has node ID {new} in RAM; unless it was saved, it has {node} again after switching it off and on"
            )
        raise
    say_next(f"label it {new}; then axisbus gim6010 find {line.words}")
    return OK


def _over_usb(usb: str, new: int, *, save: bool) -> int:
    with on_usb(usb) as module:
        before = module.node
        module.set_node_id(new)
        say(f"node ID {new} (was {before}), in RAM")
        if save:
            module.save()
            say("saved: it restarted, and has it")
        else:
            say_next(f"save it: axisbus gim6010 set-id {new} {usb_words(usb)}")
    say(f"label it {new}; no other node on its bus may have this ID: axisbus gim6010 find")
    return OK
