"""The profile's tables against tables typed off a second time: objects, words, modes, option codes, homing methods, orders."""

import csv
from pathlib import Path

import pytest

from axisbus.cia402 import controlword, homing, modes, objects, options, port, statusword
from axisbus.cia402.axes import axis_of, first_axis, indices_of, own_index
from axisbus.cia402.controlword import PowerCommand, words
from axisbus.cia402.device_type import device_kind
from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.cia402.objects import order
from axisbus.cia402.state import ENERGISED, TARGETS, TRANSITIONS, PowerState
from axisbus.cpu_starvation import DRIVES, Starvation

HERE = Path(__file__).parent


def table(name):
    with (HERE / name).open() as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def numbers(module):
    """Return the whole numbers that a module gives a name."""
    return {name: value for name, value in vars(module).items() if name.isupper() and type(value) is int}


def test_every_object_has_the_index_of_the_standard():
    assert {row["name"]: int(row["index"], 16) for row in table("objects.csv")} == numbers(objects)


def test_the_bits_of_the_statusword():
    assert numbers(statusword) == {
        "READY_TO_SWITCH_ON": 0x0001,
        "SWITCHED_ON": 0x0002,
        "OPERATION_ENABLED": 0x0004,
        "FAULT": 0x0008,
        "VOLTAGE_ENABLED": 0x0010,
        "QUICK_STOP": 0x0020,
        "SWITCH_ON_DISABLED": 0x0040,
        "WARNING": 0x0080,
        "MANUFACTURER_8": 0x0100,
        "REMOTE": 0x0200,
        "TARGET_REACHED": 0x0400,
        "INTERNAL_LIMIT": 0x0800,
        "BIT_12": 0x1000,
        "BIT_13": 0x2000,
        "SET_POINT_ACKNOWLEDGE": 0x1000,
        "FOLLOWING_ERROR": 0x2000,
        "SPEED_ZERO": 0x1000,
        "MAX_SLIPPAGE": 0x2000,
        "HOMING_ATTAINED": 0x1000,
        "HOMING_ERROR": 0x2000,
        "FOLLOWS_COMMAND": 0x1000,
    }


@pytest.mark.parametrize(
    ("bit", "name"),
    [
        (4, "voltage enabled"),
        (7, "warning"),
        (8, "manufacturer bit 8"),
        (9, "remote"),
        (10, "target reached"),
        (11, "internal limit active"),
        (12, "bit 12"),
        (13, "bit 13"),
    ],
)
def test_each_bit_of_the_statusword_has_its_name(bit, name):
    assert statusword.bit_words(1 << bit) == [name]


def test_the_bits_of_the_state_have_no_name_of_their_own():
    assert statusword.bit_words(0xC06F) == []


@pytest.mark.parametrize(
    ("word", "mode", "begins"),
    [
        (0x1210, None, []),
        (0x1200, None, ["bit 4 "]),
        (0x1010, None, ["bit 9 "]),
        (0x1A10, None, ["bit 11 "]),
        (0x1290, None, ["bit 7 "]),
        (0x0210, 1, []),
        (0x0210, 8, ["bit 12 "]),
        (0x0210, 9, ["bit 12 "]),
        (0x0210, 10, ["bit 12 "]),
        (0x0210, 6, []),
        (0x0210, 7, []),
        (0x0880, 8, ["bit 4 ", "bit 9 ", "bit 11 ", "bit 7 ", "bit 12 "]),
    ],
)
def test_each_hint_of_a_statusword_begins_as_in_the_table(word, mode, begins):
    hints = statusword.hints(word, mode)
    assert len(hints) == len(begins)
    assert all(hint.startswith(begin) for hint, begin in zip(hints, begins, strict=True))


def test_the_bits_of_the_controlword():
    assert numbers(controlword) == {
        "SWITCH_ON": 0x0001,
        "ENABLE_VOLTAGE": 0x0002,
        "QUICK_STOP": 0x0004,
        "ENABLE_OPERATION": 0x0008,
        "FAULT_RESET": 0x0080,
        "HALT": 0x0100,
        "NEW_SET_POINT": 0x0010,
        "CHANGE_SET_IMMEDIATELY": 0x0020,
        "RELATIVE": 0x0040,
        "CHANGE_ON_SET_POINT": 0x0200,
        "HOMING_START": 0x0010,
        "ENABLE_INTERPOLATION": 0x0010,
        "MODE_BITS": 0x0270,
    }


