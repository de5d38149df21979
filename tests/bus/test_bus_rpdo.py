"""The order of RPDO frames: no drive may see a new set-point edge before its target."""

from __future__ import annotations

import struct

import pytest

from axisbus.bus.pdo.mapping import DevicePdos, MapEntry
from axisbus.bus.pdo.plan import PdoRequirements, Policy, make_plan
from axisbus.bus.pdo.rpdo import RpdoImage, arrange
from axisbus.errors import StateError
from kit.bus.pdo_configurations import GENERIC, NO_TORQUE, mapped, objects, rpdo


def images(
    device: DevicePdos, wanted: PdoRequirements | None = None, more: dict[int, MapEntry] | None = None
) -> list[RpdoImage]:
    plan = make_plan(5, device, objects() | (more or {}), wanted or NO_TORQUE, Policy(remap=False))
    made = [RpdoImage(pdo) for pdo in plan.active if pdo.receive]
    for image in made:
        for entry, _ in image.unknown:
            image.put(entry.index, entry.subindex, 0)
    return made


# RPDO2 6040+6060, RPDO3 6040+607A, RPDO4 6040+60FF
MODE, POSITION, VELOCITY = 0x305, 0x405, 0x505


def mode(word: int, value: int) -> tuple[int, bytes]:
    return MODE, struct.pack("<Hb", word, value)


def position(word: int, value: int) -> tuple[int, bytes]:
    return POSITION, struct.pack("<Hi", word, value)


def velocity(word: int, value: int) -> tuple[int, bytes]:
    return VELOCITY, struct.pack("<Hi", word, value)


def test_the_frame_whose_target_changed_is_sent_first() -> None:
    fixed = images(GENERIC)
    arrange(fixed, {"mode": 1, "target_position": 100}, 0x0F, 0x0F)
    frames = arrange(fixed, {"mode": 1, "target_position": 200}, 0x1F, 0x0F)
    assert frames == [position(0x1F, 200), mode(0x1F, 1)]


def test_two_changed_targets_are_sent_before_the_edge() -> None:
    """The first frame must not carry the edge, because the second one still has the old target."""
    fixed = images(GENERIC)
    arrange(fixed, {"mode": 1, "target_position": 100, "target_velocity": 10}, 0x0F, 0x0F)
    frames = arrange(fixed, {"mode": 1, "target_position": 200, "target_velocity": 20}, 0x1F, 0x0F)
    assert frames == [
        position(0x0F, 200),
        velocity(0x1F, 20),
        mode(0x1F, 1),
        position(0x1F, 200),
    ]


def test_an_edge_is_never_sent_before_a_new_value() -> None:
    """Whatever the order: replay the frames into a drive that takes each at once, and compare its values at the edge."""
    fixed = images(GENERIC)
    arrange(fixed, {"mode": 1, "target_position": 0, "target_velocity": 0}, 0x0F, 0x0F)
    drive = {MODE: 1, POSITION: 0, VELOCITY: 0}
    word = 0x0F
    for can_id, data in arrange(fixed, {"mode": 3, "target_position": -7, "target_velocity": 9}, 0x1F, 0x0F):
        new = struct.unpack_from("<H", data)[0]
        drive[can_id] = int.from_bytes(data[2:], "little", signed=True)
        if new & 0x10 and not word & 0x10:
            assert drive == {MODE: 3, POSITION: -7, VELOCITY: 9}
        word = new
    assert word == 0x1F


def test_a_frame_with_only_a_target_is_sent_before_the_controlword() -> None:
    apart = images(DevicePdos((rpdo(1, "6040/16"), rpdo(2, "607A/32")), ()))
    arrange(apart, {"target_position": 1}, 0x0F, None)
    frames = arrange(apart, {"target_position": 2}, 0x1F, 0x0F)
    assert frames == [(0x305, b"\x02\0\0\0"), (0x205, b"\x1f\0")]


def test_a_changed_target_alone_makes_the_controlwords_frame_wait_for_it() -> None:
    apart = images(DevicePdos((rpdo(1, "6040/16 6060/8"), rpdo(2, "607A/32")), ()))
    arrange(apart, {"mode": 1, "target_position": 1}, 0x0F, None)
    frames = arrange(apart, {"mode": 8, "target_position": 2}, 0x1F, 0x0F)
    assert frames == [(0x305, b"\x02\0\0\0"), (0x205, b"\x1f\0\x08")]  # each once


def test_only_rpdos_in_use_are_sent() -> None:
    fixed = images(GENERIC)
    assert arrange(fixed, {"target_position": 5}, 0x0F, None) == [position(0x0F, 5)]
    assert arrange(fixed, {}, 0x06, 0x0F) == [mode(0x06, 0)]  # one frame is enough for the controlword
    apart = images(DevicePdos((rpdo(1, "6040/16 607A/32"), rpdo(2, "60FF/32")), ()))
    assert [can_id for can_id, _ in arrange(apart, {}, 0x0F, None)] == [0x205]
    assert [can_id for can_id, _ in arrange(apart, {"target_velocity": 0}, 0x0F, None)] == [0x305, 0x205]


