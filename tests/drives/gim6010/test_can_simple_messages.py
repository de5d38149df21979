"""CAN Simple's messages, byte for byte by the manual's examples (v2.2, 4.1.1 and 4.1.3), and over their whole range."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.can_simple import codec, error_query, messages
from axisbus.drives.gim6010.can_simple.codec import (
    DecodedMessage,
    MessageRequest,
    Reason,
    Unexpected,
)
from axisbus.drives.gim6010.can_simple.fields import FieldEncoding, GearSide
from axisbus.drives.gim6010.can_simple.identifier import can_id, split
from axisbus.drives.gim6010.can_simple.messages import MESSAGES, MessageRequestMethod, named
from axisbus.errors import ArgumentError, LimitError
from kit.can_simple import discrepancies
from kit.can_simple.documentation import direction

# Typed from the manual a second time: command, name, sender of data, and the fields' types with the first byte of each.
MANUAL = """\
01 Heartbeat < - I0B4
02 Estop > - -
03 Get_Error * B0 Q0
04 RxSdo * B0H1I4 B0H1I4
05 TxSdo * B0H1I4 B0H1I4
06 Set_Axis_Node_ID > I0 -
07 Set_Axis_State > I0 -
08 Mit_Control * - -
09 Get_Encoder_Estimates < - f0f4
0A Get_Encoder_Count < - i0i4
0B Set_Controller_Mode > I0I4 -
0C Set_Input_Pos > f0h4h6 -
0D Set_Input_Vel > f0f4 -
0E Set_Input_Torque > f0 -
0F Set_Limits > f0f4 -
10 Start_Anticogging > - -
11 Set_Traj_Vel_Limit > f0 -
12 Set_Traj_Accel_Limits > f0f4 -
13 Set_Traj_Inertia > f0 -
14 Get_Iq < - f0f4
16 Reboot > - -
17 Get_Bus_Voltage_Current < - f0f4
18 Clear_Errors > - -
19 Set_Linear_Count > i0 -
1A Set_Pos_Gain > f0 -
1B Set_Vel_Gains > f0f4 -
1C Get_Torques < - f0f4
1D Get_Powers < - f0f4
1E Disable_Can > - -
1F Save_Configuration > - -
"""
LETTERS = {
    "uint8": "B",
    "uint16": "H",
    "uint32": "I",
    "uint64": "Q",
    "int16": "h",
    "int32": "i",
    "float32": "f",
    "4 bytes": "I",
}
WAYS = {"to the module": ">", "from the module": "<", "both ways": "*"}
OWN = {"Mit_Control", "RxSdo", "TxSdo"}  # not encoded field by field
SENT = [each for each in MESSAGES if each.name not in OWN and not (each.answer and not each.sent)]


def layout(fields):
    whole = [each for each in fields if each.type.name in LETTERS and each.name != "Life"]
    return "".join(f"{LETTERS[each.type.name]}{each.start // 8}" for each in whole) or "-"


def test_the_table_is_the_manual_s():
    told = "".join(
        f"{each.command:02X} {each.name} {WAYS[direction(each)]} {layout(each.sent)} {layout(each.answer)}\n"
        for each in MESSAGES
    )
    assert told == MANUAL


# identifier, message, values, data: the examples of 4.1.1 and of 4.1.3.1 to 4.1.3.3
EXAMPLES = [
    (0x0AC, "Set_Input_Pos", {"Input_Pos": 3.14, "Vel_FF": 1.0, "Torque_FF": 5.0}, "C3 F5 48 40 E8 03 88 13"),
    (0x007, "Set_Axis_State", {"Axis_Requested_State": 4}, "04 00 00 00 00 00 00 00"),
    (0x007, "Set_Axis_State", {"Axis_Requested_State": 7}, "07 00 00 00 00 00 00 00"),
    (0x00B, "Set_Controller_Mode", {"Control_Mode": 2, "Input_Mode": 2}, "02 00 00 00 02 00 00 00"),
    (0x007, "Set_Axis_State", {"Axis_Requested_State": 8}, "08 00 00 00 00 00 00 00"),
    (0x00D, "Set_Input_Vel", {"Input_Vel": 10, "Torque_FF": 0}, "00 00 20 41 00 00 00 00"),
    (0x00B, "Set_Controller_Mode", {"Control_Mode": 3, "Input_Mode": 3}, "03 00 00 00 03 00 00 00"),
    (0x00C, "Set_Input_Pos", {"Input_Pos": 2.2, "Vel_FF": 0, "Torque_FF": 0}, "CD CC 0C 40 00 00 00 00"),
]


@pytest.mark.parametrize(("identifier", "name", "values", "data"), EXAMPLES)
def test_the_manual_s_examples(identifier, name, values, data):
    node = split(identifier).node
    assert codec.encode(node, named(name), values) == codec.Outgoing(identifier, bytes.fromhex(data))
    read = codec.decode(identifier, bytes.fromhex(data), from_module=False)
    assert isinstance(read, DecodedMessage)
    assert dict(read.values) == {key: pytest.approx(value, rel=1e-7) for key, value in values.items()}


def whole_range(field):
    if field.values:
        return st.sampled_from(sorted(field.values))
    if field.type.kind is FieldEncoding.FLOAT:
        high = field.high if math.isfinite(field.high) else struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
        return st.floats(max(field.low, -high), high, width=32)
    low, high = (
        max(field.low, field.type.bounds[0] / field.per_unit),
        min(field.high, field.type.bounds[1] / field.per_unit),
    )
    if field.per_unit == 1:
        return st.integers(int(low), int(high))
    return st.integers(round(low * field.per_unit), round(high * field.per_unit)).map(
        lambda raw: raw / field.per_unit
    )


@st.composite
def sendings(draw):
    message = draw(st.sampled_from(SENT))
    return draw(st.integers(0, 63)), message, {each.name: draw(whole_range(each)) for each in message.sent}


@given(sendings())
def test_every_message_decodes_to_its_encoded_values(sending):
    node, message, values = sending
    frame = codec.encode(node, message, values)
    assert len(frame.data) == 8
    assert not frame.remote
    read = codec.decode(frame.can_id, frame.data, from_module=False)
    assert read == DecodedMessage(node, message, values, False)


@given(
    st.integers(0, 63),
    st.sampled_from([each for each in MESSAGES if each.answer]),
    st.binary(min_size=8, max_size=8),
)
def test_every_answer_is_read_as_struct_reads_it(node, message, data):
    read = codec.decode(can_id(node, message.command), data, from_module=True)
    if isinstance(read, Unexpected):
        assert read.reason in (Reason.NOT_FINITE, Reason.VALUE, Reason.WRONG_NODE)
        return
    for field in message.answer:
        if letter := LETTERS.get(field.type.name):
            (raw,) = struct.unpack_from(f"<{letter}", data, field.start // 8)
            assert read.values[field.name] == (raw if field.per_unit == 1 else raw / field.per_unit)


@given(st.integers(), st.binary(max_size=64), st.booleans(), st.booleans(), st.booleans())
def test_no_frame_raises(identifier, data, from_module, remote, extended):
    found = codec.decode(identifier, data, from_module=from_module, remote=remote, extended=extended)
    assert isinstance(found, DecodedMessage | MessageRequest | Unexpected)
    assert codec.readings(identifier, data, remote=remote, extended=extended)
    if extended:
        assert found.reason is Reason.NOT_STANDARD


@pytest.mark.parametrize("message", [each for each in MESSAGES if each.answer], ids=lambda each: each.name)
def test_a_short_answer_is_an_unexpected_value_with_its_reason(message):
    identifier = can_id(3, message.command)
    for length in range(message.answer_bytes):
        found = codec.decode(identifier, bytes(length), from_module=True)
        assert isinstance(found, Unexpected)
        assert found.reason is Reason.LENGTH
        assert (found.node, found.command) == (3, message.command)
        assert f"where {message.answer_bytes} are needed" in found.words


@pytest.mark.parametrize(
    ("identifier", "data", "words"),
    [
        (0x000, "01 05", "command 00h: there is no such command"),  # NMT
        (0x095, "10 23 03 00 00 00 00 00", "command 15h: there is no such command"),  # EMCY of node 21
        (0x701, "05", "command 01h: it is too short (1 byte where 8 are needed)"),  # a heartbeat of CANopen
        (0x589, "60 40 60 00", "command 09h: it is too short (4 bytes where 8 are needed)"),  # SDO
        (0x089, "00 00 C0 7F 00 00 00 00", "command 09h: a value is not a finite number (Pos_Estimate)"),
        (
            0x024,
            "07 00 00 00 00 00 00 00",
            "command 04h: a value is not one that the manual lists (opcode 7)",
        ),
    ],
)
def test_foreign_traffic_is_reported_and_not_taken(identifier, data, words):
    assert codec.decode(identifier, bytes.fromhex(data), from_module=True).words == words


@pytest.mark.parametrize("remote", [True, False])
def test_requests_are_made_of_messages_that_answer_them(remote):
    asked = [each for each in MESSAGES if each.asked is MessageRequestMethod.EMPTY]
    assert [f"{each.command:02X}" for each in asked] == ["09", "0A", "14", "17", "1C", "1D"]
    for message in asked:
        frame = codec.request(5, message, remote=remote)
        assert (frame.data, frame.remote) == ((b"", True) if remote else (bytes(8), False))
        assert MessageRequest(5, message) in codec.readings(frame.can_id, frame.data, remote=frame.remote)


@pytest.mark.parametrize(
    "message",
    [each for each in MESSAGES if each.asked is not MessageRequestMethod.EMPTY],
    ids=lambda each: each.name,
)
def test_no_other_message_can_be_requested_with_an_empty_frame(message):
    with pytest.raises(ArgumentError, match="not sent in answer to an empty request"):
        codec.request(1, message, remote=False)


@pytest.mark.parametrize(
    ("name", "values", "error", "text"),
    [
        (
            "Set_Input_Vel",
            {"Input_Vel": math.nan, "Torque_FF": 0.0},
            ArgumentError,
            "Input_Vel: nan is not a number",
        ),
        ("Set_Input_Vel", {"Input_Vel": 1e39, "Torque_FF": 0.0}, LimitError, "beyond the range of float32"),
        ("Set_Input_Vel", {"Input_Vel": 1.0}, ArgumentError, "does not have these fields"),
        ("Set_Input_Vel", {"Input_Vel": True, "Torque_FF": 0.0}, ArgumentError, "True is not a number"),
        (
            "Set_Input_Pos",
            {"Input_Pos": 0, "Vel_FF": 32.768, "Torque_FF": 0},
            LimitError,
            "from -32.768 to 32.767",
        ),
        ("Set_Limits", {"Velocity_Limit": 30, "Current_Limit": 60}, LimitError, "from 0 to 50 A"),
        ("Set_Limits", {"Velocity_Limit": -1, "Current_Limit": 10}, LimitError, "Velocity_Limit: -1"),
        ("Set_Axis_State", {"Axis_Requested_State": 0}, ArgumentError, "not in the manual's list"),
        ("Set_Axis_State", {"Axis_Requested_State": 8.0}, ArgumentError, "not a whole number"),
        ("Set_Axis_Node_ID", {"Axis_Node_ID": 64}, LimitError, "from 0 to 63"),
        ("Set_Linear_Count", {"Linear_Count": 16384}, LimitError, "from -16383 to 16383"),
        ("Get_Iq", {}, ArgumentError, "is sent by the module"),
        ("Heartbeat", {}, ArgumentError, "is sent by the module"),
        ("Mit_Control", {}, ArgumentError, "use mit"),
        ("RxSdo", {}, ArgumentError, "use endpoint_messages"),
    ],
)
def test_a_message_that_must_not_be_sent_is_refused_with_a_reason(name, values, error, text):
    with pytest.raises(error, match=text) as refused:
        codec.encode(1, named(name), values)
    assert isinstance(refused.value, ArgumentError)


@pytest.mark.parametrize("node", [-1, 64, True, 1.0, "1"])
def test_a_node_that_there_is_not_is_refused(node):
    with pytest.raises(ArgumentError, match="is not a node ID of CAN Simple"):
        codec.encode(node, named("Estop"))


def test_a_message_that_there_is_not_is_refused():
    with pytest.raises(ArgumentError, match="no message 'Get_Motor_Error'"):
        named("Get_Motor_Error")


# -- Get_Error ------------------------------------------------------------------------------------------------------------------


def test_get_error_names_its_type_in_eight_bytes():
    frames = [error_query.request(1, each) for each in error_query.ErrorType]
    assert [frame.data.hex() for frame in frames] == [f"0{number}00000000000000" for number in (0, 1, 3, 4)]
    assert all(frame.can_id == 0x023 and not frame.remote for frame in frames)


@pytest.mark.parametrize(
    ("which", "data", "error"),
    [
        ("MOTOR", "00 00 00 00 08 00 00 00", 0x8_0000_0000),
        ("ENCODER", "04 00 00 00", 4),
        ("SYSTEM", "02 00 00 00 00 00 00 00", 2),
        ("MOTOR", "04 00 00 00", Reason.LENGTH),
        ("CONTROLLER", "01 00", Reason.LENGTH),
        ("CONTROLLER", "00 00 00 00 08 00 00 00", Reason.VALUE),
    ],
)
def test_the_answer_of_get_error_is_decoded_by_the_requested_type(which, data, error):
    found = error_query.read(1, bytes.fromhex(data), error_query.ErrorType[which])
    assert (found.reason if isinstance(found, Unexpected) else found) == error


# -- notes ----------------------------------------------------------------------------------------------------------------------


def test_the_notes_are_about_messages_that_there_are():
    assert {command for each in discrepancies.NOTES for command in each.commands} <= set(messages.BY_COMMAND)
    assert len({each.subject for each in discrepancies.NOTES}) == len(discrepancies.NOTES)
    assert [each.subject for each in discrepancies.about(0x0F)] == ["highest current"]


def test_only_mit_control_counts_at_the_output():
    output = {
        each.name
        for each in MESSAGES
        for field in (*each.sent, *each.answer)
        if field.side is GearSide.OUTPUT
    }
    assert output == {"Mit_Control"}