def test_the_commands_of_the_power_stage():
    assert {command.name: command.word for command in PowerCommand} == {
        "SHUTDOWN": 0x06,
        "SWITCH_ON": 0x07,
        "ENABLE_OPERATION": 0x0F,
        "DISABLE_VOLTAGE": 0x00,
        "QUICK_STOP": 0x02,
        "FAULT_RESET": 0x80,
    }


@pytest.mark.parametrize(
    ("word", "text"),
    [  # each bit that a command ignores is set as well (CiA 402-2 table 27)
        (0x8D, "fault reset"),
        (0x0D, "disable voltage"),
        (0x01, "disable voltage"),
        (0x0B, "quick stop"),
        (0x03, "quick stop"),
        (0x0E, "shutdown"),
        (0x06, "shutdown"),
        (0x0F, "enable operation"),
        (0x07, "switch on / disable operation"),
    ],
)
def test_ignored_bits_do_not_change_the_name_of_a_command(word, text):
    assert words(word) == text


@pytest.mark.parametrize(
    ("mode", "texts"),
    [
        (None, {4: "bit 4", 5: "bit 5", 6: "bit 6", 9: "bit 9"}),
        (1, {4: "new set-point", 5: "change set immediately", 6: "relative", 9: "change on set-point"}),
        (2, {4: "enable ramp", 5: "unlock ramp", 6: "reference ramp", 9: "bit 9"}),
        (6, {4: "homing start", 5: "bit 5"}),
        (7, {4: "enable interpolation", 6: "bit 6"}),
        (8, {4: "bit 4"}),
    ],
)
def test_each_bit_of_the_controlword_in_its_mode(mode, texts):
    wanted = None if mode is None else ModeOfOperation(mode)
    for bit, text in texts.items():
        assert words(0x0F | 1 << bit, wanted) == f"enable operation, {text}"


@pytest.mark.parametrize("row", table("modes.csv"), ids=lambda row: row["short"])
def test_the_properties_of_each_mode(row):
    mode = ModeOfOperation(int(row["value"]))
    facts = FACTS[mode]
    assert (modes.short(mode), facts.supported_bit) == (row["short"], int(row["bit"]))
    assert facts.cyclic == (row["cyclic"] == "yes")
    assert sorted(facts.required) == sorted(int(index, 16) for index in row["objects"].split())
    assert modes.supported(1 << int(row["bit"])) == [mode]
    assert statusword.bit_words(0x3000, mode) == [row["bit 12"], row["bit 13"]]


def test_there_are_no_other_modes():
    assert sorted(int(row["value"]) for row in table("modes.csv")) == sorted(FACTS)
    assert sorted(mode.value for mode in ModeOfOperation) == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11]
    assert modes.supported(0) == []
    assert modes.supported(0xFFFFF810) == []  # reserved and the maker's


@pytest.mark.parametrize(
    ("value", "name", "text"),
    [(-3, "MAKER_3", "maker 3"), (42, "MODE_42", "mode 42"), (5, "MODE_5", "mode 5")],
)
def test_a_mode_that_is_not_in_the_standard_keeps_its_number(value, name, text):
    mode = ModeOfOperation(value)
    assert (mode, mode.value, mode.name, mode.text, modes.short(mode)) == (value, value, name, text, text)


def test_an_invalid_number_is_no_mode():
    with pytest.raises(ValueError, match="pp"):
        ModeOfOperation("pp")


@pytest.mark.parametrize("row", table("option_codes.csv"), ids=lambda row: f"{row['key']} {row['value']}")
def test_the_meaning_of_each_option_code(row):
    option, value = options.BY_KEY[row["key"]], int(row["value"])
    assert (option.index, option.subindex) == (int(row["index"], 16), int(row["subindex"]))
    assert option.words.get(row["word"], -1) == (value if row["word"] else -1)
    meaning = option.meaning(value)
    assert all(part in meaning for part in row["meaning"].split(" then "))
    assert ("power off" in row["meaning"]) == ("power off" in meaning)
    ramps = {"quick_stop": options.QUICK_STOP_RAMPS, "halt": options.HALT_RAMPS}.get(row["key"], {})
    assert not row["ramp"] or ramps[value].value == row["ramp"]
    if row["key"] == "quick_stop":
        assert (value in options.HOLDING_QUICK_STOPS) == ("stays energised" in meaning)


