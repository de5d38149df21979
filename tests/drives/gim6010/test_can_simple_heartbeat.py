"""The layouts of the heartbeat by the manual (v2.2, 4.1.2) and by owners, and the conclusions from its life counter."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.can_simple.codec import Reason, Unexpected
from axisbus.drives.gim6010.can_simple.heartbeat import ALL, Heartbeat, HeartbeatLayout, Heartbeats, read

FIRST, COUNTED, NEWEST = HeartbeatLayout


def beat(tail, *, error=0, state=8):
    return error.to_bytes(4, "little") + bytes((state,)) + bytes.fromhex(tail)


# bytes 5 to 7; layouts; motor, encoder, controller, system fault; trajectory done; life
@pytest.mark.parametrize(
    ("tail", "layouts", "faults", "done", "life"),
    [
        ("00 00 00", {FIRST, COUNTED, NEWEST}, (False, False, False, None), False, None),
        ("01 00 00", {FIRST, COUNTED, NEWEST}, (True, False, False, None), False, None),
        ("00 01 00", {FIRST, COUNTED, NEWEST}, (False, True, False, None), False, None),
        ("00 00 01", {FIRST, COUNTED, NEWEST}, (False, False, True, None), False, None),
        ("00 00 80", {FIRST, COUNTED, NEWEST}, (False, False, False, None), None, None),
        ("80 00 07", {COUNTED, NEWEST}, (False, False, False, None), True, 7),
        ("02 00 10", {COUNTED, NEWEST}, (False, True, False, None), False, 16),
        ("04 1F 10", {COUNTED, NEWEST}, (False, False, True, None), False, 16),
        ("08 00 10", {NEWEST}, (False, False, False, True), False, 16),
        ("8F 00 FF", {NEWEST}, (True, True, True, True), True, 255),
        ("70 00 10", set(), (None, None, None, None), None, None),
    ],
)
def test_one_frame_is_decoded_as_far_as_its_bytes_allow(tail, layouts, faults, done, life):
    found = read(1, beat(tail))
    assert (found.axis_error, found.state) == (0, 8)
    assert found.layouts == layouts
    assert (found.motor_fault, found.encoder_fault, found.controller_fault, found.system_fault) == faults
    assert (found.trajectory_done, found.life) == (done, life)


@pytest.mark.parametrize(
    ("last", "done"), [("00", False), ("80", True), ("08", True), ("88", True), ("81", True)]
)
def test_the_first_layout_takes_either_bit_for_trajectory_done(last, done):
    assert read(1, beat(f"00 00 {last}"), {FIRST}).trajectory_done is done


def test_faults_are_named():
    assert read(1, beat("05 00 10", error=0x40)).faults == ("axis", "motor", "controller")
    assert read(1, beat("00 00 10")).faults == ()


def heard(tails, **how):
    watched = Heartbeats()
    for tail in tails:
        watched = watched.after(1, beat(tail, **how))
        assert isinstance(watched, Heartbeats)
    return watched


def test_a_counter_that_counts_is_a_later_layout():
    watched = heard(["00 00 00", "00 00 01", "00 00 02"])
    assert watched.layouts == {COUNTED, NEWEST}
    assert (watched.last.life, watched.missed, watched.heard) == (2, 0, 3)


def test_a_constant_byte_is_not_a_counter():
    watched = heard(["00 00 80"] * 4)
    assert watched.layouts == {FIRST}
    assert watched.last.trajectory_done is True


def test_a_repeated_frame_proves_no_layout():
    assert heard(["00 00 02", "00 00 03", "00 00 03", "00 00 04"]).layouts == {COUNTED, NEWEST}


def test_other_firmware_after_a_restart_is_learned_again():
    assert heard(["00 00 80"] * 4 + ["80 00 02", "80 00 03"]).layouts == {COUNTED, NEWEST}


@pytest.mark.parametrize(
    ("lives", "missed", "gap", "restarts"),
    [
        ((250, 251, 252), 0, 0, 0),
        ((250, 252), 1, 1, 0),
        ((254, 3, 4), 4, 0, 0),
        ((20, 2), 0, 0, 1),
        ((20, 148), 127, 127, 0),
        ((20, 20, 21), 0, 0, 0),
    ],
)
def test_gaps_of_the_life_counter(lives, missed, gap, restarts):
    watched = heard([f"80 00 {life:02X}" for life in lives])
    assert (watched.missed, watched.gap, watched.restarts) == (missed, gap, restarts)


@given(st.lists(st.binary(max_size=12), max_size=8))
def test_no_frame_raises_and_a_fault_bit_is_never_lost(frames):
    watched = Heartbeats()
    for data in frames:
        found = read(1, data)
        if len(data) < 8:
            assert isinstance(found, Unexpected)
            assert found.reason is Reason.LENGTH
        else:
            assert isinstance(found, Heartbeat)
            assert found.layouts <= ALL
            if NEWEST in found.layouts and data[5] & 7:
                assert found.faults
        after = watched.after(1, data)
        watched = after if isinstance(after, Heartbeats) else watched
    assert watched.heard <= len(frames)
