"""MIT control on the wire (manual 4.1.2): fields of 16 and 12 bits, most significant bits first, at the output shaft.

Like the firmware, the packing truncates and does not limit: a value beyond its range wraps to the other end.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class Ranges(NamedTuple):
    """Ends of the fields' ranges: rad, rad/s, N·m/turn, N·m·s/turn, N·m."""

    position: float = 12.5
    velocity: float = 65.0
    kp: float = 500.0
    kd: float = 5.0
    torque: float = 50.0


class Order(NamedTuple):
    """A command: rad, rad/s and N·m at the output shaft, and the gains."""

    position: float
    velocity: float
    kp: float
    kd: float
    torque: float


def unpack(data: bytes, ranges: Ranges) -> Order:
    """Return the command in 8 bytes."""
    bits = int.from_bytes(data[:8], "big")
    return Order(
        _signed(bits >> 48, 16, ranges.position),
        _signed(bits >> 36 & 0xFFF, 12, ranges.velocity),
        (bits >> 24 & 0xFFF) * ranges.kp / 4095,
        (bits >> 12 & 0xFFF) * ranges.kd / 4095,
        _signed(bits & 0xFFF, 12, ranges.torque),
    )


def pack_answer(node_id: int, position: float, velocity: float, torque: float, ranges: Ranges) -> bytes:
    """Return the answer in 8 bytes, the last two of which are 0; rad, rad/s and N·m at the output shaft."""
    bits = _field(position, 16, ranges.position) << 24
    bits |= _field(velocity, 12, ranges.velocity) << 12 | _field(torque, 12, ranges.torque)
    return bytes([node_id]) + bits.to_bytes(5, "big") + bytes(2)


def _signed(raw: int, width: int, end: float) -> float:
    return raw * 2 * end / ((1 << width) - 1) - end


def _field(value: float, width: int, end: float) -> int:
    if not math.isfinite(value) or end <= 0.0:
        return 0
    most = (1 << width) - 1
    return math.floor((value + end) * most / (2 * end)) & most