def test_there_are_no_other_option_codes():
    rows = table("option_codes.csv")
    for option in options.ALL:
        mine = [row for row in rows if row["key"] == option.key]
        assert sorted(option.meanings) == sorted(int(row["value"]) for row in mine)
        assert sorted(option.words) == sorted(row["word"] for row in mine if row["word"])
        assert "manufacturer-specific" in option.meaning(-1)
    assert sorted(options.HALT_RAMPS) == [0, 1, 2, 3, 4]
    assert sorted(options.QUICK_STOP_RAMPS) == [0, 1, 2, 3, 4, 5, 6, 7, 8]
    assert not {4, 9} & set(options.HOLDING_QUICK_STOPS)


@pytest.mark.parametrize("row", table("homing_methods.csv"), ids=lambda row: row["method"])
def test_the_description_of_each_homing_method(row):
    text = homing.describe(int(row["method"]))
    opposite = {"positive side": "negative side", "positive direction": "negative direction"}
    for wanted in [
        part
        for part in ("home switch", "limit switch", "index pulse", "reserved", "manufacturer-specific")
        if part in row["looks for"]
    ]:
        assert wanted in text
    assert ("index pulse" in text) == ("index pulse" in row["looks for"])
    for one, other in [*opposite.items(), *((b, a) for a, b in opposite.items())]:
        assert (one in text) == (one in row["looks for"]), other
    assert ("home" if "actual" in row["looks for"] else "") in text


def test_only_methods_35_and_37_home_in_place():
    assert [method for method in range(-128, 128) if method in homing.IN_PLACE] == [35, 37]


def test_the_transitions_of_the_figure():
    """The numbers and arrows of CiA 402-2's figure, typed off a second time."""
    ns, sod, rtso = (
        PowerState.NOT_READY_TO_SWITCH_ON,
        PowerState.SWITCH_ON_DISABLED,
        PowerState.READY_TO_SWITCH_ON,
    )
    so, oe, qs = PowerState.SWITCHED_ON, PowerState.OPERATION_ENABLED, PowerState.QUICK_STOP_ACTIVE
    assert [(t.number, t.source, t.target) for t in TRANSITIONS] == [
        *(
            (0, None, ns),
            (1, ns, sod),
            (2, sod, rtso),
            (3, rtso, so),
            (4, so, oe),
            (5, oe, so),
            (6, so, rtso),
        ),
        *((7, rtso, sod), (8, oe, rtso), (9, oe, sod), (10, so, sod), (11, oe, qs), (12, qs, sod)),
        *(
            (13, None, PowerState.FAULT_REACTION_ACTIVE),
            (14, PowerState.FAULT_REACTION_ACTIVE, PowerState.FAULT),
        ),
        *((15, PowerState.FAULT, sod), (16, qs, oe)),
    ]
    assert {oe, qs, PowerState.FAULT_REACTION_ACTIVE} == ENERGISED
    assert {sod, rtso, so, oe, qs} == TARGETS


def test_the_values_of_a_port_are_these_objects():
    assert {name: f"{index:04X}" for name, index in port.INPUT_OBJECTS.items()} == {
        "statusword": "6041",
        "mode": "6061",
        "position": "6064",
        "velocity": "606C",
        "torque": "6077",
        "demand": "6062",
    }
    assert {name: f"{index:04X}" for name, index in port.OUTPUT_OBJECTS.items()} == {
        "controlword": "6040",
        "mode": "6060",
        "target_position": "607A",
        "target_velocity": "60FF",
        "target_torque": "6071",
    }


def test_a_port_has_no_default_outputs():
    assert port.Outputs() == (None, None, None, None, None, (), (), False, None, None, None)
    assert port.Inputs(1.0, False, None, None, None, None, None, None).nmt == -1


MOVING = (0x6040, 0x6042, 0x6060, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60C1, 0x60FE, 0x60FF)


@pytest.mark.parametrize("axis", range(8))
def test_the_objects_that_command_an_axis_are_orders(axis):
    of_axis = range(0x6000 + axis * 0x800, 0x6800 + axis * 0x800)
    assert [index - axis * 0x800 for index in of_axis if order(index)] == list(MOVING)
    assert all("commands the drive" in order(index + axis * 0x800) for index in MOVING)


