"""Lists of endpoints: read whole or refused, used only if they are shown to fit; and their frames over CAN."""

from __future__ import annotations

import json
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.can_simple import endpoint_messages as wire
from axisbus.drives.gim6010.can_simple.codec import Unexpected
from axisbus.drives.gim6010.can_simple.endpoints import (
    FORMATS,
    TABLE,
    Endpoint,
    Firmware,
    FittedList,
    parse,
    proposed_version,
    protected,
)
from axisbus.errors import ArgumentError, LimitError

V13 = Firmware(0, 5, 13)


def leaf(name, number, kind="float", access="rw"):
    return {"name": name, "id": number, "type": kind, "access": access}


def group(name, *members):
    return {"name": name, "type": "object", "members": list(members)}


LIST = [
    {"name": "", "id": 0, "type": "json", "access": "r"},
    leaf("vbus_voltage", 2, access="r"),
    leaf("serial_number", 5, "uint64", "r"),
    *(
        leaf(f"fw_version_{part}", number, "uint8", "r")
        for part, number in (("major", 9), ("minor", 10), ("revision", 11))
    ),
    group("can", group("config", leaf("protocol", 70, "uint8"), leaf("break_timeout", 73, "uint16"))),
    group(
        "axis0",
        group("motor", group("config", leaf("current_lim", 245), leaf("pre_calibrated", 240, "bool"))),
        leaf("enabled", 246, "bool"),
        leaf("offset", 247, "int32"),
        {
            "name": "move_to",
            "id": 300,
            "type": "function",
            "inputs": [{"name": "position", "id": 301, "type": "float"}],
            "outputs": [{"name": "ok", "id": 302, "type": "bool"}],
        },
    ),
    {"name": "save_configuration", "id": 478, "type": "function", "inputs": [], "outputs": []},
    {"name": "erase_configuration", "id": 480, "type": "function"},
    {"name": "tell", "id": 481, "type": "function"},
]
LISTED = parse(json.dumps(LIST), "endpoints_0.5.13.json")
FITTED = FittedList(LISTED, V13, V13)


def test_a_list_is_read_whole():
    assert LISTED.endpoints["axis0.motor.config.current_lim"] == Endpoint(
        "axis0.motor.config.current_lim", 245, "float", "rw"
    )
    assert [each.path for each in LISTED.under("can")] == ["can.config.protocol", "can.config.break_timeout"]
    assert sorted(LISTED.functions) == ["axis0.move_to", "erase_configuration", "save_configuration", "tell"]
    move = LISTED.functions["axis0.move_to"]
    assert (move.id, move.inputs[0].path, move.outputs[0].id) == (300, "axis0.move_to.position", 302)


@pytest.mark.parametrize(
    ("document", "text"),
    [
        ("{", "is not JSON"),
        ("[" * 100000, "is not JSON|nested too deeply|without a name"),
        ("{}", "the list is not a list of members"),
        ("[1]", "without a name"),
        ('[{"id": 1, "type": "float"}]', "without a name"),
        (json.dumps([leaf("a", 1, "double")]), "a has the type 'double'"),
        (json.dumps([leaf("a", 1, ["float"])]), "a has the type"),
        (json.dumps([leaf("a", 1, access="x")]), "a has the access 'x'"),
        (json.dumps([leaf("a", 65536)]), "a has the id 65536"),
        (json.dumps([leaf("a", True)]), "a has the id True"),
        (json.dumps([leaf("a", 1), leaf("b", 1)]), "b has the id 1, as a has"),
        (json.dumps([leaf("a", 1), leaf("a", 2)]), "a is in it twice"),
        (json.dumps([group("a", group("b", leaf("c", "1")))]), "a.b.c has the id '1'"),
        (json.dumps([{"name": "a", "type": "object"}]), "a is not a list of members"),
        (
            json.dumps([{"name": "f", "id": 1, "type": "function", "inputs": {}}]),
            "f has inputs that are no list",
        ),
    ],
)
def test_an_invalid_list_is_refused_with_the_location(document, text):
    with pytest.raises(ArgumentError, match=text) as refused:
        parse(document, "list.json")
    assert str(refused.value).startswith("list.json: ")


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.text(max_size=3)
    | st.sampled_from(["object", "function", "float", "rw"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["name", "id", "type", "members", "inputs", "access"]), inner, max_size=6
        )
    ),
    max_leaves=12,
)


@given(json_values | st.binary(max_size=20))
def test_a_bad_list_raises_only_an_argument_error(document):
    text = document if isinstance(document, bytes) else json.dumps(document)
    try:
        found = parse(text, "x")
    except ArgumentError:
        return
    assert all(each.type in FORMATS for each in found.endpoints.values())


# -- whether it fits ------------------------------------------------------------------------------------------------------------


def test_a_list_of_another_firmware_is_refused():
    with pytest.raises(ArgumentError, match=r"made for firmware 0\.5\.13, and the module has 0\.6\.0"):
        FittedList(LISTED, V13, Firmware(0, 6, 0))


@pytest.mark.parametrize("number", [9, None])
def test_a_list_that_has_the_version_elsewhere_is_refused(number):
    members = [
        each for each in LIST if each["name"] != "fw_version_minor" and each["name"] != "fw_version_major"
    ]
    moved = [*members, leaf("fw_version_major", 9), *([leaf("fw_version_minor", 12)] if number else [])]
    with pytest.raises(
        ArgumentError, match=r"it has (no fw_version_minor|fw_version_minor at 12), but every known list"
    ):
        FittedList(parse(json.dumps(moved), "x"), V13, V13)


