"""PDOs as text: by the cell's plan, by the EDS, by the traffic itself; and unreadable ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.core.files import load_dictionaries
from axisbus.eds import builtin, load
from axisbus.trace import context
from axisbus.trace.decoded import FrameKind
from axisbus.trace.frame_formats import what
from kit.typed_frames import Wire

CELL = Path(__file__).parents[2] / "examples" / "cell.toml"


@pytest.fixture(scope="module")
def cell() -> context.TraceContext:
    loaded = reader.load(CELL)
    return context.of_cell(loaded, load_dictionaries(loaded))


def test_by_the_cells_plan_with_words_and_units(cell):
    """TPDO1 by the plan: 6041h, 6061h, 6064h. 32768 increments are 90 degrees (131072 for 360)."""
    one = Wire(cell)(0x181, "37 16 01 00 80 00 00")
    assert (one.kind, one.node, one.name, one.problem) == (FrameKind.TPDO, 1, "x", "")
    assert [(value.index, value.value) for value in one.values] == [
        (0x6041, 0x1637),
        (0x6061, 1),
        (0x6064, 32768),
    ]
    assert (
        one.values[0].words
        == "operation enabled; voltage enabled, remote, target reached, set-point acknowledge"
    )
    assert (one.values[2].quantity, one.values[2].unit) == (90.0, "deg")


def test_the_statusword_is_decoded_in_the_mode_of_the_same_frame(cell):
    wire = Wire(cell)
    assert "homing attained" in wire(0x181, "37 16 06 00 00 00 00").values[0].words
    assert "follows the command" in wire(0x181, "37 12 08 00 00 00 00").values[0].words


def test_the_controlword_is_read_in_the_mode_of_the_axis(cell):
    wire = Wire(cell)
    wire(0x181, "37 02 01 00 00 00 00")
    assert (
        wire(0x201, "3F 00 01 00 00 00 00").values[0].words
        == "enable operation, new set-point, change set immediately"
    )


def test_before_the_displayed_mode_is_seen_the_last_command_of_a_mode_counts(cell):
    wire = Wire(cell)
    assert "new set-point" in wire(0x201, "1F 00 01 00 00 00 00").values[0].words
    assert "homing start" in wire(0x201, "1F 00 06 00 00 00 00").values[0].words
    wire(0x181, "37 02 06 00 00 00 00")  # 6061h is still homing
    assert "homing start" in wire(0x201, "1F 00 01 00 00 00 00").values[0].words


def test_a_statusword_in_fault_is_trouble(cell):
    one = Wire(cell)(0x181, "18 02 00 00 00 00 00")
    assert one.error
    assert one.values[0].words.startswith("fault;")


def test_a_pdo_that_is_too_short_is_not_read(cell):
    one = Wire(cell)(0x181, "37 16 01")
    assert (one.problem, one.values) == ("3 bytes where 7 are mapped", ())


def test_a_tpdo_that_is_longer_than_its_map_is_named_and_an_rpdo_is_not(cell):
    wire = Wire(cell)
    assert wire(0x181, "37 16 01 00 80 00 00 00").problem == "8 bytes where 7 are mapped"
    assert wire(0x201, "0F 00 01 00 80 00 00 00").problem == ""


def test_by_the_eds_alone():
    eds = load(builtin.resolve("builtin:generic-cia402", Path()))
    one = Wire(context.of_eds({5: eds}))(0x185, "37 06 01 00 00 00 00")
    assert one.values[0].index == 0x6041
    assert one.values[0].words.startswith("operation enabled")


def test_without_any_file_a_pdo_is_named_by_the_connection_set():
    one = Wire()(0x285, "01 02")
    assert (one.kind, one.node, one.what) == (FrameKind.TPDO, 5, "TPDO2, mapping not known: 01 02")
    assert not one.trouble


def _write(wire: Wire, index: int, subindex: int, value: int, size: int) -> None:
    multiplexer = f"{index & 0xFF:02X} {index >> 8:02X} {subindex:02X}"
    command = {1: "2F", 2: "2B", 4: "23"}[size]
    assert not wire(0x605, f"{command} {multiplexer} {value.to_bytes(4, 'little').hex()}").problem
    assert not wire(0x585, f"60 {multiplexer} 00000000").problem


def test_a_mapping_is_learned_from_the_transfers_that_set_it():
    """RPDO3 of node 5 moved to 345h: 6040h, one byte left free, and the low three bytes of 607Ah."""
    wire = Wire()
    _write(wire, 0x1402, 1, 0x80000345, 4)
    _write(wire, 0x1602, 0, 0, 1)
    _write(wire, 0x1602, 1, 0x60400010, 4)
    _write(wire, 0x1602, 2, 0x00050008, 4)
    _write(wire, 0x1602, 3, 0x607A0018, 4)
    _write(wire, 0x1602, 0, 3, 1)
    assert wire(0x345, "0F 00 EE FF FF FF").kind is FrameKind.RPDO  # still off: named by the connection set
    _write(wire, 0x1402, 1, 0x345, 4)
    one = wire(0x345, "0F 00 EE FE FF FF")
    assert (one.node, one.from_node, one.problem) == (5, False, "")
    assert [(value.index, value.value) for value in one.values] == [(0x6040, 15), (0x607A, -2)]


def test_a_refused_write_teaches_nothing():
    wire = Wire()
    for index, sub, value in ((0x1800, 1, 0x185), (0x1A00, 1, 0x60410010), (0x1A00, 0, 1)):
        _write(wire, index, sub, value, 4 if sub else 1)
    wire(0x605, "23 00 1A 01 20 00 64 60")
    wire(0x585, "80 00 1A 01 00 00 01 06")
    assert what(wire(0x185, "50 02")).startswith("TPDO1: Statusword 0x0250")


def test_two_receivers_of_one_pdo_are_both_named():
    """Node 6 takes the TPDO1 of node 5 as its RPDO2."""
    wire = Wire()
    _write(wire, 0x1800, 1, 0x185, 4)
    _write(wire, 0x1A00, 1, 0x60640020, 4)
    _write(wire, 0x1A00, 0, 1, 1)
    wire(0x606, "23 01 14 01 85 01 00 00")
    wire(0x586, "60 01 14 01 00 00 00 00")
    assert "taken by node 6 as RPDO2" in wire(0x185, "01 00 00 00").what


def test_a_multiplexed_pdo_names_its_object():
    """CiA 301 7.2.2.5.3: destination mode, to node 9, 6081h:00."""
    wire = Wire()
    _write(wire, 0x1800, 1, 0x1E5, 4)
    _write(wire, 0x1A00, 0, 255, 1)
    one = wire(0x1E5, "89 81 60 00 E8 03 00 00")
    assert "multiplexed, for node 9" in one.what
    assert (one.values[0].index, one.values[0].value) == (0x6081, 1000)


def test_the_sync_identifier_is_learned():
    wire = Wire()
    _write(wire, 0x1005, 0, 0x81, 4)
    assert wire(0x081).kind is FrameKind.SYNC
