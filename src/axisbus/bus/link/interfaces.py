"""Facts on python-can's interfaces without importing python-can, which takes a while."""

from __future__ import annotations

from collections.abc import Mapping

NO_RATE = frozenset({"virtual", "udp_multicast"})  # interfaces without a wire
# Interfaces whose bitrate axisbus does not set: the link or a daemon sets it, or there is no wire.
RATE_ELSEWHERE = NO_RATE | {"socketcan", "socketcand"}


def sets_rate(interface: str, options: Mapping[str, object]) -> bool:
    """Whether opening the adapter sets the bit rate, by ``bitrate`` alone."""
    return interface not in RATE_ELSEWHERE and "timing" not in options