@pytest.mark.parametrize(
    ("text", "version"), [("0.5.13", (0, 5, 13)), ("v0.6.0", (0, 6, 0)), ("0.5", None), ("0.5.x", None)]
)
def test_versions(text, version):
    if version is None:
        with pytest.raises(ArgumentError, match="is not a firmware version"):
            Firmware.parse(text)
    else:
        assert Firmware.parse(text) == version


@pytest.mark.parametrize(
    ("name", "version"),
    [("endpoints_0.6.0_MW.json", (0, 6, 0)), ("list.json", None), ("v1.2.3.4.json", None), ("0.5.13", V13)],
)
def test_a_file_s_name_proposes_a_version(name, version):
    assert proposed_version(name) == version


# -- frames -----------------------------------------------------------------------------------------------------------------------


def test_reading_and_writing():
    assert wire.read(5, FITTED, "odrv0.vbus_voltage") == wire.Outgoing(
        0x0A4, bytes.fromhex("00 02 00 00 00 00 00 00")
    )
    assert wire.write(5, FITTED, "axis0.offset", -2).data.hex(" ") == "01 f7 00 00 fe ff ff ff"
    assert wire.write(5, FITTED, "axis0.enabled", True).data.hex(" ") == "01 f6 00 00 01 00 00 00"
    assert (
        wire.write(5, FITTED, "axis0.motor.config.current_lim", 30).data.hex(" ") == "01 f5 00 00 00 00 f0 41"
    )
    assert [each.data[1] for each in wire.request_version(0)] == [9, 10, 11]


@pytest.mark.parametrize("can_id", [0x0A4, 0x0A5])
def test_an_answer_is_accepted_on_either_identifier(can_id):
    found = wire.answer(can_id, bytes.fromhex("00 02 00 00 00 00 C0 41"))
    assert found == wire.EndpointAnswer(5, 2, False, bytes.fromhex("00 00 C0 41"))
    assert wire.value(LISTED.endpoints["vbus_voltage"], found.data) == 24.0


@pytest.mark.parametrize(
    ("can_id", "data"), [(0x0A4, "00 02 00"), (0x0A4, "09" + " 00" * 7), (0x0A9, "00" * 8), (0x0B5, "00" * 8)]
)
def test_an_invalid_answer_is_refused(can_id, data):
    assert isinstance(wire.answer(can_id, bytes.fromhex(data)), Unexpected)


@pytest.mark.parametrize(
    ("act", "text"),
    [
        (lambda: wire.read(1, FITTED, "axis0.motor.config.curent_lim"), "no parameter"),
        (lambda: wire.read(1, FITTED, "serial_number"), "does not fit into 32 bits"),
        (lambda: wire.write(1, FITTED, "vbus_voltage", 1.0), "cannot be written"),
        (lambda: wire.write(1, FITTED, "axis0.offset", 1.0), "not a value of type int32"),
        (lambda: wire.write(1, FITTED, "axis0.offset", 1 << 31), "beyond the range of int32"),
        (lambda: wire.write(1, FITTED, "axis0.enabled", 1), "not a value of type bool"),
        (
            lambda: wire.write(1, FITTED, "axis0.motor.config.current_lim", math.nan),
            "not a value of type float",
        ),
        (lambda: wire.write(1, FITTED, "axis0.motor.config.current_lim", 1e300), "beyond"),
        (lambda: wire.write(1, FITTED, "axis0.motor.config.pre_calibrated", True), "is protected"),
        (lambda: wire.write(1, FITTED, "can.config.protocol", 2), "is protected"),
        (lambda: wire.read(1, FITTED, "tell"), "no parameter"),
    ],
)
def test_invalid_requests_are_refused(act, text):
    with pytest.raises(ArgumentError, match=text):
        act()


def test_a_protected_parameter_is_written_if_it_is_named():
    assert (
        wire.write(1, FITTED, "can.config.protocol", 2, by_name=True).data.hex(" ")
        == "01 46 00 00 02 00 00 00"
    )
    assert protected("axis0.encoder.config.phase_offset_float").kind == "calibration"
    assert protected("axis0.controller.config.vel_limit") is None
    assert {each.kind for each in TABLE} == {"calibration", "unit", "link", "act"}


SHORT = [name for name, letter in FORMATS.items() if letter and struct.calcsize(f"<{letter}") <= 4]


@given(st.sampled_from(SHORT), st.binary(min_size=4, max_size=4))
def test_a_value_of_every_type_is_restored_from_its_bytes(kind, data):
    endpoint = Endpoint("x", 1, kind, "rw")
    value = wire.value(endpoint, data)
    if isinstance(value, float) and not math.isfinite(value):
        with pytest.raises(ArgumentError):
            wire.value_bytes(endpoint, value)
    else:
        assert wire.value(endpoint, wire.value_bytes(endpoint, value)) == value


def test_a_value_beyond_its_type_is_a_limit_error():
    with pytest.raises(LimitError):
        wire.value_bytes(Endpoint("x", 1, "uint8", "rw"), 256)
