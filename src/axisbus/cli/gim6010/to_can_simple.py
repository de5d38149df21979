"""``axisbus gim6010 to-can-simple``: switch a module from CANopen back to CAN Simple, which no known object does."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.discovery import BusOptions, survey
from axisbus.cli.gim6010.usb_port import on_usb, usb_options
from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error
from axisbus.cli.shared.options import bus_options

_PROTOCOL, _CAN_SIMPLE = "can.config.protocol", 1


@click.command("to-can-simple")
@bus_options
@usb_options
@click.option("--node", type=click.IntRange(0, 127), help="The module's node ID; not with --usb.")
def command(
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
    node: int | None,
    usb: str | None,
) -> int:
    """Bring a module that speaks CANopen back to CAN Simple, over --usb; else tell how, and write nothing.

    No object of CANopen is known that changes the protocol. Exit code 0 where it speaks CAN Simple already, or does now, 1 where
    the steps are told, 3 where no module has this node ID.
    """
    if usb is not None:
        return _over_usb(usb)
    if node is None:
        raise click.UsageError("give the module's node ID with --node (axisbus gim6010 find tells it)")
    from axisbus.drives.gim6010.discovery.results import ProtocolsFound
    from axisbus.drives.gim6010.node_id_preconditions import OVER_USB

    line = BusOptions(interface, channel, bitrate, option)
    found = [each for each in survey(line, node)[1] if each.ours and node in each.addresses]
    if not found:
        say_error(
            f"no module has the node ID {node}\n  remedy:   list the modules: axisbus gim6010 find {line.words}"
        )
        return FAILURE
    if all(each.protocol is ProtocolsFound.CAN_SIMPLE for each in found):
        say(f"node {node} speaks CAN Simple already")
        return OK
    say(f"node {node} is brought to CAN Simple over USB:")
    for step in OVER_USB[ProtocolsFound.CAN_SIMPLE]:
        say(f"  {step}")
    return WRONG


def _over_usb(usb: str) -> int:
    from axisbus.cli.gim6010.settings.common import put
    from axisbus.drives.gim6010.settings.parameter_batch import ParameterBatch

    with on_usb(usb) as module:
        put(module, ParameterBatch(((_PROTOCOL, _CAN_SIMPLE),)), save=True)
    say("saved: it restarted, and speaks CAN Simple")
    return OK
