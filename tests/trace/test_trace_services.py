"""Frames typed by hand after CiA 301 and CiA 305: the decoder's text of each."""

from __future__ import annotations

import pytest

from axisbus.trace.context import KnownNode, TraceContext
from axisbus.trace.decoded import FrameKind
from axisbus.trace.frame_formats import line, who
from kit.typed_frames import Wire


@pytest.mark.parametrize(
    ("can_id", "data", "kind", "node", "words"),
    [
        (0x000, "01 05", FrameKind.NMT, 5, "start: node 5"),
        (0x000, "80 00", FrameKind.NMT, None, "enter pre-operational: all nodes"),
        (0x000, "81 7F", FrameKind.NMT, 127, "reset node: node 127"),
        (0x000, "82 01", FrameKind.NMT, 1, "reset communication: node 1"),
        (0x080, "", FrameKind.SYNC, None, ""),
        (0x080, "07", FrameKind.SYNC, None, "counter 7"),
        # 43 200 000 ms after midnight, 15 000 days after 1984-01-01
        (0x100, "00 2E 93 02 98 3A", FrameKind.TIME, None, "2025-01-25 12:00:00.000"),
        (0x705, "00", FrameKind.BOOT_UP, 5, "boot-up: enters pre-operational"),
        (0x705, "05", FrameKind.HEARTBEAT, 5, "operational"),
        (0x77F, "7F", FrameKind.HEARTBEAT, 127, "pre-operational"),
        (0x7E5, "04 01 00 00 00 00 00 00", FrameKind.LSS, None, "all to configuration state"),
        (0x7E5, "11 05 00 00 00 00 00 00", FrameKind.LSS, None, "set node ID 5"),
        (0x7E4, "11 00 00 00 00 00 00 00", FrameKind.LSS, None, "set node ID: done"),
        (0x7E5, "13 00 02 00 00 00 00 00", FrameKind.LSS, None, "set bit rate: 500 kbit/s"),
        (
            0x7E4,
            "13 01 00 00 00 00 00 00",
            FrameKind.LSS,
            None,
            "set bit rate: refused: the slave does not support this bit rate",
        ),
        (
            0x7E4,
            "11 01 00 00 00 00 00 00",
            FrameKind.LSS,
            None,
            "set node ID: refused: the node-ID is out of range",
        ),
        (
            0x7E4,
            "17 02 00 00 00 00 00 00",
            FrameKind.LSS,
            None,
            "store the configuration: refused: the slave could not write to its memory",
        ),
        (
            0x7E4,
            "17 FF 07 00 00 00 00 00",
            FrameKind.LSS,
            None,
            "store the configuration: refused: manufacturer-specific error 7 (0x07)",
        ),
        (
            0x7E4,
            "11 05 00 00 00 00 00 00",
            FrameKind.LSS,
            None,
            "set node ID: refused: error 5, which CiA 305 reserves",
        ),
        (0x7E5, "11 FF 00 00 00 00 00 00", FrameKind.LSS, None, "take the node ID away"),
        (0x7E5, "13 00 09 00 00 00 00 00", FrameKind.LSS, None, "set bit rate: determined by the receiver"),
        (0x7E5, "13 00 05 00 00 00 00 00", FrameKind.LSS, None, "set bit rate: entry 5"),
        (
            0x7E5,
            "13 80 07 00 00 00 00 00",
            FrameKind.LSS,
            None,
            "set bit rate: entry 7 of the manufacturer's table 128",
        ),
        (0x7E5, "15 E8 03 00 00 00 00 00", FrameKind.LSS, None, "activate the bit rate after 1000 ms"),
        (0x7E5, "43 04 03 02 01 00 00 00", FrameKind.LSS, None, "select by serial number 0x01020304"),
        (0x7E4, "44 00 00 00 00 00 00 00", FrameKind.LSS, None, "selected"),
        (
            0x7E5,
            "48 01 00 00 00 00 00 00",
            FrameKind.LSS,
            None,
            "identify by lowest revision number 0x00000001",
        ),
        (
            0x7E5,
            "4B 02 00 00 00 00 00 00",
            FrameKind.LSS,
            None,
            "identify by highest serial number 0x00000002",
        ),
        (0x7E4, "5E 05 00 00 00 00 00 00", FrameKind.LSS, None, "its node ID is 5"),
        (0x7E4, "5E FF 00 00 00 00 00 00", FrameKind.LSS, None, "it has no node ID"),
        (0x7E5, "5A 00 00 00 00 00 00 00", FrameKind.LSS, None, "what is your vendor-ID?"),
        (0x7E4, "5A 00 0B 0C 00 00 00 00", FrameKind.LSS, None, "its vendor-ID 0x000C0B00"),
        (0x7E5, "51 00 00 00 00 80 00 00", FrameKind.LSS, None, "fast scan: is a slave unconfigured?"),
        (
            0x7E5,
            "51 00 0B 0C 00 1F 00 00",
            FrameKind.LSS,
            None,
            "fast scan: vendor-ID 0x000C0B00 from bit 31 on",
        ),
        (0x7E4, "4F 00 00 00 00 00 00 00", FrameKind.LSS, None, "identified: it is there"),
    ],
)
def test_a_sound_frame_in_words(can_id, data, kind, node, words):
    wire = Wire()
    one = wire(can_id, data)
    assert (one.kind, one.node, one.what) == (kind, node, words)
    assert not one.trouble


