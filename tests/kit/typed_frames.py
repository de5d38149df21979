"""Frames as a person types them, for the tests of the decoder."""

from __future__ import annotations

from axisbus.cia301.frame import CanFrame
from axisbus.trace import frame_formats
from axisbus.trace.context import NOTHING, TraceContext
from axisbus.trace.decoded import Decoded
from axisbus.trace.decoder import Decoder

STEP = 0.001


class Wire:
    """A decoder that is fed with frames one millisecond apart."""

    def __init__(self, known: TraceContext = NOTHING) -> None:
        self.decoder = Decoder(known)
        self.time = 0.0

    def __call__(self, can_id: int, data: str = "", **flags: bool) -> Decoded:
        """Feed a frame of hexadecimal digits."""
        self.time += STEP
        return self.decoder.feed(CanFrame(self.time, can_id, bytes.fromhex(data), **flags))

    def says(self, can_id: int, data: str = "", **flags: bool) -> str:
        """Feed a sound frame and return its words."""
        one = self(can_id, data, **flags)
        assert not one.problem, one.problem
        return frame_formats.what(one)


def crc16(data: bytes) -> int:
    """CRC of SDO block transfer, bit by bit as CiA 301 7.2.4.3.16 describes it (x^16 + x^12 + x^5 + 1, from 0)."""
    register = 0
    for octet in data:
        for bit in range(7, -1, -1):
            out = (register >> 15) ^ (octet >> bit & 1)
            register = (register << 1 & 0xFFFF) ^ (0x1021 if out else 0)
    return register
