"""A rescue finds the last sent frame in shared memory, with a quick stop in the place of the controlword."""

from __future__ import annotations

import mmap

from hypothesis import given
from hypothesis import strategies as st

from axisbus.ipc import rescue_memory
from axisbus.ipc.rescue_memory import CoreStage, LifelineWriter, RescueRpdo

AT = 32
QUICK_STOP = b"\x02\x00"


def made(*held: RescueRpdo, axes: int = 4) -> tuple[mmap.mmap, LifelineWriter]:
    memory = mmap.mmap(-1, AT + rescue_memory.size_of(axes))
    writer = LifelineWriter(memory, AT)
    writer.enter(held)
    writer.stage(CoreStage.RUNNING)
    return memory, writer


def test_a_node_that_was_not_commanded_is_not_stopped():
    memory, _ = made(RescueRpdo(0, 0x201), RescueRpdo(1, 0x202))
    assert rescue_memory.found(memory, AT) == rescue_memory.RescueTargets((), ())
    assert rescue_memory.stage_of(memory, AT) is CoreStage.RUNNING


def test_the_last_frame_counts_and_every_other_bit_of_it_stays():
    memory, writer = made(RescueRpdo(0, 0x201, 8), RescueRpdo(1, 0x202))
    writer.touched(0)
    for data in (b"\x08\x0f\x00\x01\x02\x03\x04", b"\x08\x1f\x80\xaa\xbb\xcc\xdd"):
        writer.sent({0x201: data, 0x305: b"no controlword"})
    assert rescue_memory.found(memory, AT) == rescue_memory.RescueTargets(
        (0,), ((0x201, b"\x08" + QUICK_STOP + b"\xaa\xbb\xcc\xdd"),)
    )


def test_an_axis_without_a_controlword_by_pdo_is_listed_for_the_rescue():
    memory, writer = made(RescueRpdo(2))
    writer.touched(2)
    assert rescue_memory.found(memory, AT) == rescue_memory.RescueTargets((2,), ())


def test_an_axis_with_two_such_frames_is_stopped_by_both():
    memory, writer = made(RescueRpdo(0, 0x201), RescueRpdo(0, 0x301, 32))
    writer.touched(0)
    writer.sent({0x201: b"\x0f\x00", 0x301: b"\x01\x02\x03\x04\x0f\x00"})
    found = rescue_memory.found(memory, AT)
    assert found.axes == (0,)
    assert found.frames == ((0x201, QUICK_STOP), (0x301, b"\x01\x02\x03\x04" + QUICK_STOP))


def test_nodes_that_are_added_later_are_entered_at_the_end():
    memory, writer = made(RescueRpdo(0, 0x201))
    writer.enter([RescueRpdo(3, 0x204)])
    writer.stage(CoreStage.LEAVING)
    writer.touched(3)
    writer.sent({0x204: b"\x0f\x00"})
    assert rescue_memory.found(memory, AT) == rescue_memory.RescueTargets((3,), ((0x204, QUICK_STOP),))
    assert rescue_memory.stage_of(memory, AT) is CoreStage.LEAVING


@given(st.binary(min_size=2, max_size=8), st.integers(0, 6))
def test_only_the_controlword_is_another_one(data, place):
    place = min(place, len(data) - 2)
    memory, writer = made(RescueRpdo(0, 0x201, 8 * place))
    writer.touched(0)
    writer.sent({0x201: data})
    ((_, stop),) = rescue_memory.found(memory, AT).frames
    assert stop[place : place + 2] == QUICK_STOP
    assert stop[:place] + stop[place + 2 :] == data[:place] + data[place + 2 :]
