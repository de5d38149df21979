"""Which frames give a master away: typed off CiA 301 7.3.5 (the predefined connection set), COB-ID by COB-ID."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.cia301.frame import CanFrame
from axisbus.cia301.master_detection import ExpectedMasters, MasterDetector, Sign, sign_of, words

CAST = ExpectedMasters(frozenset({1, 5}), frozenset({127}))
# From where to where, and whether frames with a byte of 05h there are a master's.
TABLE = [
    (0x000, 0x000, Sign.NMT),
    (0x001, 0x07F, None),
    (0x080, 0x080, Sign.SYNC),
    (0x081, 0x0FF, None),  # EMCY
    (0x100, 0x100, None),  # TIME
    (0x181, 0x1FF, None),  # TPDO1
    (0x201, 0x201, Sign.RPDO),
    (0x202, 0x204, None),  # of no node of the cell
    (0x205, 0x205, Sign.RPDO),
    (0x206, 0x300, None),  # TPDO2 among them
    (0x301, 0x301, Sign.RPDO),
    (0x381, 0x3FF, None),
    (0x405, 0x405, Sign.RPDO),
    (0x481, 0x4FF, None),
    (0x501, 0x501, Sign.RPDO),
    (0x580, 0x600, None),  # SDO responses
    (0x601, 0x67F, Sign.SDO),
    (0x680, 0x77E, None),  # heartbeats of slaves among them
    (0x77F, 0x77F, Sign.HEARTBEAT),
    (0x780, 0x7E4, None),
    (0x7E5, 0x7E5, Sign.LSS),
    (0x7E6, 0x7FF, None),
]


@pytest.mark.parametrize(("first", "last", "sign"), TABLE)
def test_each_cob_id_is_one_sign_of_a_master_or_none(first: int, last: int, sign: Sign | None) -> None:
    for can_id in range(first, last + 1):
        found = sign_of(CanFrame(0.0, can_id, b"\x05"), CAST)
        assert (found and found[0]) == sign, f"{can_id:03X}h"


def test_a_boot_up_message_is_no_heartbeat_and_the_toggle_bit_is_no_state() -> None:
    assert sign_of(CanFrame(0.0, 0x77F, b"\0"), CAST) is None
    assert sign_of(CanFrame(0.0, 0x77F, b"\x80"), CAST) is None
    assert sign_of(CanFrame(0.0, 0x77F, b"\x85"), CAST) == (Sign.HEARTBEAT, 127)
    assert sign_of(CanFrame(0.0, 0x77F, b""), CAST) is None


def test_only_guarding_is_a_sign_among_remote_frames() -> None:
    signs = {can_id: sign_of(CanFrame(0.0, can_id, remote=True), CAST) for can_id in range(0x800)}
    assert {can_id for can_id, found in signs.items() if found} == set(range(0x701, 0x780))


def test_identifiers_of_the_cells_own_devices_are_no_sign() -> None:
    cast = ExpectedMasters(frozenset({1}), frozenset({127}), excused=frozenset({0x201}))
    assert sign_of(CanFrame(0.0, 0x201, b"\0"), cast) is None
    assert sign_of(CanFrame(0.0, 0x301, b"\0"), cast) == (Sign.RPDO, 1)


FRAMES = st.builds(
    CanFrame,
    st.floats(0, 10),
    st.integers(0, 0x1FFF_FFFF) | st.integers(0, 0x7FF),
    st.binary(max_size=8),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)


@given(st.lists(FRAMES, max_size=40))
def test_any_frame_is_counted_once_and_can_be_reported(frames: list[CanFrame]) -> None:
    signs = MasterDetector(CAST)
    for frame in sorted(frames):
        signs.note(frame)
    found = [frame for frame in frames if sign_of(frame, CAST)]
    assert sum(one.count for one in signs.heard) == len(found)
    assert len(words(signs.heard)) == len({sign_of(frame, CAST)[0] for frame in found})  # type: ignore[index]
    assert not any(frame.extended or frame.error for frame in found)


def test_the_period_is_that_of_the_frames() -> None:
    signs = MasterDetector(CAST)
    for tick in range(11):
        signs.note(CanFrame(3.0 + tick * 0.01, 0x80))
    assert words(signs.heard) == ["SYNC (080h): 11, every 10.0 ms"]
