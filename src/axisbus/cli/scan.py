"""``axisbus scan``: list the nodes on a bus, with their identity."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.shared import no_traffic_help
from axisbus.cli.shared.buses import open_bus, opening_of
from axisbus.cli.shared.common import OK, WRONG, coloured, say, say_json, say_next, say_table
from axisbus.cli.shared.options import PATH, GivenBus, bus_options, bus_words, packed
from axisbus.cli.shared.plugin_options import adding
from axisbus.drives.foreign_protocols import ForeignProtocols

if TYPE_CHECKING:
    from axisbus.bus.link.other_rates import BitRateTraffic
    from axisbus.bus.node.discover import DiscoveredNode
    from axisbus.errors import BusError

_NUMBERS = ("vendor", "product", "revision", "serial")
_FACTS = ("make", *_NUMBERS)


def _factory_rates_text() -> str:
    """Return the text about the makes with another protocol, for the help."""
    makes = ForeignProtocols().factory_rates.values()
    return " ".join(
        f"{make[0].upper()}{make[1:]} that uses its factory protocol is recognised by its heartbeats."
        for make in makes
    )


@click.command("scan")
@adding((), _factory_rates_text())
@click.argument("cell", type=PATH, required=False)
@bus_options
@packed(GivenBus, "given")
@click.option("--json", "as_json", is_flag=True, help="Print the nodes as JSON.")
def command(given: GivenBus, as_json: bool) -> int:
    """Show the nodes on a bus and their identities: on that of CELL (a cell.toml), or with -i and -c on any bus.

    Asks each of the 127 node IDs once or twice; takes under 3 s. Changes nothing. Exit code 1 when no node answers.
    {plugins} If nothing is received at all, it listens at other bit
    rates, if the adapter has a listen-only mode (about 6 s); never otherwise, because a wrong rate destroys every frame of a
    working bus.
    """
    others = ForeignProtocols()
    found, failed = _scan(given, others)
    speakers, other_rate = others.speakers, None
    opening = opening_of(*given)
    if not others.frames:
        other_rate = no_traffic_help.listen(opening, quiet=as_json)
    if failed is not None and other_rate is None and not speakers:
        raise failed
    if as_json:
        say_json([*map(_plain, found), *(each.plain for each in speakers), *_plain_traffic(other_rate)])
        return OK if found else WRONG
    _show(found)
    for line in others.lines():
        say(line)
    if found:
        _next(given)
    if not found and not speakers:
        say("no node answered: check supply, cable and termination; then the bit rate")
        no_traffic_help.show(other_rate, opening)
    return OK if found else WRONG


def _scan(given: GivenBus, others: ForeignProtocols) -> tuple[list[DiscoveredNode], BusError | None]:
    """Return the nodes found, and the error of the bus (at a wrong bit rate no frame is acknowledged)."""
    from axisbus.bus.node.discover import scan
    from axisbus.errors import BusError

    with ExitStack() as stack:
        bus = open_bus(stack, *given)
        try:
            return scan(bus, listening=others), None
        except BusError as error:
            return [], error


def _plain(node: DiscoveredNode) -> dict[str, Any]:
    nmt = node.nmt.text if node.nmt is not None else None
    return {"protocol": "CANopen", **asdict(node), "nmt": nmt, "make": _make(node) or None}


def _plain_traffic(traffic: BitRateTraffic | None) -> list[dict[str, Any]]:
    """Return the traffic received at another bit rate, as plain values."""
    if traffic is None:
        return []
    rate = {"bitrate": traffic.bitrate}
    nodes = [{"protocol": "CANopen", "node_id": node, **rate} for node in traffic.nodes]
    return [*nodes, *({**each.plain, **rate} for each in traffic.others.speakers)]


def _show(found: list[DiscoveredNode]) -> None:
    if coloured() and found:
        say_table(("node", "kind", "device", "state", *_FACTS), [_row(node) for node in found])
    else:
        for node in found:
            _lines(node)


def _next(given: GivenBus) -> None:
    if given.interface is None:
        say_next(f"axisbus boot {given.cell}")
        return
    bus = bus_words(*given._replace(cell=None))
    say_next(f"a first cell file of them: axisbus init {bus} -o cell.toml")


def _lines(node: DiscoveredNode) -> None:
    number, kind, name, state, *_ = _row(node)
    say(f"{number:>4}  {kind:<24}  {name:<20}  {state}")
    if facts := _facts(node):
        say(f"      {', '.join(f'{title} {value}' for title, value in facts.items())}")


def _row(node: DiscoveredNode) -> tuple[str, ...]:
    """Return a node's columns; values that it does not report are empty."""
    state = node.nmt.text if node.nmt is not None else "no heartbeat"
    facts = _facts(node)
    identity = (str(node.node_id), node.kind or "does not answer SDO", node.identity.device_name or "", state)
    return (*identity, *(facts.get(title, "") for title in _FACTS))


def _make(node: DiscoveredNode) -> str:
    """Return the name of the make of a drive, empty if no drive plug-in matches its identity."""
    from axisbus.drives import registry
    from axisbus.drives.plugin import GENERIC

    identity = node.identity
    make = registry.of_identity(identity)
    return "" if make is GENERIC else make.name


def _facts(node: DiscoveredNode) -> dict[str, str]:
    """Return the make, and the entries of 1018h that the node has reported, by name."""
    identity = node.identity
    values = (identity.vendor_id, identity.product_code, identity.revision, identity.serial)
    numbers = {
        title: f"0x{value:X}" for title, value in zip(_NUMBERS, values, strict=True) if value is not None
    }
    make = _make(node)
    return {"make": make, **numbers} if make else numbers
