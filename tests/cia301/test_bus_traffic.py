"""The load that is worked out of counts, against the bits of each frame."""

from __future__ import annotations

import random

import pytest

from axisbus.check.bus_load import actual_bits
from axisbus.cia301.frame import BusTraffic, CanFrame


def test_frames_lie_between_no_stuff_bit_and_the_most():
    chance = random.Random(1)
    frames = [
        CanFrame(
            0.0, chance.randrange(1, 0x800), chance.choice((b"\0", b"\x55", b"\xa7")) * chance.randrange(9)
        )
        for _ in range(2000)
    ]
    octets = sum(len(frame.data) for frame in frames)
    least, most = BusTraffic(3.0, 2100, octets + 7).load(BusTraffic(1.0, 100, 7), 500_000)
    real = sum(map(actual_bits, frames)) / (2.0 * 500_000)
    assert least < real < most
    assert least == pytest.approx((47 * 2000 + 8 * octets) / 1e6)
    assert most == pytest.approx(least + (33 * 2000 + 8 * octets) / 4 / 1e6)


def test_without_time_there_is_no_load():
    assert BusTraffic(1.0, 5, 40).load(BusTraffic(1.0, 2, 16), 1_000_000) == (0.0, 0.0)
