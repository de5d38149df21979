"""Offsets of feed-forward in PDOs: an RPDO of their own where they are asked for, and 0 in every stop."""

from __future__ import annotations

import mmap
import struct

import pytest

from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.pdo.plan import PdoPlan, PdoRequirements, Policy, make_plan
from axisbus.bus.pdo.rpdo import RpdoImage, arrange
from axisbus.cia402.port import Outputs, ValueTransport
from axisbus.ipc import rescue_memory
from axisbus.ipc.rescue_memory import NO_WORD, LifelineWriter, RescueRpdo
from kit.bus.pdo_configurations import EMPTY, NODE, mapped, objects, rpdo

USUAL = ("controlword", "mode", "target_position", "target_velocity", "target_torque")


def planned(
    device: DevicePdos, *names: str, policy: Policy | None = None, unmappable: bool = False
) -> PdoPlan:
    wanted = PdoRequirements(outputs=(*USUAL, *names), synchronous_outputs=frozenset(names))
    return make_plan(NODE, device, objects(unmappable=(0x60B1, 0x60B2) if unmappable else ()), wanted, policy)


def test_feed_forward_objects_are_mapped_into_an_rpdo_of_their_own() -> None:
    plan = planned(EMPTY, "velocity_offset", "torque_offset")
    third = [pdo for pdo in plan.active if pdo.name == "RPDO3"]
    assert [pdo.target.mapping for pdo in third] == [mapped("60B1/32 60B2/16")]
    assert [pdo.target.cob_id for pdo in third] == [0x405]
    assert plan.outputs["velocity_offset"] is plan.outputs["torque_offset"] is ValueTransport.SYNC_PDO
    assert plan.impossible == ()


def test_feed_forward_objects_are_not_mapped_without_being_required() -> None:
    plain = make_plan(NODE, EMPTY, objects())
    assert [pdo.name for pdo in plain.active if pdo.receive] == ["RPDO1", "RPDO2"]
    assert "velocity_offset" not in plain.outputs
    plan = planned(EMPTY, "torque_offset")
    assert [pdo.target.mapping for pdo in plan.active if pdo.name == "RPDO3"] == [mapped("60B2/16")]


def test_a_drive_with_two_rpdos_gets_the_offsets_that_fit_and_the_others_are_reported() -> None:
    plan = planned(DevicePdos(EMPTY.rpdos[:2], EMPTY.tpdos), "velocity_offset", "torque_offset")
    assert plan.outputs["torque_offset"] is ValueTransport.SYNC_PDO
    assert plan.outputs["velocity_offset"] is ValueTransport.SDO
    assert plan.impossible == (
        "velocity offset must be transmitted in a synchronous PDO, but is transmitted by SDO",
    )


def test_offsets_that_cannot_be_mapped_are_reported() -> None:
    plan = planned(EMPTY, "torque_offset", unmappable=True)
    assert plan.outputs["torque_offset"] is ValueTransport.SDO
    assert any("60B2h" in note for note in plan.notes)


BESIDE = DevicePdos((rpdo(1, "6060/8 607A/32 6040/16", 1), rpdo(3, "60B1/32 60B2/16", 1)), ())
MIXED = DevicePdos((rpdo(1, "60B2/16 607A/32 6040/16", 1),), ())


def images(device: DevicePdos, *names: str) -> list[RpdoImage]:
    wanted = PdoRequirements((), ("controlword", "target_position", *names))
    plan = make_plan(NODE, device, objects(), wanted, Policy(remap=False))
    made = [RpdoImage(pdo) for pdo in plan.active]
    for image in made:
        for entry, _ in image.unknown:
            image.put(entry.index, 0, 0)
    return made


def test_a_stop_frame_takes_them_away_and_leaves_the_target() -> None:
    word, offsets = images(BESIDE, "velocity_offset", "torque_offset")
    given = {"target_position": 7, "velocity_offset": -500, "torque_offset": 30}
    frames = dict(arrange([word, offsets], given, 0x0F, None))
    assert frames[0x405] == struct.pack("<ih", -500, 30)
    assert offsets.with_controlword(frames[0x405], 2) == (0x405, bytes(6))
    assert word.with_controlword(frames[0x205], 2) == (0x205, struct.pack("<biH", 0, 7, 2))
    assert (word.cleared_bits, offsets.cleared_bits) == (0, (1 << 48) - 1)


def test_in_one_frame_with_the_controlword_too() -> None:
    (image,) = images(MIXED, "torque_offset")
    frame = image.frame_of(Outputs(0x0F, target_position=-3, torque_offset=-40))
    assert frame == (0x205, struct.pack("<hiH", -40, -3, 0x0F))
    assert image.with_controlword(frame[1], 2) == (0x205, struct.pack("<hiH", 0, -3, 2))
    assert image.cleared_bits == 0xFFFF


@pytest.mark.parametrize("shift", [NO_WORD, 48])
def test_a_rescue_takes_them_away(shift: int) -> None:
    memory = mmap.mmap(-1, rescue_memory.size_of(1))
    writer = LifelineWriter(memory, 0)
    writer.enter([RescueRpdo(0, 0x405, shift, (1 << 32) - 1), RescueRpdo(0, 0x205, 0)])
    writer.touched(0)
    writer.sent({0x405: struct.pack("<ihH", -500, 30, 0x0F), 0x205: b"\x0f\0\x07"})
    offsets, word = rescue_memory.found(memory, 0).frames
    assert offsets == (0x405, struct.pack("<ihH", 0, 30, 0x0F if shift == NO_WORD else 2))
    assert word == (0x205, b"\x02\0\x07")


def test_a_lifeline_has_room_for_all_of_them() -> None:
    axes = 32
    memory = mmap.mmap(-1, rescue_memory.size_of(axes))
    writer = LifelineWriter(memory, 0)
    for axis in range(axes):
        held = [RescueRpdo(axis, 0x1000 + 8 * axis + number, 0, 0xFF) for number in range(6)]
        writer.enter(held)
        writer.touched(axis)
    assert rescue_memory.found(memory, 0).axes == tuple(range(axes))