def test_an_emergency_names_code_register_and_the_makers_bytes():
    wire = Wire()
    one = wire(0x085, "11 86 21 01 02 00 00 00")
    assert (one.kind, one.node, one.error, one.problem) == (FrameKind.EMCY, 5, True, "")
    assert "0x8611, Following error" in one.what
    assert "error register 0x21 (generic error, device profile)" in one.what
    assert "manufacturer-specific data 01 02 00 00 00" in one.what


def test_an_emergency_without_an_error_code_is_no_trouble():
    one = Wire()(0x085, "00 00 00 00 00 00 00 00")
    assert not one.trouble


def test_a_short_emergency_is_read_and_the_length_named():
    one = Wire()(0x085, "10 43")
    assert "0x4310" in one.what
    assert "2 bytes" in one.problem


def test_a_heartbeat_shows_changes_of_the_state():
    wire = Wire()
    wire(0x705, "7F")
    assert wire.says(0x705, "05") == "operational (was pre-operational)"
    assert wire.says(0x705, "05") == "operational"


def test_node_guarding_is_distinguished_from_a_heartbeat_by_the_remote_frame_before():
    wire = Wire()
    asked = wire(0x705, remote=True)
    assert (asked.kind, asked.from_node) == (FrameKind.GUARD, False)
    first = wire(0x705, "85")
    assert (first.kind, first.what) == (FrameKind.GUARD, "operational")
    wire(0x705, remote=True)
    assert not wire(0x705, "05").problem
    wire(0x705, remote=True)
    assert "toggle bit did not change" in wire(0x705, "05").problem


def test_a_reset_begins_the_toggling_again():
    wire = Wire()
    wire(0x705, remote=True)
    wire(0x705, "05")
    wire(0x705, "00")
    wire(0x705, remote=True)
    assert not wire(0x705, "05").problem


@pytest.mark.parametrize(
    ("can_id", "data", "words"),
    [
        (0x000, "01", "an NMT command has 2 bytes"),
        (0x000, "07 05", "7 is not an NMT command"),
        (0x000, "01 C8", "200 is not a node ID"),
        (0x080, "01 02", "SYNC has no data or a counter"),
        (0x100, "00 00", "TIME has 6 bytes"),
        (0x705, "05 00", "a heartbeat has 1 byte"),
        (0x705, "33", "51 is not an NMT state"),
        (0x605, "40 41 60", "an SDO frame has 8 bytes"),
        (0x605, "E0 00 00 00 00 00 00 00", "0xE0 is not an SDO command"),
        (0x7E5, "04", "an LSS frame has 8"),
        (0x7E5, "FF 00 00 00 00 00 00 00", "0xFF is not an LSS command"),
    ],
)
def test_protocol_violations_are_reported_with_the_clause(can_id, data, words):
    one = Wire()(can_id, data)
    assert words in one.problem
    assert one.trouble


@pytest.mark.parametrize("can_id", [0x001, 0x071, 0x101, 0x17F, 0x580, 0x600, 0x680, 0x700, 0x7E3, 0x7FF])
def test_an_identifier_outside_the_connection_set_is_a_value(can_id):
    one = Wire()(can_id, "AB CD")
    assert (one.kind, one.what, one.trouble) == (FrameKind.UNKNOWN, "AB CD", False)


def test_a_long_identifier_is_no_pdo_of_the_short_one():
    one = Wire()(0x181, "01", extended=True)
    assert one.kind is FrameKind.UNKNOWN
    assert "00000181h" in line(one)


def test_an_error_frame_is_trouble():
    one = Wire()(0x04, "00 08 00 00 00 00 00 00", error=True)
    assert (one.kind, one.error) == (FrameKind.ERROR_FRAME, True)
    assert "transmit errors (warning)" in one.what


def test_the_column_of_the_node_names_node_axis_and_direction():
    wire = Wire(TraceContext({5: KnownNode(5, "x")}, master_id=127))
    assert who(wire(0x705, "05")) == "5 x"
    assert who(wire(0x605, "40 41 60 00 00 00 00 00")) == "> 5 x"
    assert who(wire(0x77F, "05")) == "127 master"
    assert who(wire(0x080)) == "bus"
    assert wire.says(0x000, "01 05") == "start: node 5 (x)"


def test_a_line_has_time_and_delta():
    wire = Wire()
    wire(0x080)
    assert line(wire(0x080), 0.0).split()[:3] == ["0.002000", "+0.001000", "080h"]
