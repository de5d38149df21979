"""MIT control: packed as the manual says, brought to its range and never wrapped, and never eight zeros."""

from __future__ import annotations

import math
from itertools import product

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from axisbus.drives.gim6010.can_simple import mit
from axisbus.drives.gim6010.can_simple.codec import Outgoing, Reason, Unexpected
from axisbus.drives.gim6010.can_simple.mit import MANUAL, MitCommand, MitRanges
from axisbus.errors import ArgumentError

anything = st.floats(allow_nan=False, allow_infinity=False)
near = st.sampled_from([0.0, -12.5, 12.5, -65.0, 65.0, 500.0, 5.0, -50.0, 50.0, 12.625, 50.5, 1e-9, -1e-9])
values = anything | near
ranges = st.just(MANUAL) | st.builds(MitRanges, *[st.floats(1e-3, 1e4)] * 5)
NAMES = ("position", "velocity", "kp", "kd", "torque")
WIRE = {"position": 65535, "velocity": 4095, "kp": 4095, "kd": 4095, "torque": 4095}


@pytest.mark.parametrize(
    ("command", "data"),
    [
        ((0, 0, 0, 0, 0), "80 00 80 00 00 00 08 00"),  # the neutral frame that owners use
        ((12.5, 65, 500, 5, 50), "FF FF FF FF FF FF FF FF"),
        ((-12.5, -65, 500, 5, -50), "00 00 00 0F FF FF F0 00"),
        # by the manual's formulas: (1 + 12.5) * 65535 / 25 = 35389, (2 + 65) * 4095 / 130 = 2110.5, 100 * 4095 / 500 = 819,
        # 1 * 4095 / 5 = 819, (3 + 50) * 4095 / 100 = 2170.35
        ((1, 2, 100, 1, 3), "8A 3D 83 F3 33 33 38 7A"),
    ],
)
def test_the_manual_s_packing(command, data):
    assert mit.pack(1, MitCommand(*command)) == mit.Packed(Outgoing(0x028, bytes.fromhex(data)))


@given(values, values, values, values, values, ranges)
@example(-12.5, -65.0, 0.0, 0.0, -50.0, MANUAL)
@example(-1e300, -1e300, -1.0, -1.0, -1e300, MANUAL)
def test_no_command_becomes_eight_zeros(position, velocity, kp, kd, torque, ranges):
    packed = mit.pack(7, MitCommand(position, velocity, kp, kd, torque), ranges)
    assert len(packed.frame.data) == 8
    assert any(packed.frame.data)


@pytest.mark.parametrize("node", [0, 1, 63])
@pytest.mark.parametrize(
    ("data", "remote"), [(bytes(8), False), (b"", False), (bytes(3), False), (b"", True), (b"\1", True)]
)
def test_no_caller_makes_a_frame_of_zeros_by_hand(node, data, remote):
    with pytest.raises(ArgumentError, match="full negative torque"):
        Outgoing(node << 5 | 8, data, remote)
    assert Outgoing(node << 5 | 9, data, remote).data == data


def test_a_change_that_avoids_a_frame_of_zeros_has_no_effect_and_is_reported():
    packed = mit.pack(1, MitCommand(-12.5, -65, 0, 0, -50))
    assert packed.frame.data == bytes.fromhex("00 00 00 10 00 00 00 00")
    assert packed.clipped == ()
    assert [str(each) for each in packed.shifted] == ["velocity -64.9683 instead of -65"]
    for gains in ((0.2, 0), (0, 0.01)):  # a gain other than zero alone prevents a frame of zeros
        assert mit.pack(1, MitCommand(-12.5, -65, *gains, -50)).shifted == ()


@given(values, values, values, values, values, ranges)
def test_a_value_is_restored_within_half_a_step_or_is_reported(position, velocity, kp, kd, torque, ranges):
    command = MitCommand(position, velocity, kp, kd, torque)
    packed = mit.pack(7, command, ranges)
    back = mit.unpack(7, packed.frame.data, ranges)
    told = {each.name: each for each in packed.clipped}
    for name in NAMES:
        high = getattr(ranges, name)
        low = 0.0 if name in ("kp", "kd") else -high
        asked = getattr(command, name)
        sent = min(max(asked, low), high)
        assert (name in told) == (asked != sent)
        step = (high - low) / WIRE[name]
        slack = 1.0 if any(each.name == name for each in packed.shifted) else 0.5
        assert abs(getattr(back, name) - sent) <= step * (slack + 1e-6)


@pytest.mark.parametrize(("beyond", "wrapped"), [(12.625, -12.376), (-12.6, 12.4)])
def test_a_position_beyond_the_range_does_not_wrap(beyond, wrapped):
    packed = mit.pack(1, MitCommand(beyond, 0, 10, 1, 0))
    back = mit.unpack(1, packed.frame.data)
    assert back.position == math.copysign(12.5, beyond)
    assert abs(back.position - wrapped) > 20
    assert [(each.name, each.sent) for each in packed.clipped] == [("position", math.copysign(12.5, beyond))]


@pytest.mark.parametrize(
    ("name", "wild"), list(product(NAMES, [math.nan, math.inf, -math.inf, True, "1", None]))
)
def test_a_value_that_is_not_a_number_is_refused(name, wild):
    with pytest.raises(ArgumentError, match=name):
        MitCommand(**{**dict.fromkeys(NAMES, 0.0), name: wild})


@pytest.mark.parametrize(("name", "wild"), list(product(NAMES, [math.nan, math.inf, 0.0, -1.0, 1e300])))
def test_invalid_ranges_are_refused(name, wild):
    with pytest.raises(ArgumentError, match=f"range of MIT control's {name}"):
        MitRanges(**{name: wild})


def test_the_ranges_change_the_wire():
    narrow = MitRanges(position=12.5, torque=10.0)
    assert mit.unpack(1, mit.pack(1, MitCommand(0, 0, 0, 0, 5), narrow).frame.data).torque == pytest.approx(
        25, abs=0.03
    )


@pytest.mark.parametrize("padding", ["", "00 00", "AA 55"])
def test_the_answer(padding):
    found = mit.read(5, bytes.fromhex(f"05 8A 3D 83 F8 7A {padding}"))
    assert (found.node, found.at_end) == (5, ())
    assert found.position == pytest.approx(1.0, abs=2e-4)
    assert found.velocity == pytest.approx(2.0, abs=0.02)
    assert found.torque == pytest.approx(3.0, abs=0.02)


@pytest.mark.parametrize(
    ("data", "reason"),
    [("05 8A 3D 83 F8", Reason.LENGTH), ("06 8A 3D 83 F8 7A 00 00", Reason.WRONG_NODE), ("", Reason.LENGTH)],
)
def test_an_invalid_answer_is_refused(data, reason):
    found = mit.read(5, bytes.fromhex(data))
    assert isinstance(found, Unexpected)
    assert found.reason is reason


def test_values_at_an_end_are_named():
    assert mit.read(1, bytes.fromhex("01 FF FF 80 08 00")).at_end == ("position",)
    assert mit.read(1, bytes.fromhex("01 00 00 00 0F FF")).at_end == (*NAMES[:2], "torque")
