"""One CAN frame as it was on the wire, with nothing said of what it means."""

from __future__ import annotations

from typing import NamedTuple


class Frame(NamedTuple):
    """A classic CAN frame; ``time`` in seconds of whatever clock stamped it (a log's epoch, an adapter's own).

    ``remote`` frames carry no data; an ``error`` frame is what an adapter reports of the wire, its ``can_id`` and data are the
    driver's. ``extended`` tells an identifier of 29 bits.
    """

    time: float
    can_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    error: bool = False
