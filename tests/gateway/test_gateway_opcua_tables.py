"""The values and the access rules of an OPC UA server: the pure half, which needs no asyncua."""

from __future__ import annotations

import subprocess
import sys

import pytest

from axisbus.cell import reader
from axisbus.errors import ArgumentError, ConfigError, OwnershipError, SetPointError, StateError, Stopped
from axisbus.gateway.machine_events import MachineEventSource
from axisbus.gateway.opcua import users, variables
from axisbus.gateway.opcua.axis_readings import (
    AxisReadings,
    ImageFreshness,
    Memory,
    OpcuaValue,
    Quality,
    judged,
)
from axisbus.gateway.opcua.event_mapping import opcua_events
from axisbus.gateway.opcua.methods import status_of
from axisbus.gateway.opcua.server_options import Access, Given, decide
from axisbus.gateway.opcua.variables import ROWS
from axisbus.motion.states import AxisState
from axisbus.units import AXIS_UNITS
from kit.cell import cell_text

# -- units and states ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "position", "velocity"),
    [  # OPC 10000-8 5.6.4.3 gives 5066068 for MMT as its example
        ("mm", 5066068, 4403510),
        ("deg", 17476, 4536630),
        ("rad", 4405297, 12865),
        ("m", 5067858, 5067859),
    ],
)
def test_a_unit_has_its_number_by_the_letters_of_its_code(unit, position, velocity):
    assert variables.position_unit(unit).number == position
    assert variables.velocity_unit(unit).number == velocity


@pytest.mark.parametrize("unit", AXIS_UNITS)
def test_every_unit_of_an_axis_keeps_its_word_and_one_without_a_code_has_no_number(unit):
    for found, symbol in (
        (variables.position_unit(unit), unit),
        (variables.velocity_unit(unit), f"{unit}/s"),
    ):
        assert found.symbol == symbol
        assert found.name
        assert (found.number == -1) is (found.code == "")
        assert len(found.code) <= 3


def test_a_torque_is_in_newton_metres_only_if_the_rated_torque_is_known():
    assert variables.torque_unit(5.0).symbol == "N·m"
    assert variables.torque_unit(None).name == "part of the rated torque"


def test_every_state_and_mode_has_a_number_and_a_name():
    assert [variables.AXIS_STATES[variables.axis_state(state)] for state in AxisState] == [
        s.value for s in AxisState
    ]
    assert variables.CONTROL_MODES[variables.control_mode(8)] == "cyclic sync position"
    assert variables.CONTROL_MODES[variables.control_mode(-3)] == "a manufacturer-specific mode"
    assert variables.HOMING_STATES[variables.homing_state(True)] == "REFERENCED"
    assert all(
        0 <= number < 1 << 16
        for names in (variables.AXIS_STATES, variables.CONTROL_MODES)
        for number in names
    )


@pytest.mark.parametrize(
    ("lines", "kind"),
    [
        ('unit = "deg"', variables.ROTATORY),
        ('unit = "deg"\nmodulo = 360.0', variables.ROTATORY_MODULO),
        ('unit = "mm"', variables.LINEAR),
        ('unit = "increments"', None),
        ('unit = "teeth"', None),
    ],
)
def test_the_type_of_an_axis_follows_from_its_unit(tmp_path, lines, kind):
    file = tmp_path / "cell.toml"
    file.write_text(cell_text("x").replace('unit = "deg"', lines), "utf-8")
    cell, _ = reader.read(file)
    assert cell is not None
    assert variables.axis_type(cell.axes["x"]) == kind


# -- whether a value is good ----------------------------------------------------------------------------------------------

LAST = OpcuaValue(4.0, Quality.GOOD, 1.0)


@pytest.mark.parametrize(
    ("fresh", "image", "last", "told"),
    [
        (5.0, ImageFreshness.NOW, LAST, OpcuaValue(5.0, Quality.GOOD, 2.0)),
        (5.0, ImageFreshness.NOW, None, OpcuaValue(5.0, Quality.GOOD, 2.0)),
        (None, ImageFreshness.NOW, LAST, OpcuaValue(4.0, Quality.LAST_USABLE, 1.0)),
        (5.0, ImageFreshness.OLD, LAST, OpcuaValue(4.0, Quality.LAST_USABLE, 1.0)),
        (None, ImageFreshness.NOW, None, OpcuaValue(None, Quality.WAITING)),
        (5.0, ImageFreshness.OLD, None, OpcuaValue(None, Quality.WAITING)),
        (5.0, ImageFreshness.NONE, LAST, OpcuaValue(None, Quality.NO_COMMUNICATION)),
        (None, ImageFreshness.NONE, None, OpcuaValue(None, Quality.NO_COMMUNICATION)),
    ],
)
def test_a_value_is_good_only_while_it_and_its_image_are_fresh(fresh, image, last, told):
    assert judged(fresh, 2.0, image, last) == told


