"""Meanings of values as tables and of one value: the same table tells both."""

import pytest

from axisbus.cia402 import meanings, objects, options
from axisbus.cia402.modes import ModeOfOperation


def rows(index, subindex, key):
    return [dict(table.rows) for table in meanings.tables(index, subindex) if table.key == key]


@pytest.mark.parametrize("option", options.ALL, ids=lambda option: option.key)
def test_an_option_is_told_as_its_table_has_it(option):
    (table,) = rows(option.index, option.subindex, "value")
    assert table
    assert {value: meanings.words(option.index, option.subindex, int(value)) for value in table} == table
    assert meanings.words(option.index, option.subindex, -1) == "specific to the maker"
    assert meanings.words(option.index, option.subindex, 200) == "reserved"


@pytest.mark.parametrize(
    ("address", "value", "text"),
    [
        ((0x1001, 0), 0, "no error"),
        ((0x1005, 0), 0x4000_0080, "080h"),
        ((0x1016, 2), 0x0007_01F4, "node 7 within 500 ms"),
        ((0x1010, 3), 0x6576_6173, 'store ("save")'),
        ((0x1011, 1), 0x6461_6F6C, 'restore defaults ("load")'),
        ((0x1801, 1), 0xC000_0285, "285h, switched off"),
        ((0x1801, 2), 0, "synchronous, acyclic"),
        ((0x1801, 2), 1, "with every SYNC"),
        ((0x1801, 2), 4, "with every 4th SYNC"),
        ((0x1801, 2), 240, "with every 240th SYNC"),
        ((0x1801, 2), 241, "reserved"),
        ((0x1801, 2), 251, "reserved"),
        ((0x1801, 2), 252, "on remote request"),
        ((0x1801, 2), 253, "on remote request"),
        ((0x1801, 2), 254, "event-driven"),
        ((0x1801, 2), 255, "event-driven"),
        ((0x6861, 0), 8, "csp, cyclic sync position"),
        ((0x6060, 0), 0, "no mode"),
        ((0x6098, 0), 17, "negative limit switch"),
        ((0x60FD, 0), 0b1010, "positive limit switch, interlock"),
        ((0x1016, 0), 2, ""),
        ((0x1A00, 1), 0x6041_0010, ""),
        ((0x607E, 0), 0xC0, ""),
        ((0x2000, 0), 1, ""),
    ],
)
def test_one_value_in_words(address, value, text):
    assert meanings.words(*address, value) == text


@pytest.mark.parametrize(
    ("address", "bits"),
    [
        ((0x1400, 1), ["0-10", "29", "30", "31"]),
        ((0x1016, 1), ["0-15", "16-22"]),
        ((0x6040, 0), [str(bit) for bit in range(16)]),
        ((0x6041, 0), [str(bit) for bit in range(16)]),
        ((0x607E, 0), ["6", "7"]),
        ((0x60FD, 0), ["0", "1", "2", "3", "4-15", "16-31"]),
    ],
)
def test_the_bits_of_an_object_are_told_each_once_in_their_order(address, bits):
    (table,) = [table for table in meanings.tables(*address) if table.key == "bit"]
    assert [bit for bit, _ in table.rows] == bits


def test_which_bit_of_the_polarity_turns_what():
    (bits,) = rows(0x607E, 0, "bit")
    assert (bits["6"], bits["7"]) == ("velocity: 1 multiplies by -1", "position: 1 multiplies by -1")


def test_bits_12_and_13_are_read_in_their_mode():
    word = 0x1637
    assert meanings.words(objects.STATUSWORD, 0, word).endswith("bit 12")
    homing = meanings.words(objects.STATUSWORD + 0x800, 0, word, ModeOfOperation.HOMING)
    assert homing == "operation enabled; voltage enabled, remote, target reached, homing attained"


def test_a_table_for_all_elements_is_shown_with_the_first():
    (bits,) = rows(0x1016, 1, "bit")
    assert bits["16-22"] == "node ID that is watched"
    assert meanings.tables(0x1016, 2) == ()
    assert meanings.tables(0x1016, 0) == ()


def test_the_tables_of_an_object_are_those_of_every_axis():
    assert meanings.tables(0x7041, 0) == meanings.tables(0x6041, 0)
    assert [table.title for table in meanings.tables(0x6041, 0)] == ["States", "Bits"]
    assert meanings.tables(0x1600, 1) == ()
    assert meanings.tables(0x1601, 0) == ()
