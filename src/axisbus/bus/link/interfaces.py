"""What is known of python-can's interfaces without looking into it, which takes a while to import."""

from __future__ import annotations

from collections.abc import Mapping

MODBUS = "modbus"  # no interface of python-can's, but ours: modules on a serial line (``relayed``)
NO_RATE = frozenset({"virtual", "udp_multicast"})  # interfaces without a wire
# Interfaces whose bitrate is not ours to set: the link, a daemon, or no wire at all.
RATE_ELSEWHERE = NO_RATE | {"socketcan", "socketcand"}


def sets_rate(interface: str, options: Mapping[str, object]) -> bool:
    """Whether the bit rate is set when the adapter is opened, by ``bitrate`` alone."""
    return interface not in RATE_ELSEWHERE and "timing" not in options