def test_values_of_one_machine_are_not_usable_for_the_next():
    memory, key = Memory(), ("x", "PositionActualValue")
    assert memory.judge(key, 1.0, 1.0, ImageFreshness.NOW).quality is Quality.GOOD
    assert memory.judge(key, None, 2.0, ImageFreshness.NOW) == OpcuaValue(1.0, Quality.LAST_USABLE, 1.0)
    memory.forget()
    assert memory.judge(key, None, 3.0, ImageFreshness.NOW).quality is Quality.WAITING


def test_every_value_waits_without_a_machine_and_is_bad_after_the_machine_ended(machine):
    looker = AxisReadings(machine.cell)
    names = {(axis, row.name) for axis in "xy" for row in ROWS}
    before = looker.poll()
    assert set(before) == names
    assert {reading.quality for reading in before.values()} == {Quality.WAITING}
    looker.follow(machine)
    assert looker.poll()["x", "PositionActualValue"].quality is Quality.GOOD
    looker.follow(None)
    assert {reading.quality for reading in looker.poll().values()} == {Quality.NO_COMMUNICATION}


def test_the_served_values_are_those_of_the_axis(machine):
    looker = AxisReadings(machine.cell)
    looker.follow(machine)
    machine["x"].enable().wait(5)
    machine["x"].move_absolute(5.0).wait(20)
    seen = looker.poll()
    x = machine["x"]
    assert seen["x", "PositionActualValue"].value == pytest.approx(x.position)
    assert seen["x", "VelocityActualValue"].value == pytest.approx(x.velocity)
    assert seen["x", "TorqueForceActualValue"].value == pytest.approx(x.torque)
    assert seen["x", "PositionFollowingError"].value == pytest.approx(x.following_error)
    assert variables.AXIS_STATES[seen["x", "AxisState"].value] == "Standstill"
    assert variables.CONTROL_MODES[seen["x", "ControlMode"].value] == "profile position"
    assert seen["y", "HomingState"].value == 0
    assert {reading.quality for (_, name), reading in seen.items() if name != "MotorTemperature"} == {
        Quality.GOOD
    }


def test_of_a_lost_node_only_values_of_the_master_are_good(machine):
    looker = AxisReadings(machine.cell)
    looker.follow(machine)
    machine.simulated_node(1).device.dials.dead = True
    machine.sleep(1.0)
    seen = looker.poll()
    assert seen["x", "PositionActualValue"].quality is Quality.NO_COMMUNICATION
    assert seen["x", "ControlMode"].quality is Quality.NO_COMMUNICATION
    assert variables.AXIS_STATES[seen["x", "AxisState"].value] == "ErrorStop"
    assert seen["y", "PositionActualValue"].quality is Quality.GOOD


def test_after_the_machine_has_ended_all_its_values_are_bad(machine):
    looker = AxisReadings(machine.cell)
    looker.follow(machine)
    looker.poll()
    machine.close()
    assert {reading.quality for reading in looker.poll().values()} == {Quality.NO_COMMUNICATION}


# -- errors ---------------------------------------------------------------------------------------------------------------


def test_a_fault_is_reported_once_with_its_message_incident_and_remedy(machine):
    happenings = MachineEventSource()
    looker = AxisReadings(machine.cell)
    looker.follow(machine)
    machine["x"].enable().wait(5)
    assert opcua_events(happenings.poll(machine, looker.now())) == []
    machine.simulated_node(1).fault(0x8611)
    machine.sleep(1.0)
    found = {each.severity: each for each in opcua_events(happenings.poll(machine, looker.now()))}
    fault, incident, emcy = (found.pop(severity) for severity in (900, 800, 700))
    assert emcy.message.startswith("node 1: EMCY 0x8611")
    assert "error register" in emcy.message
    assert fault.message.startswith("x")
    assert fault.remedy
    assert incident.message == "node 1: incident 1: unresolved"
    assert "0x8611" in incident.cause
    assert {each.axis for each in (fault, incident, emcy)} == {"x"}
    assert found == {}


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (OwnershipError("no"), "BadUserAccessDenied"),
        (StateError("no"), "BadInvalidState"),
        (SetPointError("no"), "BadDeviceFailure"),
        (TimeoutError("no"), "BadTimeout"),
        (Stopped("no"), "BadInvalidState"),
    ],
)
def test_each_kind_of_error_has_a_status(error, status):
    assert status_of(error) == status


