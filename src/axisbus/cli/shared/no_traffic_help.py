"""Help for ``scan`` and ``trace`` if nothing is received: listen at other bit rates if the adapter can, else explain how."""

from __future__ import annotations

from typing import TYPE_CHECKING

from axisbus.cli.shared.common import say, say_next, say_note
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.bus.link.bitrate_change import Opening
    from axisbus.bus.link.other_rates import BitRateTraffic

_SYSTEM = (
    "the system sets the link's rate; try another rate in listen-only mode, which disturbs no node: sudo ip link set {0} down; "
    "sudo ip link set {0} up type can bitrate {1} listen-only on; axisbus trace -i socketcan -c {0} (afterwards: listen-only off)"
)
_NO_MODE = (
    "python-can cannot open this adapter in listen-only mode, and a wrong bit rate destroys every frame of a working bus: "
    "ask the person who set up the bus, or try another rate with -b only if nothing else runs on it"
)
_SINGLE_NODE = (
    "if the bus has only one node and this adapter, its frames are received only if this adapter acknowledges them: if "
    "nothing else runs on this bus, scan it with {} too"
)
_OTHER_RATE = 500_000  # the proposal if no plug-in knows a rate


def listen(opening: Opening, *, quiet: bool = False) -> BitRateTraffic | None:
    """Listen at other bit rates if the adapter has a listen-only mode; None if it has none, or nothing was received.

    Raises:
        AdapterError: the adapter cannot be opened again.
    """
    from axisbus.bus.link import other_rates

    if not other_rates.possible(opening.interface, opening.options):
        return None
    if not quiet:
        say_note("nothing was heard; listening at other bit rates, in the adapter's listen-only mode")
    return other_rates.find(opening.interface, opening.channel, opening.bitrate, opening.options)


def lines(traffic: BitRateTraffic) -> list[str]:
    """Return the traffic received at another bit rate, as lines."""
    nodes = f", CANopen nodes {', '.join(map(str, traffic.nodes))}" if traffic.nodes else ""
    return [
        f"this bus runs at {traffic.bitrate} bit/s: {counted(traffic.frames, 'frame was', 'frames were')} heard{nodes}",
        *traffic.others.lines(),
    ]


def advice(opening: Opening) -> list[str]:
    """Return what to do if nothing was received at any bit rate that was tried."""
    from axisbus.bus.link import interfaces, other_rates
    from axisbus.drives.foreign_protocols import ForeignProtocols

    rates = ForeignProtocols().factory_rates
    named = " and ".join(f"-b {rate}" for rate in rates) or "other bit rates (-b)"
    makers = "".join(f", the factory setting of {make}" for make in rates.values())
    single_node_hint = _SINGLE_NODE.format(named) + makers
    if other_rates.possible(opening.interface, opening.options):
        return ["nothing was heard at any other bit rate either", single_node_hint]
    if opening.interface == "socketcan":
        return [_SYSTEM.format(opening.channel, next(iter(rates), _OTHER_RATE)), single_node_hint]
    return [_NO_MODE, single_node_hint] if interfaces.sets_rate(opening.interface, opening.options) else []


def show(traffic: BitRateTraffic | None, opening: Opening) -> None:
    """Print the traffic received at another bit rate, or the next steps."""
    if traffic is None:
        for line in advice(opening):
            say(line)
        return
    for line in lines(traffic):
        say(line)
    say_next(f"use this rate: -b {traffic.bitrate}, or bitrate = {traffic.bitrate} in [bus]")
