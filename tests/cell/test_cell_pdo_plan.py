"""The SYNC with which less urgent values are sent: every SYNC, unless the bus load is too high."""

from __future__ import annotations

import pytest

from axisbus.bus.pdo.plan import LAYOUT_INPUTS, LAYOUT_OUTPUTS
from axisbus.cell.model import BusConfig
from axisbus.cell.pdo_plan import slow_pace


def bus(period: float, bitrate: int | None = 1_000_000, **more) -> BusConfig:
    return BusConfig(interface="socketcan", bitrate=bitrate, scan_period=period, **more)


def load(axes: int, period: float, slow: int, bitrate: int = 1_000_000) -> float:
    """The share of the wire, added up frame by frame: 55 bits and 10 for each byte."""
    fast, seldom = (55 + 70) + (55 + 70), (55 + 60) + (55 + 40)
    return (55 + axes * (fast + seldom / slow)) / (bitrate * period)


@pytest.mark.parametrize(
    ("axes", "period", "slow"),
    [
        (1, 0.001, 2),
        (1, 0.002, 1),
        (3, 0.004, 1),
        (5, 0.004, 2),
        (7, 0.004, 8),  # a twentieth of the wire; 82 % of it with each
        (13, 0.004, 14),
        (3, 0.001, 13),
        (6, 0.002, 13),
        (33, 0.010, 14),
        (64, 0.020, 12),  # a quarter of a second at most
        (500, 0.250, 1),
        (2, 0.5, 1),
    ],
)
def test_values_are_sent_with_each_sync_if_the_load_permits_and_else_as_often_as_it_does(axes, period, slow):
    assert slow_pace(bus(period), axes) == slow
    if slow > 1 and slow * period < 0.25 - period:
        left = 0.5 - load(axes, period, 10**9)
        share = load(axes, period, slow) - load(axes, period, 10**9)
        assert share <= max(left, 0.05) + 1e-9
        assert load(axes, period, slow - 1) - load(axes, period, 10**9) > max(left, 0.05) - 1e-9


@pytest.mark.parametrize(("axes", "period"), [(3, 0.001), (6, 0.002), (13, 0.004), (33, 0.010)])
def test_a_full_wire_still_carries_the_cell(axes, period):
    assert load(axes, period, slow_pace(bus(period), axes)) < 0.9


def test_without_a_known_rate_or_without_sync_every_value_is_sent_as_often_as_possible():
    assert slow_pace(bus(0.001, None), 100) == 1
    assert slow_pace(bus(0.001, sync=False), 100) == 1


def test_the_bits_are_those_of_our_own_layout():
    sizes = {"controlword": 2, "statusword": 2, "mode": 1, "torque": 2}  # all others have four bytes

    def bits(names) -> int:
        return 55 + 10 * sum(sizes.get(name, 4) for name in names)

    assert bits(LAYOUT_OUTPUTS[0]) == bits(LAYOUT_INPUTS[0]) == 125
    assert [bits(names) for names in LAYOUT_INPUTS[1:]] == [115, 95]