# -- access ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "access"),
    [
        (Given(True), Access(False, False, True, False)),
        (Given(True, users=True), Access(False, False, True, True)),
        (Given(False, insecure=True), Access(False, False, True, False)),
        (Given(False, certificate=True, trust=True), Access(True, True, True, False)),
        (Given(False, certificate=True, users=True), Access(True, False, False, True)),
        (Given(False, certificate=True, trust=True, users=True), Access(True, True, True, True)),
        (Given(True, certificate=True, trust=True), Access(True, True, True, False)),
    ],
)
def test_the_access_rules_follow_from_the_options(given, access):
    assert decide(given) == access


@pytest.mark.parametrize(
    "given",
    [
        Given(False),
        Given(False, users=True),
        Given(False, insecure=True, users=True),
        Given(False, certificate=True),
        Given(True, certificate=True),
        Given(True, trust=True),
        Given(False, insecure=True, trust=True),
    ],
)
def test_options_without_access_control_or_without_sense_are_refused(given):
    with pytest.raises(ArgumentError) as caught:
        decide(given)
    assert "--" in caught.value.remedy


def test_a_user_needs_his_own_password(tmp_path):
    file = tmp_path / "users"
    file.write_text(
        f"# operators\n\n{users.line_of('anna', 'right')}\n{users.line_of('bert', 'other')}\n", "utf-8"
    )
    known = users.read(file)
    assert known.is_correct("anna", "right")
    assert not known.is_correct("anna", "other")
    assert not known.is_correct("anna", "")
    assert not known.is_correct("nobody", "right")
    assert not known.is_correct("anna", "right" + "x" * 10_000)
    assert "right" not in file.read_text("utf-8")


def test_the_hash_is_that_of_the_standard():
    assert users.line_of("anna", "pleaseletme", b"SodiumChloride").startswith(
        "anna:scrypt:16384:8:1:U29kaXVt"
    )
    secret = users.Secret(
        16384,
        8,
        1,
        b"SodiumChloride",
        bytes.fromhex(
            "7023bdcb3afd7348461c06cd81fd38ebfda8fbba904f8e3ea9b543f6545da1f2"
            "d5432955613f0fcf62d49705242a9af9e61e85dc0d651e40dfcf017b45575887"
        ),
    )
    assert secret.matches("pleaseletmein")  # RFC 7914 12


@pytest.mark.parametrize(
    "line",
    [
        "anna:right",
        "anna:plain:1:1:1:c2FsdHNhbHQ=:aGFzaGhhc2hoYXNoaGFzaA==",
        "anna:scrypt:16384:8:1:c2FsdHNhbHQ=:short",
        "anna:scrypt:16383:8:1:c2FsdHNhbHQ=:aGFzaGhhc2hoYXNoaGFzaA==",
        "anna:scrypt:1073741824:8:1:c2FsdHNhbHQ=:aGFzaGhhc2hoYXNoaGFzaA==",
        "anna:scrypt:16384:8:4096:c2FsdHNhbHQ=:aGFzaGhhc2hoYXNoaGFzaA==",
        "anna:scrypt:x:8:1:c2FsdHNhbHQ=:aGFzaGhhc2hoYXNoaGFzaA==",
        "an na:scrypt:16384:8:1:c2FsdHNhbHQ=:aGFzaGhhc2hoYXNoaGFzaA==",
        ":scrypt:16384:8:1:c2FsdHNhbHQ=:aGFzaGhhc2hoYXNoaGFzaA==",
    ],
)
def test_an_invalid_line_is_reported_with_its_number(tmp_path, line):
    file = tmp_path / "users"
    file.write_text(f"# one\n{line}\n", "utf-8")
    with pytest.raises(ConfigError, match="users:2:"):
        users.read(file)


@pytest.mark.parametrize("text", ["", "# nobody\n", None, b"\xff\xfe"])
def test_a_file_without_users_is_refused(tmp_path, text):
    file = tmp_path / "users"
    if text is not None:
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigError, match="users"):
        users.read(file)


def test_a_duplicate_user_is_refused(tmp_path):
    file = tmp_path / "users"
    file.write_text(f"{users.line_of('anna', 'a')}\n{users.line_of('anna', 'b')}\n", "utf-8")
    with pytest.raises(ConfigError, match="twice"):
        users.read(file)


@pytest.mark.parametrize(
    ("name", "password"), [("a b", "x"), ("", "x"), ("a:b", "x"), ("anna", ""), ("anna", "x" * 257)]
)
def test_an_invalid_name_or_password_makes_no_line(name, password):
    with pytest.raises(ArgumentError):
        users.line_of(name, password)


def test_the_tables_and_the_command_line_do_not_load_asyncua():
    program = (
        "import sys, axisbus.cli.bridge.opcua, axisbus.cli.bridge.opcua, axisbus.gateway.opcua.axis_readings;"
        "sys.exit('asyncua' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
