"""The plug-in of the GIM6010-8: its vendor, its proposal of a scale, and the meaning of its fault bits."""

from __future__ import annotations

import pytest

from axisbus.cia301.emcy import decode, parse
from axisbus.drives.emcy_text import emcy_words, history_words
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.make import COUNTS_PER_OUTPUT_TURN, GIM6010
from axisbus.drives.registry import find

LOW, HIGH, REGISTER = (0x203F, 0), (0x203E, 0), (0x1001, 0)

# Typed off the manual's section 5.7 (category, bit, name) a second time, one or more of each kind.
MANUAL = """
system 00000002 DC_BUS_UNDER_VOLTAGE
system 00000004 DC_BUS_OVER_VOLTAGE
system 00000008 DC_BUS_OVER_REGEN_CURRENT
system 00000010 DC_BUS_OVER_CURRENT
axis 00000001 INVALID_STATE
axis 00000040 MOTOR_FAILED
axis 00000100 ENCODER_FAILED
axis 00000200 CONTROLLER_FAILED
axis 00001000 MIN_ENDSTOP_PRESSED
axis 00002000 MAX_ENDSTOP_PRESSED
axis 00004000 ESTOP_REQUESTED
axis 00020000 HOMING_WITHOUT_ENDSTOP
axis 00080000 UNKNOWN_POSITION
motor 00000001 PHASE_RESISTANCE_OUT_OF_RANGE
motor 00000002 PHASE_INDUCTANCE_OUT_OF_RANGE
motor 00000010 CONTROL_DEADLINE_MISSED
motor 00000080 MODULATION_MAGNITUDE
motor 00000400 CURRENT_SENSE_SATURATION
motor 00001000 CURRENT_LIMIT_VIOLATION
motor 00020000 MOTOR_THERMISTOR_OVER_TEMP
motor 00040000 FET_THERMISTOR_OVER_TEMP
motor 00080000 TIMER_UPDATE_MISSED
motor 00100000 CURRENT_MEASUREMENT_UNAVAILABLE
motor 00200000 CONTROLLER_FAILED
motor 00400000 I_BUS_OUT_OF_RANGE
motor 00800000 BRAKE_RESISTOR_DISARMED
motor 01000000 SYSTEM_LEVEL
motor 02000000 BAD_TIMING
motor 04000000 UNKNOWN_PHASE_ESTIMATE
motor 08000000 UNKNOWN_PHASE_VEL
motor 10000000 UNKNOWN_TORQUE
motor 20000000 UNKNOWN_CURRENT_COMMAND
motor 40000000 UNKNOWN_CURRENT_MEASUREMENT
motor 80000000 UNKNOWN_VBUS_VOLTAGE
motor 100000000 UNKNOWN_VOLTAGE_COMMAND
motor 200000000 UNKNOWN_GAINS
motor 400000000 CONTROLLER_INITIALIZING
motor 800000000 UNBALANCED_PHASES
controller 00000001 OVERSPEED
controller 00000002 INVALID_INPUT_MODE
controller 00000004 UNSTABLE_GAIN
controller 00000020 INVALID_ESTIMATE
controller 00000080 SPINOUT_DETECTED
encoder 00000001 UNSTABLE_GAIN
encoder 00000004 NO_RESPONSE
encoder 00000400 SEC_ENC_COM_FAIL
"""


def test_a_drive_is_found_by_its_vendor_with_any_product_code() -> None:
    assert find(0x000C0B00, None) is GIM6010
    assert find(0x000C0B00, 7) is GIM6010


def test_the_joint_module_proposes_its_scale_and_knows_its_quirks() -> None:
    assert COUNTS_PER_OUTPUT_TURN == 131072
    assert "364.0889 per degree" in GIM6010.scale_proposal
    assert GIM6010.behaviour.store_restarts
    assert GIM6010.fault_objects == (LOW, HIGH, REGISTER)


def test_the_fault_table_is_that_of_the_manual() -> None:
    table = {(fault.category, fault.name): fault for fault in faults.FAULTS}
    assert len(table) == len(faults.FAULTS) == 67
    for line in MANUAL.strip().splitlines():
        category, bits, name = line.split()
        assert table[category, name].bits == int(bits, 16), line


