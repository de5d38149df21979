"""One CAN frame as it was on the wire, with nothing said of what it means, and how many bits one takes."""

from __future__ import annotations

from typing import NamedTuple

UNSTUFFED = 13  # CRC delimiter, acknowledge (2), end of frame (7), intermission (3): not stuffed


class CanFrame(NamedTuple):
    """A classic CAN frame; ``time`` in seconds of whatever clock stamped it (a log's epoch, an adapter's own).

    ``remote`` frames carry no data; an ``error`` frame is what an adapter reports of the wire, its ``can_id`` and data are the
    driver's. ``extended`` tells an identifier of 29 bits. ``channel`` is the name of the bus in a recording.
    """

    time: float
    can_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    error: bool = False
    channel: str = ""


class BusTraffic(NamedTuple):
    """What a bus has carried up to ``time`` (seconds, monotonic), both ways: classic frames, and the octets of their data."""

    time: float
    frames: int
    octets: int

    def load(self, since: BusTraffic, bitrate: int) -> tuple[float, float]:
        """Return the part of a bus of ``bitrate`` bit/s (0 to 1) that was taken since then: without stuff bits, and with the most.

        Both are 0 where no time has passed. Frames count as those with identifiers of 11 bits.
        """
        seconds, frames = self.time - since.time, self.frames - since.frames
        if seconds <= 0:
            return 0.0, 0.0
        plain = plain_bits(0) * frames + 8 * (self.octets - since.octets)
        stuffed = plain - (UNSTUFFED + 1) * frames
        return plain / (bitrate * seconds), (plain + stuffed / 4) / (bitrate * seconds)


def plain_bits(data_bytes: int, extended: bool = False) -> int:
    """Return a frame's bits without any stuff bit, intermission included."""
    return (54 if extended else 34) + 8 * data_bytes + UNSTUFFED


def worst_bits(data_bytes: int, extended: bool = False) -> int:
    """Return the longest that a frame of this size can be: a stuff bit after every four of the stuffed part but the first."""
    plain = plain_bits(data_bytes, extended)
    return plain + (plain - UNSTUFFED - 1) // 4
