"""One CAN frame as transmitted, without an interpretation, and the number of its bits."""

from __future__ import annotations

from typing import NamedTuple

UNSTUFFED = 13  # CRC delimiter, acknowledge (2), end of frame (7), intermission (3): not stuffed


class CanFrame(NamedTuple):
    """A classic CAN frame; ``time`` in seconds of the clock that stamped it (a log's epoch, an adapter's own).

    ``remote`` frames carry no data. An ``error`` frame is a report of the adapter; its ``can_id`` and data are specific to the
    driver. ``extended``: the identifier has 29 bits. ``channel`` is the name of the bus in a recording.
    """

    time: float
    can_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    error: bool = False
    channel: str = ""


class BusTraffic(NamedTuple):
    """The traffic of a bus up to ``time`` (seconds, monotonic), sent and received: classic frames, and bytes of their data."""

    time: float
    frames: int
    octets: int

    def load(self, since: BusTraffic, bitrate: int) -> tuple[float, float]:
        """Return the load (0 to 1) of a bus of ``bitrate`` bit/s since ``since``: without stuff bits, and with the maximum of them.

        Both are 0 if no time has passed. All frames count as frames with 11-bit identifiers.
        """
        seconds, frames = self.time - since.time, self.frames - since.frames
        if seconds <= 0:
            return 0.0, 0.0
        plain = plain_bits(0) * frames + 8 * (self.octets - since.octets)
        stuffed = plain - (UNSTUFFED + 1) * frames
        return plain / (bitrate * seconds), (plain + stuffed / 4) / (bitrate * seconds)


def plain_bits(data_bytes: int, extended: bool = False) -> int:
    """Return a frame's bits without stuff bits, intermission included."""
    return (54 if extended else 34) + 8 * data_bytes + UNSTUFFED


def worst_bits(data_bytes: int, extended: bool = False) -> int:
    """Return the maximum bits of a frame of this size: in the stuffed part, a stuff bit after every four bits but the first."""
    plain = plain_bits(data_bytes, extended)
    return plain + (plain - UNSTUFFED - 1) // 4