def test_without_a_controlword_nothing_that_holds_it_is_sent() -> None:
    apart = images(DevicePdos((rpdo(1, "6040/16 607A/32"), rpdo(2, "60FF/32")), ()))
    assert arrange(apart, {"target_position": 5, "target_velocity": 7}, None, None) == [
        (0x305, b"\x07\0\0\0")
    ]
    # the target was taken all the same, and travels with the next controlword
    assert arrange(apart, {}, 0x06, None) == [(0x205, struct.pack("<Hi", 0x06, 5))]


def test_a_value_stays_as_it_was_last_given() -> None:
    fixed = images(GENERIC)
    arrange(fixed, {"target_position": -1}, 0x0F, None)
    assert position(0x0F, -1) in arrange(fixed, {"target_position": -1}, 0x0F, 0x0F)


def test_bytes_that_belong_to_others_are_never_zeroed() -> None:
    """A profile velocity beside the target position, as many drives map it, and a dummy."""
    image = images(DevicePdos((rpdo(1, "6040/16 607A/32 0005/8"), rpdo(2, "6060/8 6081/32")), ()))[-1]
    assert image.mapping == mapped("6060/8 6081/32")
    image.put(0x6081, 0, 5000)
    assert arrange([image], {"mode": 3}, None, None) == [(0x305, b"\x03" + (5000).to_bytes(4, "little"))]


def test_a_dummy_is_sent_as_zero() -> None:
    image = images(DevicePdos((rpdo(1, "607A/32 0005/8 6060/8"),), ()))[0]
    assert arrange([image], {"target_position": -1, "mode": -1}, None, None) == [
        (0x205, b"\xff\xff\xff\xff\0\xff")
    ]


@pytest.mark.parametrize(
    ("text", "bits"), [("6040/16 607A/32", 0), ("607A/32 6040/16", 32), ("6060/8 0005/8 6040/16", 16)]
)
def test_the_position_of_the_controlword_in_the_mapping_is_known(text: str, bits: int) -> None:
    """It is looked for there in the frames of a program that has ended."""
    image = images(DevicePdos((rpdo(1, text),), ()))[0]
    assert image.holds_controlword
    assert image.controlword_shift == bits
    _, data = image.frame(0xABCD)
    assert int.from_bytes(data, "little") >> bits & 0xFFFF == 0xABCD


def test_a_controlword_that_is_mapped_twice_has_the_same_value_in_both() -> None:
    """A copy of 0 would be *disable voltage*."""
    image = images(DevicePdos((rpdo(1, "6040/16 607A/32 6040/16"),), ()))[0]
    both = struct.pack("<HiH", 0x0F, 5, 0x0F)
    assert arrange([image], {"target_position": 5}, 0x0F, None) == [(0x205, both)]
    assert image.with_controlword(both, 0x02) == (0x205, struct.pack("<HiH", 0x02, 5, 0x02))
    # The watchdog process clears all bits of the second controlword but that of a quick stop.
    assert image.controlword_shift == 0
    left = int.from_bytes(both, "little") & ~image.cleared_bits
    assert left.to_bytes(8, "little") == struct.pack("<HiH", 0x0F, 5, 0x02)


def test_an_image_with_an_unknown_value_is_not_sent() -> None:
    plan = make_plan(5, GENERIC, objects(), NO_TORQUE, Policy(remap=False))
    raw = [RpdoImage(pdo) for pdo in plan.active if pdo.receive]
    with pytest.raises(StateError, match="RPDO2 cannot be sent") as caught:
        arrange(raw, {}, 0x0F, None)
    assert "6060:00/8" in caught.value.observed


def test_bits_of_a_mapping_are_packed_exactly() -> None:
    """A 4-bit object between the values: no neighbour is overwritten."""
    image = images(
        DevicePdos((rpdo(1, "6040/16 2000/4 607A/32 2001/4"),), ()),
        PdoRequirements((), ("controlword", "target_position")),
    )[0]
    image.put(0x2000, 0, 0xA)
    image.put(0x2001, 0, 0x5)
    ((_, data),) = arrange([image], {"target_position": -2}, 0x0F, None)
    raw = int.from_bytes(data, "little")
    assert len(data) == 7
    assert raw & 0xFFFF == 0x0F
    assert raw >> 16 & 0xF == 0xA
    assert raw >> 20 & 0xFFFFFFFF == 0xFFFFFFFE
    assert raw >> 52 & 0xF == 0x5
