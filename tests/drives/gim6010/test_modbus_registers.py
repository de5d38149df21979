"""Modbus registers, byte for byte by the manual (v2.2, 4.3.2 to 4.3.4), and over their whole range."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.can_simple.messages import MESSAGES
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.registers import BY_NAME, ERROR_FLAGS, REGISTERS, Bank, RegisterKind, named
from axisbus.drives.gim6010.modbus.requests import ModbusFunction, ModbusRequest, Reply, fits
from axisbus.errors import ArgumentError, LimitError
from kit.modbus import open_points

# Typed off the manual a second time: function that reads, first address, registers, letter of the value, requests that it shows.
MANUAL = """\
04 01 1 H r Motor State
04 02 1 H r Error Flags
04 03 2 I r Driver Error Code
04 05 4 Q r Motor Error Code
04 09 2 I r Encoder Error Code
04 0B 2 I r Controller Error Code
04 0D 2 I r System Error Code
04 0F 2 f r Position Feedback
04 11 2 f r Velocity Feedback
04 13 2 f r DC-Bus Voltage Feedback
04 15 2 f r DC-Bus Current Feedback
04 17 2 f r Q-Axis Current Setpoint
04 19 2 f r Q-Axis Current Feedback
04 31 2 I r Random Endpoint Access Return Value
03 61 1 H w Emergency Stop
03 62 1 H rw Node ID
03 63 1 H w State Control
03 64 1 H rw Control Mode
03 65 1 H rw Input Mode
03 66 2 f rw Position-Control Setpoint
03 68 2 f rw Velocity-Control Setpoint
03 6A 2 f rw Torque-Control Setpoint
03 6C 2 f rw Velocity Limit
03 6E 2 f rw Current Limit
03 70 2 f rw Trapezoidal Position-Control Velocity Limit
03 72 2 f rw Trapezoidal Position-Control Acceleration Limit
03 74 2 f rw Trapezoidal Position-Control Deceleration Limit
03 76 2 f rw Inertia
03 78 2 f rw Position Gain
03 7A 2 f rw Velocity Gain
03 7C 2 f rw Velocity Integrator Gain
03 7E 1 H w Reboot
03 7F 1 H w Clear Errors
03 80 1 H w Save Configuration
03 A1 1 H w Random Endpoint Access — Endpoint Number
03 A2 2 I w Random Endpoint Access Write Value
"""
LETTERS = {"uint16": "H", "uint32": "I", "uint64": "Q", "float32": "f", "4 bytes": "I"}
WRITTEN = [each for each in REGISTERS if each.writable]
HIGHEST = struct.unpack(">f", b"\x7f\x7f\xff\xff")[0]


def letter(register):
    return LETTERS[register.field.type.name]


def test_the_table_is_the_manual_s():
    told = "".join(
        f"{each.bank.value:02X} {each.address:02X} {each.count} {letter(each)} {each.access} {each.title}\n"
        for each in REGISTERS
    )
    assert told == MANUAL


def test_no_address_has_two_values_and_no_name_occurs_twice():
    for bank in Bank:
        taken = [
            each.address + offset for each in REGISTERS if each.bank is bank for offset in range(each.count)
        ]
        assert len(taken) == len(set(taken))
    assert len(BY_NAME) == len(REGISTERS)


# The frames of 4.3.4 without their CRC, which the manual leaves out; the last of example 2 is the one that is not repeated.
EXAMPLES = [
    ("control_mode", 2, "01 06 00 64 00 02"),
    ("input_mode", 2, "01 06 00 65 00 02"),
    ("state_control", 8, "01 06 00 63 00 08"),
    ("velocity_setpoint", 2.3, "01 10 00 68 00 02 04 40 13 33 33"),
    ("control_mode", 3, "01 06 00 64 00 03"),
    ("input_mode", 3, "01 06 00 65 00 03"),
    ("position_setpoint", 3.1416, "01 10 00 66 00 02 04 40 49 0F F9"),
]


@pytest.mark.parametrize(("name", "value", "frame"), EXAMPLES)
def test_the_manual_s_examples(name, value, frame):
    request = requests.write(named(name), value)
    assert request.frame(1) == bytes.fromhex(frame)
    assert named(name).value(request.words) == pytest.approx(value, rel=1e-7)


def test_the_wrong_example_of_the_manual_is_reported_and_positions_are_never_sent_as_velocities():
    wrong = bytes.fromhex("01 10 00 68 00 02 04 40 49 0F F9")
    assert requests.write(named("velocity_setpoint"), 3.1416).frame(1) == wrong
    assert requests.write(named("position_setpoint"), 3.1416).frame(1) != wrong
    assert "66h" in next(each.done for each in open_points.NOTES if each.subject == "example 2 of 4.3.4")
    assert "example 2" in named("position_setpoint").note
    assert "example 2" in named("velocity_setpoint").note


# The request frames of 4.3.2 and 4.3.3, as their tables print them, for one address of each length.
@pytest.mark.parametrize(
    ("name", "frame"),
    [
        ("motor_state", "07 04 00 01 00 01"),
        ("error_flags", "07 04 00 02 00 01"),
        ("driver_error", "07 04 00 03 00 02"),
        ("motor_error", "07 04 00 05 00 04"),
        ("position_feedback", "07 04 00 0F 00 02"),
        ("iq_feedback", "07 04 00 19 00 02"),
        ("endpoint_return", "07 04 00 31 00 02"),
        ("node_id", "07 03 00 62 00 01"),
        ("velocity_integrator_gain", "07 03 00 7C 00 02"),
    ],
)
def test_the_manual_s_requests_to_read(name, frame):
    assert requests.read(named(name)).frame(7) == bytes.fromhex(frame)


@pytest.mark.parametrize(
    ("name", "value", "frame"),
    [
        ("emergency_stop", 1, "07 06 00 61 00 01"),
        ("node_id", 5, "07 06 00 62 00 05"),
        ("state_control", 1, "07 06 00 63 00 01"),
        ("velocity_limit", 30.0, "07 10 00 6C 00 02 04 41 F0 00 00"),
        ("save_configuration", 1, "07 06 00 80 00 01"),
        ("endpoint_number", 0x1234, "07 06 00 A1 12 34"),
        ("endpoint_value", 0x01020304, "07 10 00 A2 00 02 04 01 02 03 04"),
    ],
)
def test_the_manual_s_requests_to_write(name, value, frame):
    assert requests.write(named(name), value).frame(7) == bytes.fromhex(frame)


def whole_range(register):
    field = register.field
    if field.values:
        return st.sampled_from(sorted(field.values))
    low, high = field.type.bounds
    if letter(register) == "f":
        return st.floats(max(field.low, -HIGHEST), min(field.high, HIGHEST), width=32)
    return st.integers(int(max(low, field.low)), int(min(high, field.high)))


@given(st.data(), st.sampled_from(WRITTEN))
def test_every_value_is_encoded_as_by_struct_and_restored(data, register):
    value = data.draw(whole_range(register))
    request = requests.write(register, value)
    packed = b"".join(word.to_bytes(2, "big") for word in request.words)
    assert packed == struct.pack(f">{letter(register)}", value + 0.0 if letter(register) == "f" else value)
    assert register.value(request.words) == value


@given(st.sampled_from(REGISTERS), st.binary(min_size=8, max_size=8))
def test_any_registers_are_decoded_as_by_struct(register, data):
    size = 2 * register.count
    words = tuple(int.from_bytes(data[at : at + 2], "big") for at in range(0, size, 2))
    (expected,) = struct.unpack(f">{letter(register)}", data[:size])
    found = register.value(words)
    assert found == expected or (math.isnan(found) and math.isnan(expected))


def test_a_zero_is_never_negative():
    assert requests.write(named("velocity_setpoint"), -0.0).words == (0, 0)


@given(st.sampled_from(REGISTERS), st.lists(st.integers(0, 0xFFFF), max_size=9))
def test_no_request_cuts_a_value_or_takes_two(register, words):
    whole = not words or (register.bank is Bank.HOLDING and len(words) == register.count)
    if not whole:
        with pytest.raises(ArgumentError, match="not a whole value"):
            ModbusRequest(register, tuple(words))
        return
    request = ModbusRequest(register, tuple(words))
    assert request.pdu[1:3] == register.address.to_bytes(2, "big")
    if not words:
        assert (request.pdu[0], request.pdu[3:]) == (
            int(register.bank.value),
            register.count.to_bytes(2, "big"),
        )
    else:
        assert (request.function is ModbusFunction.WRITE_ONE) == (register.count == 1)
        assert request.pdu[-2 * register.count :] == b"".join(word.to_bytes(2, "big") for word in words)


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("state_control", 3, "not in the manual's list"),  # never a calibration
        ("state_control", 11, "not in the manual's list"),
        ("control_mode", 0, "not in the manual's list"),
        ("input_mode", 9, "not in the manual's list"),
        ("node_id", 0, "cannot be sent"),
        ("node_id", 64, "cannot be sent"),
        ("current_limit", 50.1, "to 50"),
        ("velocity_limit", -1.0, "from 0"),
        ("velocity_setpoint", math.nan, "not a number"),
        ("position_setpoint", 1e39, "beyond the range of float32"),
        ("endpoint_number", 1 << 16, "to 65535"),
        ("position_feedback", 1.0, "cannot be written"),
    ],
)
def test_writes_that_are_never_sent(name, value, error):
    with pytest.raises(ArgumentError, match=error):
        requests.write(named(name), value)


def test_limits_are_reported_as_limits():
    with pytest.raises(LimitError):
        requests.write(named("current_limit"), 60.0)
    with pytest.raises(ArgumentError, match="there are motor_state"):
        named("position")


def test_units_sides_and_parameters_are_those_of_can_simple():
    known = {field.path: field for each in MESSAGES for field in (*each.sent, *each.answer) if field.path}
    shared = [each for each in REGISTERS if each.field.path in known and letter(each) == "f"]
    assert len(shared) > 15
    for each in shared:
        field = known[each.field.path]
        assert (each.field.unit, each.field.side) == (field.unit, field.side), each
        assert each.field.high == field.high or each.kind is RegisterKind.TARGET


def answer(request, **other):
    """The correct answer of a module, with the given changes."""
    if request.function in (ModbusFunction.READ_HOLDING, ModbusFunction.READ_INPUT):
        fields = {"words": (0,) * request.count}
    elif request.function is ModbusFunction.WRITE_ONE:
        fields = {"words": request.words, "address": request.address}
    else:
        fields = {"address": request.address, "count": request.count}
    return Reply(**{"function": int(request.function), **fields, **other})


@pytest.mark.parametrize("register", REGISTERS, ids=repr)
def test_a_reply_fits_by_all_that_it_reports(register):
    asked = [requests.read(register)] if register.readable else []
    if register.writable:
        asked.append(requests.write(register, next(iter(register.field.values), 1)))
    for request in asked:
        assert fits(request, answer(request))
        assert fits(request, Reply(request.function | 0x80, exception=2))
        assert not fits(request, Reply((request.function ^ 1) | 0x80, exception=2))
        assert not fits(request, answer(request, function=request.function ^ 1))
        if not request.writes:
            assert not fits(request, answer(request, words=(0,) * (request.count + 1)))
            continue
        assert not fits(request, answer(request, address=request.address + 1))
        if request.function is ModbusFunction.WRITE_ONE:
            assert not fits(request, answer(request, words=(request.words[0] ^ 1,)))
        else:
            assert not fits(request, answer(request, count=request.count + 1))


def test_exceptions_have_words():
    assert "no such register" in requests.exception_words(2)
    assert "does not have" in requests.exception_words(99)


def test_the_flags_name_words_and_categories_that_there_are():
    from axisbus.drives.gim6010 import faults

    categories = {each.category for each in faults.FAULTS}
    assert [category in categories and named(name).count > 1 for name, category in ERROR_FLAGS.values()] == [
        True
    ] * 5
