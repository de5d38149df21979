"""To which of the endpoints that a fleet is to connect to there is a connection."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Sequence


def unreached(endpoints: Sequence[str], links: Iterable[str]) -> list[str]:
    """Return the endpoints to which no link leads; ``links``: the far ends of those that there are, as Zenoh writes them.

    A host by its name is reached where a link leads to its port, for nobody else among the endpoints has that link.
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
    """Return an endpoint without what is said of it behind its address."""
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
