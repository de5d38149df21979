"""Determine to which of its endpoints a fleet has a connection."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Sequence


def unreached(endpoints: Sequence[str], links: Iterable[str]) -> list[str]:
    """Return the endpoints without a link; ``links``: the far ends of the present links, as Zenoh writes them.

    An endpoint given by host name counts as reached if there is a link to its port that belongs to no other endpoint.
    """
    there = {_place(link) for link in links}
    left = there - {_place(endpoint) for endpoint in endpoints}
    missing = []
    for endpoint in endpoints:
        place = _place(endpoint)
        by_name = None if place in there or not _is_name(place) else _same_port(place, left)
        if by_name is not None:
            left.discard(by_name)
        elif place not in there:
            missing.append(endpoint)
    return missing


def _place(endpoint: str) -> str:
    """Return an endpoint without the metadata and configuration after its address."""
    return endpoint.partition("?")[0].partition("#")[0]


def _is_name(place: str) -> bool:
    host = place.partition("/")[2].rpartition(":")[0].strip("[]")
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return True
    return False


def _same_port(place: str, links: Iterable[str]) -> str | None:
    protocol, _, address = place.partition("/")
    port = address.rpartition(":")[2]
    return next(
        (
            each
            for each in sorted(links)
            if each.startswith(f"{protocol}/") and each.rpartition(":")[2] == port
        ),
        None,
    )