def test_each_fault_has_exactly_one_bit() -> None:
    for fault in faults.FAULTS:
        assert fault.bits.bit_count() == 1
        assert fault.meaning
        if (
            fault.name == "CAN_BUS_FAILED"
        ):  # by reports of owners alone: neither code nor register bit is known
            assert (fault.register_bit, fault.code) == (None, None)
        else:
            assert 0 <= fault.register_bit <= 7
            assert 0x1000 <= fault.code <= 0xFFFF
    assert len({(fault.category, fault.bits) for fault in faults.FAULTS}) == 67


@pytest.mark.parametrize(
    ("code", "details", "expected"),
    [
        (0x3220, {LOW: 0x2}, "system DC_BUS_UNDER_VOLTAGE"),
        (0x7122, {LOW: 0x40}, "axis MOTOR_FAILED"),
        (0x8400, {LOW: 0x1}, "controller OVERSPEED"),
        (0xFF00, {LOW: 0x1}, "axis INVALID_STATE"),
        (0x5220, {LOW: 0x1}, "system CONTROL_ITERATION_MISSED"),
        (0x7305, {LOW: 0x4}, "encoder NO_RESPONSE"),
        (0x3130, {LOW: 0, HIGH: 0x8}, "motor UNBALANCED_PHASES"),
        (0x2311, {LOW: 0x400}, "motor CURRENT_SENSE_SATURATION"),
        (0xFF00, {LOW: 0x4000}, "axis ESTOP_REQUESTED"),
    ],
)
def test_code_and_bit_together_name_one_fault(
    code: int, details: dict[tuple[int, int], int], expected: str
) -> None:
    (sentence,) = GIM6010.explain(code, details)
    assert sentence.startswith(f"{expected}: ")
    assert "ambiguous" not in sentence


def test_a_bit_that_code_and_register_leave_open_names_every_candidate() -> None:
    (sentence,) = GIM6010.explain(0x6320, {LOW: 0x2})
    assert "ambiguous" in sentence
    assert "controller INVALID_INPUT_MODE" in sentence
    assert "encoder CPR_POLEPAIRS_MISMATCH" in sentence
    assert "DC_BUS_UNDER_VOLTAGE" not in sentence


def test_without_a_code_the_error_register_narrows() -> None:
    (alone,) = GIM6010.explain(0, {LOW: 0x2})
    (with_register,) = GIM6010.explain(0, {LOW: 0x2, REGISTER: 1 << 2})
    assert "ambiguous" in alone
    assert with_register.startswith("system DC_BUS_UNDER_VOLTAGE")


def test_the_fault_named_by_the_code_is_first() -> None:
    first, second = GIM6010.explain(0x2311, {LOW: 0x1040})
    assert first.startswith("motor CURRENT_LIMIT_VIOLATION")
    assert "axis MOTOR_FAILED" in second


def test_an_error_code_without_bits_is_explained_as_far_as_possible() -> None:
    (sentence,) = GIM6010.explain(0x8400, {})
    assert sentence.startswith("controller OVERSPEED")
    assert GIM6010.explain(0xFF00, {}) == []
    assert GIM6010.explain(0, {}) == []
    assert GIM6010.explain(0x9999, {}) == []


def test_an_unknown_fault_bit_is_named_as_such() -> None:
    (sentence,) = GIM6010.explain(0xFF00, {HIGH: 0x80000000})
    assert sentence == "bit 0x8000000000000000 is not in the module's fault table"


def test_values_beyond_32_bits_do_no_harm() -> None:
    assert GIM6010.explain(0x3220, {LOW: -0x100000000 + 2, HIGH: 0})[0].startswith(
        "system DC_BUS_UNDER_VOLTAGE"
    )


def test_an_emergency_message_has_the_name_of_the_fault() -> None:
    under_voltage = parse(bytes.fromhex("20 32 05"), 0.0)
    assert "DC_BUS_UNDER_VOLTAGE: the supply voltage is too low" in emcy_words(under_voltage, GIM6010)
    assert "DC_BUS" not in emcy_words(under_voltage)
    assert "DC_BUS_UNDER_VOLTAGE" in history_words(decode(1, 0x3220), GIM6010)