def test_objects_that_act_on_the_communication_at_once_are_commands():
    told = {index: order(index) for index in (*range(0x6000), *range(0xA000, 0x10000))}
    orders = [index for index, text in told.items() if text]
    assert orders == [
        *(0x1003, 0x1010, 0x1011, 0x1013, *range(0x1023, 0x1027)),
        *(*range(0x1F50, 0x1F60), 0x1F82, 0x1F83),
    ]
    for index, word in (
        (0x1003, "history"),
        (0x1010, "stores"),
        (0x1011, "restores"),
        (0x1013, "clock"),
        (0x1F51, "program"),
    ):
        assert word in told[index]
    assert "operating system" in told[0x1023]
    assert "other nodes" in told[0x1F82]


def test_an_object_of_any_axis_has_the_index_of_the_first_axis():
    assert [first_axis(index) for index in (0x5FFF, 0x6000, 0x67FF, 0x6800, 0x7040, 0x9FFF, 0xA000)] == [
        *(0x5FFF, 0x6000, 0x67FF, 0x6000, 0x6040, 0x67FF, 0xA000),
    ]


def test_an_object_of_the_first_axis_has_an_index_on_each():
    assert [own_index(0x6041, axis) for axis in (1, 2, 8)] == [0x6041, 0x6841, 0x9841]
    assert [own_index(index, 3) for index in (0x1001, 0x5FFF, 0x67FF, 0x6800)] == [
        0x1001,
        0x5FFF,
        0x77FF,
        0x6800,
    ]
    assert [axis_of(index) for index in (0x1001, 0x5FFF, 0x6000, 0x67FF, 0x6800, 0x9FFF, 0xA000)] == [
        *(1, 1, 1, 1, 2, 8, 1),
    ]
    assert [(indices_of(axis)[0], indices_of(axis)[-1]) for axis in (1, 2, 8)] == [
        *((0x6000, 0x67FF), (0x6800, 0x6FFF), (0x9800, 0x9FFF)),
    ]


def test_the_kind_of_drive_is_read_from_its_own_bits():
    assert device_kind(0x00020192) == "servo drive (CiA 402)"
    assert device_kind(0xFFFE0192) == "servo drive and stepper drive (CiA 402)"


def test_time_that_is_missing_is_added_up_within_the_last_two_seconds():
    lately = Starvation()
    for now, late in ((1.0, 0.25), (2.0, 0.5), (2.5, 0.0), (2.5, float("inf")), (2.5, -1.0)):
        lately.note(now, late)
    assert lately.missing(2.5) == 0.75
    assert lately.text(2.5) == "this program did not run for 0.75 s of the last 2 s"
    assert lately.missing(3.0) == 0.5  # the first one ended just at the window's beginning
    assert lately.missing(3.9) == pytest.approx(0.1)  # only the part within the window counts: 1.9 to 2.0
    assert lately.missing(3.95) == 0.0
    assert lately.text(3.95) == ""
    assert lately.missing(4.5) == 0.0


def test_the_most_starved_part_is_named_with_its_time():
    lately = Starvation()
    lately.note(1.0, 0.125)
    for at in (1.0, 1.25, 1.5):
        lately.note(at, 0.0625, DRIVES)
    assert lately.text(2.0) == "the simulated drives did not run for 0.19 s of the last 2 s"
    assert lately.missing(2.0) == 0.1875
    lately.note(2.0, 0.125)
    assert lately.text(2.0) == "this program did not run for 0.25 s of the last 2 s"
    little = Starvation()
    little.note(1.0, 0.03125, DRIVES)
    assert little.missing(1.0) == 0.0
    little.note(1.0, 0.01875, DRIVES)
    assert little.text(1.0) == "the simulated drives did not run for 0.05 s of the last 2 s"


def test_more_than_the_window_cannot_be_missing_and_little_is_not_worth_a_word():
    lately = Starvation()
    lately.note(10.0, 60.0)
    lately.note(10.0, 60.0)
    assert lately.missing(10.0) == 2.0
    little = Starvation()
    little.note(1.0, 0.0625)
    assert little.missing(1.0) == 0.0
    little.note(1.0, 0.0625)
    assert little.missing(1.0) == 0.125
    just = Starvation()
    just.note(1.0, 0.1)
    assert just.missing(1.0) == 0.1


def test_nodes_that_were_not_late_need_no_space():
    lately = Starvation()
    lately.note(1.0, 0.5)
    for _ in range(1000):
        lately.note(1.0, 0.0)
    assert lately.missing(1.0) == 0.5
    for _ in range(256):
        lately.note(1.0, 2**-10)
    assert lately.missing(1.0) == 0.25  # the last 256 entries are kept
