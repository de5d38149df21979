"""``axisbus gim6010 errors``: print every error of a module with its name and explanation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_json
from axisbus.drives.gim6010.cli.discovery import BusOptions, line_options, look
from axisbus.drives.gim6010.cli.modbus.registers import tell_errors as over_modbus
from axisbus.drives.gim6010.cli.ports import modbus_options, on_usb, usb_options

if TYPE_CHECKING:
    from axisbus.drives.gim6010.cli.modbus.target_module import ModbusTarget
    from axisbus.drives.gim6010.discovery.results import DiscoveredModule


@click.command("errors")
@line_options
@modbus_options
@usb_options
@click.option("--node", type=click.IntRange(0, 127), help="The module's node ID.")
@click.option(
    "--word",
    "given",
    multiple=True,
    metavar="CATEGORY=WORD",
    help="Explain an error word that was read by another tool (axis=0x40); needs no bus.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the errors as JSON.")
def command(
    line: BusOptions,
    node: int | None,
    serial: ModbusTarget | None,
    usb: str | None,
    given: tuple[str, ...],
    as_json: bool,
) -> int:
    """Show every error of a module: its category, the meaning of each bit, and what to check.

    CAN Simple: the axis's word is in each heartbeat, the others are read. CANopen: 603Fh, 1001h, and the module's own bits.
    Modbus RTU (--modbus): its error registers. USB (--usb): its error words. Exit code 1 when there is an error, 3 when no
    module with this node ID is found. It clears nothing.
    """
    from axisbus.drives.gim6010.discovery import report_text

    if given:
        for text in report_text.of_words(report_text.parse(each) for each in given):
            say(text)
        return OK
    if usb is not None:
        return _over_usb(usb, as_json=as_json)
    if node is None:
        raise click.UsageError("give the module's node ID with --node, or a word with --word axis=0x40")
    if serial is not None:
        return over_modbus(serial, as_json=as_json)
    found = _ours(line, node)
    if as_json:
        say_json([each.plain for each in found])
    for each in () if as_json else found:
        for text in report_text.error_lines(each):
            say(text)
    if not found:
        say_error(
            f"no module with node ID {node} was heard, and none answers a request\n"
            f"  remedy:   list the modules: axisbus gim6010 find {line.words}"
        )
        return FAILURE
    return WRONG if any(each.errors for each in found) else OK


def _over_usb(usb: str, *, as_json: bool) -> int:
    from axisbus.drives.gim6010 import faults

    with on_usb(usb) as module:
        words = module.error_words()
    if as_json:
        say_json(words)
    else:
        told = [text for category, word in words.items() for text in faults.words(category, word)]
        for text in told or ["no error"]:
            say(text)
    return WRONG if any(words.values()) else OK


def _ours(line: BusOptions, node: int) -> list[DiscoveredModule]:
    from axisbus.drives.gim6010.discovery.finder import Finder, Only, ProbeScope
    from axisbus.drives.gim6010.discovery.results import findings

    finder = Finder(ask=ProbeScope.ALL, only=Only(frozenset({node})))
    look(line, finder)
    return [each for each in findings(finder) if each.ours]
