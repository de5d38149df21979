"""Meanings of values as tables, and of single values, from the same table."""

import pytest

from axisbus.cia402 import objects, options, value_texts
from axisbus.cia402.modes import ModeOfOperation


def rows(index, subindex, key):
    return [dict(table.rows) for table in value_texts.tables(index, subindex) if table.key == key]


@pytest.mark.parametrize("option", options.ALL, ids=lambda option: option.key)
def test_an_option_is_reported_as_its_table_has_it(option):
    (table,) = rows(option.index, option.subindex, "value")
    assert table
    assert {value: value_texts.words(option.index, option.subindex, int(value)) for value in table} == table
    assert value_texts.words(option.index, option.subindex, -1) == "manufacturer-specific"
    assert value_texts.words(option.index, option.subindex, 200) == "reserved"


@pytest.mark.parametrize(
    ("address", "value", "text"),
    [
        ((0x1001, 0), 0, "no error"),
        ((0x1001, 0), 0x11, "generic error, communication"),
        ((0x1003, 1), 0x0100_8611, "Following error"),  # the upper word is the maker's
        ((0x1003, 2), 0xFFFF_0000, "no error"),
        ((0x1005, 0), 0x4000_0080, "080h"),
        ((0x100C, 0), 1, "1 ms"),
        ((0x100C, 0), 0, "off"),
        ((0x1014, 0), 0xC000_0085, "085h, switched off"),
        ((0x1014, 0), 0x2123_4567, "1234567h"),
        ((0x1014, 0), 0x0123_4567, "567h"),  # without bit 29 the identifier has 11 bits
        ((0x1016, 2), 0x0007_01F4, "node 7 within 500 ms"),
        ((0x1016, 2), 0x007F_FFFF, "node 127 within 65535 ms"),
        ((0x1016, 2), 0x0001_0001, "node 1 within 1 ms"),
        ((0x1016, 2), 0x0000_01F4, "off"),
        ((0x1016, 2), 0x0085_01F4, "off"),  # 133 is no node-ID
        ((0x1016, 2), 0x0007_0000, "off"),
        ((0x1017, 0), 100, "100 ms"),
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
        ((0x603F, 0), 0x0000, "no error"),
        ((0x603F, 0), 0x0001, "Error reset or no error (class of this code)"),
        ((0x603F, 0), 0x2311, "Continuous over-current no. 1"),
        ((0x6502, 0), 0b0000_0010_1010_0001, "pp, hm, csp, cst"),
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
    assert value_texts.words(*address, value) == text


@pytest.mark.parametrize(
    ("address", "bits"),
    [
        ((0x1400, 1), ["0-10", "29", "30", "31"]),
        ((0x1016, 1), ["0-15", "16-23"]),
        ((0x6040, 0), [str(bit) for bit in range(16)]),
        ((0x6041, 0), [str(bit) for bit in range(16)]),
        ((0x607E, 0), ["6", "7"]),
        ((0x60FD, 0), ["0", "1", "2", "3", "4-15", "16-31"]),
    ],
)
def test_the_bits_of_an_object_are_reported_each_once_in_their_order(address, bits):
    (table,) = [table for table in value_texts.tables(*address) if table.key == "bit"]
    assert [bit for bit, _ in table.rows] == bits


MAKER = "manufacturer-specific"


@pytest.mark.parametrize(
    ("address", "texts"),
    [
        (
            (0x1001, 0),
            {
                "0": "generic error",
                "1": "current",
                "2": "voltage",
                "3": "temperature",
                "4": "communication",
                "5": "device profile",
                "6": "reserved",
                "7": "manufacturer-specific",
            },
        ),
        (
            (0x6040, 0),
            {
                "0": "switch on",
                "1": "enable voltage",
                "2": "quick stop (0 = stop)",
                "3": "enable operation",
                "4": "specific to the mode: pp new set-point, hm homing start, ip enable interpolation",
                "5": "specific to the mode: pp change set immediately",
                "6": "specific to the mode: pp relative",
                "7": "fault reset (rising edge)",
                "8": "halt",
                "9": "specific to the mode: pp change on set-point",
                "10": "reserved",
                **dict.fromkeys(("11", "12", "13", "14", "15"), MAKER),
            },
        ),
        (
            (0x6041, 0),
            {
                "0": "ready to switch on",
                "1": "switched on",
                "2": "operation enabled",
                "3": "fault",
                "4": "voltage enabled",
                "5": "quick stop (0 = active)",
                "6": "switch on disabled",
                "7": "warning",
                "8": "manufacturer bit 8",
                "9": "remote",
                "10": "target reached",
                "11": "internal limit active",
                "12": "specific to the mode: pp set-point acknowledge, pv speed is zero, hm homing attained, "
                "ip interpolation active, csp csv cst follows the command",
                "13": "specific to the mode: pp csp csv following error, pv max slippage, hm homing error",
                **dict.fromkeys(("14", "15"), MAKER),
            },
        ),
        (
            (0x6502, 0),
            {
                "0": "profile position (pp)",
                "1": "velocity (vl)",
                "2": "profile velocity (pv)",
                "3": "profile torque (tq)",
                "5": "homing (hm)",
                "6": "interpolated position (ip)",
                "7": "cyclic sync position (csp)",
                "8": "cyclic sync velocity (csv)",
                "9": "cyclic sync torque (cst)",
                "10": "cyclic sync torque angle (cstca)",
            },
        ),
        (
            (0x60FD, 0),
            {
                "0": "negative limit switch",
                "1": "positive limit switch",
                "2": "home switch",
                "3": "interlock",
                "4-15": "reserved",
                "16-31": MAKER,
            },
        ),
    ],
    ids=lambda value: f"{value[0]:04X}h" if isinstance(value, tuple) else "",
)
def test_the_meaning_of_each_bit(address, texts):
    """Each table as a whole, beside CiA 301 7.5.2.2 and CiA 402-2 8.4.1 and 8.4.2."""
    assert rows(*address, "bit") == [texts]


def test_the_commands_and_the_states_are_reported_by_their_words():
    (commands,) = rows(0x6040, 0, "controlword")
    assert commands == {
        "0x0000": "disable voltage",
        "0x0002": "quick stop",
        "0x0006": "shutdown",
        "0x0007": "switch on",
        "0x000F": "enable operation",
        "0x0080": "fault reset",
    }
    (states,) = rows(0x6041, 0, "statusword")
    assert states == {
        "0x0000, mask 0x004F": "not ready to switch on",
        "0x0040, mask 0x004F": "switch on disabled",
        "0x0021, mask 0x006F": "ready to switch on",
        "0x0023, mask 0x006F": "switched on",
        "0x0027, mask 0x006F": "operation enabled",
        "0x0007, mask 0x006F": "quick stop active",
        "0x000F, mask 0x004F": "fault reaction active",
        "0x0008, mask 0x004F": "fault",
    }


@pytest.mark.parametrize("index", [0x6060, 0x6061])
def test_the_modes_are_reported_by_their_numbers(index):
    assert rows(index, 0, "value") == [
        {
            "0": "no mode",
            "1": "profile position (pp)",
            "2": "velocity (vl)",
            "3": "profile velocity (pv)",
            "4": "profile torque (tq)",
            "6": "homing (hm)",
            "7": "interpolated position (ip)",
            "8": "cyclic sync position (csp)",
            "9": "cyclic sync velocity (csv)",
            "10": "cyclic sync torque (cst)",
            "11": "cyclic sync torque angle (cstca)",
        }
    ]


def test_homing_methods_that_look_for_the_same_share_a_row():
    (methods,) = rows(0x6098, 0, "value")
    assert list(methods) == [
        *("negative", "0", "1", "2", "3", "4", "5", "6", "7-10", "11-14", "17", "18", "19", "20", "21", "22"),
        *("23-26", "27-30", "33", "34", "35", "37"),
    ]
    assert methods["negative"] == MAKER
    assert methods["7-10"] == value_texts.words(0x6098, 0, 7) == value_texts.words(0x6098, 0, 10)
    assert methods["37"] == value_texts.words(0x6098, 0, 37)


def test_the_save_and_load_signatures_are_shown_as_numbers():
    assert rows(0x1010, 1, "value") == [{"0x65766173": 'stores: the letters "save"'}]
    assert rows(0x1011, 1, "value") == [{"0x64616F6C": 'restores: the letters "load"'}]
    assert value_texts.words(0x1010, 1, 0x6576_6174) == ""


def test_the_bits_of_the_polarity():
    (bits,) = rows(0x607E, 0, "bit")
    assert (bits["6"], bits["7"]) == ("velocity: 1 multiplies by -1", "position: 1 multiplies by -1")


def test_bits_12_and_13_are_read_in_their_mode():
    word = 0x1637
    assert value_texts.words(objects.STATUSWORD, 0, word).endswith("bit 12")
    homing = value_texts.words(objects.STATUSWORD + 0x800, 0, word, ModeOfOperation.HOMING)
    assert homing == "operation enabled; voltage enabled, remote, target reached, homing attained"


def test_a_table_for_all_elements_is_shown_with_the_first():
    (bits,) = rows(0x1016, 1, "bit")
    assert bits["16-23"] == "node ID that is watched"
    assert value_texts.tables(0x1016, 2) == ()
    assert value_texts.tables(0x1016, 0) == ()


def test_the_tables_of_an_object_are_those_of_every_axis():
    assert value_texts.tables(0x7041, 0) == value_texts.tables(0x6041, 0)
    assert [table.title for table in value_texts.tables(0x6041, 0)] == ["States", "Bits"]
    assert value_texts.tables(0x1600, 1) == ()
    assert value_texts.tables(0x1601, 0) == ()
