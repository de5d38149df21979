"""``axisbus gim6010 find`` and ``errors``: the modules on a bus, the protocol of each, and its errors with their explanation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.shared import no_traffic_help
from axisbus.cli.shared.buses import opening_of
from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_json, say_next
from axisbus.cli.shared.options import GivenBus, bus_words
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.cli.bus import line_options, look
from axisbus.drives.gim6010.cli.modbus.registers import tell_errors, tell_lines
from axisbus.drives.gim6010.cli.modbus.target_module import ModbusTarget
from axisbus.drives.gim6010.cli.module_selection import modbus_options, on_usb, usb_options
from axisbus.drives.gim6010.discovery import report_text
from axisbus.drives.gim6010.discovery.finder import Finder, ProbeScope
from axisbus.drives.gim6010.discovery.results import DiscoveredModule, findings

if TYPE_CHECKING:
    from axisbus.bus.link.other_rates import BitRateTraffic


@click.command("find")
@line_options
@click.option(
    "--ask",
    type=click.Choice(["none", "heard", "all"]),
    help="The node IDs to ask: none, those that were heard, or all. The default is all; with other traffic on the bus, only those "
    "that were heard.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
def command(line: GivenBus, ask: str | None, as_json: bool) -> int:
    """Find the modules on a bus: protocol, node ID, firmware, state, errors, supply voltage, and the next command to type.

    It listens for 1.5 s and then sends requests: one at a time, at least 10 ms apart, at most 24 for each module, and none that
    commands anything. Nothing is sent on an identifier that another node uses; at the first sign that no node acknowledges, it
    ends. Takes about 10 s if all node IDs are asked. Exit code 1 when no module is found, or several have one node ID.

    It listens at other bit rates only in an adapter's listen-only mode; if the adapter has none, only the given rate is tried.
    """
    asked = {None: None, "none": ProbeScope.NOBODY, "heard": ProbeScope.HEARD, "all": ProbeScope.ALL}[ask]
    finder = Finder(ask=asked)
    elsewhere = look(line, finder, quiet=as_json)
    found = findings(finder)
    if as_json:
        say_json(_plain(finder, found, elsewhere))
    else:
        _show(line, finder, found, elsewhere)
    ours = [each for each in found if each.ours]
    return OK if ours and not any(each.several for each in ours) else WRONG


def _show(
    line: GivenBus, finder: Finder, found: tuple[DiscoveredModule, ...], elsewhere: BitRateTraffic | None
) -> None:
    for each in found:
        for text in report_text.lines(each):
            say(text)
    for text in report_text.about_the_bus(finder):
        say(text)
    if not found:
        _nobody(line, finder, elsewhere)
    for step in report_text.following(found, bus_words(*line)):
        say_next(step)


def _nobody(line: GivenBus, finder: Finder, elsewhere: BitRateTraffic | None) -> None:
    """Print that there is no module, and possible reasons."""
    if elsewhere is None:
        heard = finder.picture.listening.frames
        say(
            "no module was found"
            if heard
            else "nothing was heard: check supply, cable and termination; then the bit rate"
        )
    if elsewhere is not None or not finder.picture.listening.frames:
        no_traffic_help.show(elsewhere, opening_of(*line))


def _plain(
    finder: Finder, found: tuple[DiscoveredModule, ...], elsewhere: BitRateTraffic | None
) -> dict[str, Any]:
    foreign = [
        {"can_id": each.can_id, "extended": each.extended, "frames": each.frames}
        for each in finder.picture.foreign()
    ]
    return {
        "modules": [each.plain for each in found],
        "foreign": foreign,
        "asked": finder.asked.name.lower(),
        "not_asked": finder.left_out,
        "unacknowledged": finder.unacknowledged or None,
        "frames": finder.picture.listening.frames,
        "other_bitrate": None if elsewhere is None else elsewhere.bitrate,
    }


# -- ``axisbus gim6010 errors``: every error of a module with its name and explanation ---------------------------------


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
def errors_command(
    line: GivenBus,
    node: int | None,
    serial: ModbusTarget | None,
    usb: str | None,
    given: tuple[str, ...],
    as_json: bool,
) -> int:
    """Show every error of a module: its category, the meaning of each bit, and what to check.

    CAN Simple: the axis's error word is taken from the heartbeat, the other error words are read. CANopen: 603Fh, 1001h, and
    the module's own bits. Modbus RTU (--modbus): its error registers. USB (--usb): its error words. Exit code 1 when there is
    an error, 3 when no module with this node ID is found. It clears nothing.
    """
    if given:
        for text in report_text.of_words(report_text.parse(each) for each in given):
            say(text)
        return OK
    if usb is not None:
        words = on_usb(usb).error_words()
        told = [text for category, word in words.items() for text in faults.words(category, word)]
        return tell_lines(words, told, as_json=as_json)
    if node is None:
        raise click.UsageError("give the module's node ID with --node, or a word with --word axis=0x40")
    if serial is not None:
        return tell_errors(serial, as_json=as_json)
    finder = Finder(ask=ProbeScope.ALL, only=(node,))
    look(line, finder)
    found = [each for each in findings(finder) if each.ours]
    if as_json:
        say_json([each.plain for each in found])
    for each in () if as_json else found:
        for text in report_text.error_lines(each):
            say(text)
    if not found:
        say_error(
            f"no module with node ID {node} was heard, and none answers a request\n"
            f"  remedy:   list the modules: axisbus gim6010 find {bus_words(*line)}"
        )
        return FAILURE
    return WRONG if any(each.errors for each in found) else OK
