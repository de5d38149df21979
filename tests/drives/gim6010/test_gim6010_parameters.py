"""Parameters by name without a bus: writable ones, values as text, backups, and the plan of a restore."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.can_simple.endpoints import Firmware, parse, protected
from axisbus.drives.gim6010.parameters import backup, rules, values
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import ArgumentError, NodeTimeout, StateError

V13 = Firmware(0, 5, 13)
LIMIT, KT, NODE, OFFSET = (
    "axis0.controller.config.vel_limit",
    "axis0.motor.config.torque_constant",
    "axis0.config.can.node_id",
    "axis0.encoder.config.index_offset",
)


class Fake:
    """A module that is read and written at once; some paths it does not answer."""

    widest = 4

    def __init__(self, silent=()):
        self.module = Module(5)
        self.listed = parse(json.dumps(self.module.json()), "a list")
        self.firmware, self.serial = V13, 0x32323334
        self.silent = set(silent)

    def endpoint(self, path):
        return self.listed.endpoints[path]

    def read(self, path):
        if path in self.silent:
            raise NodeTimeout("no answer", node=5)
        value = self.module.usb_read(path)
        return bool(value) if self.listed.endpoints[path].type == "bool" else value


# -- rules --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "path",
    [
        "axis0.requested_state",
        "axis0.controller.input_pos",
        "axis0.controller.input_vel",
        "axis0.controller.input_torque",
        "axis0.controller.input_mit_kp",
        "axis0.config.startup_closed_loop_control",
        "erase_configuration",
        "reboot",
        "axis0.encoder.set_linear_count",
    ],
)
def test_parameters_that_act_are_never_written(path):
    for by_name in (True, False):
        with pytest.raises(ArgumentError, match="not written here"):
            rules.require_writable(path, by_name=by_name)
    assert rules.acts(path)


@pytest.mark.parametrize(
    "path", [KT, OFFSET, "axis0.encoder.config.phase_offset_float", "can.config.protocol"]
)
def test_a_protected_parameter_is_written_only_if_it_is_named(path):
    rules.require_writable(path, by_name=True)
    with pytest.raises(ArgumentError, match="is protected"):
        rules.require_writable(path, by_name=False)


def test_the_node_id_is_no_parameter_to_be_written():
    for by_name in (True, False):
        with pytest.raises(ArgumentError, match="not written as a parameter"):
            rules.require_writable(NODE, by_name=by_name)


def test_parameters_that_belong_to_a_backup():
    listed = Fake().listed
    kept = {each.path for each in listed.endpoints.values() if rules.kept(each)}
    assert {LIMIT, KT, NODE} < kept
    assert not kept & {"axis0.requested_state", "axis0.controller.input_pos", "serial_number", "vbus_voltage"}
    assert not any(rules.acts(path) for path in kept)
    assert not kept & set(listed.functions)


# -- values -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("bool", "true", True),
        ("bool", "OFF", False),
        ("float", "1e-3", 0.001),
        ("uint8", "0x10", 16),
        ("int32", "-5", -5),
    ],
)
def test_text_is_read_by_the_type(kind, text, value):
    found = values.parse("a", kind, text)
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(
    ("kind", "text"),
    [("bool", "2"), ("float", "nan"), ("float", "inf"), ("float", ""), ("uint8", "1.5"), ("int32", "x")],
)
def test_text_that_is_no_value_is_refused(kind, text):
    with pytest.raises(ArgumentError, match="a: "):
        values.parse("a", kind, text)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float_is_shown_so_that_it_is_the_same_again_within_its_digits(value):
    assert float(values.show(float(value))) == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize(
    ("one", "other", "equal"),
    [
        (0.1, 0.10000000149011612, True),
        (math.nan, math.nan, True),
        (0.1, 0.1000001, False),
        (1, 2, False),
        (1e300, 2, False),
    ],
)
def test_values_are_compared_as_the_module_has_them(one, other, equal):
    assert values.same(one, other) is equal


# -- backups ------------------------------------------------------------------------------------------------------------------

VALUE = st.one_of(st.booleans(), st.integers(-(2**31), 2**32 - 1), st.floats(width=32))
SETS = st.dictionaries(
    st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1), VALUE, max_size=8
)


@given(SETS, st.integers(0, 2**32 - 1))
def test_a_backup_is_read_as_it_was_written(settings, serial):
    one = backup.ParameterBackup(serial, V13, settings)
    found = backup.read(one.text(), "file")
    assert (found.serial, found.firmware) == (serial, V13)
    assert backup.differences(settings, found.values) == []
    assert found.text() == one.text()


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "{}", "[" * 100000,
        json.dumps({"kind": "else"}),
        backup.ParameterBackup(1, V13, {}).text().replace('"values": {}', '"values": []'),
        backup.ParameterBackup(1, V13, {}).text().replace('"firmware"', '"fw"'),
        backup.ParameterBackup(1, V13, {"a": 1}).text().replace('"version": 1', '"version": 2'),
        backup.ParameterBackup(1, V13, {"a": 1}).text().replace('"a": 1', '"a": null'),
        backup.ParameterBackup(1, V13, {"a": 1}).text().replace('"a": 1', '"a": "x"'),
        backup.ParameterBackup(1, V13, {"a": 1}).text().replace("00000001", "serial"),
        backup.ParameterBackup(1, V13, {"a": 1}).text().replace("0.5.13", "new"),
    ],
)  # fmt: skip
def test_an_invalid_backup_is_refused_with_its_file_name(text):
    with pytest.raises(ArgumentError, match="file: "):
        backup.read(text, "file")


def test_an_integer_beyond_the_floats_differs_from_every_float():
    text = backup.ParameterBackup(1, V13, {"a": 1}).text().replace('"a": 1', f'"a": 1{"0" * 400}')
    (differs,) = backup.differences({"a": 1.5}, backup.read(text, "file").values)
    assert differs.path == "a"


def test_a_backup_is_complete_or_fails():
    taken = backup.take(Fake())
    assert taken.values[LIMIT] == 30
    assert taken.name == "gim6010-32323334-0.5.13.json"
    with pytest.raises(StateError, match=r"no backup.*vel_limit"):
        backup.take(Fake(silent=[LIMIT]))


def test_reading_parameters_of_a_module_that_answers_nothing_raises():
    fake = Fake()
    fake.silent = set(fake.listed.endpoints)
    with pytest.raises(NodeTimeout):
        backup.read_all(fake, fake.listed.endpoints.values())


def test_parameters_that_are_not_answered_are_reported_and_the_others_read():
    fake = Fake()
    wanted = [each for each in fake.listed.endpoints.values() if each.readable and rules.travels(each)]
    fake.silent = {each.path for each in wanted[::2]}
    many = backup.read_all(fake, wanted)
    assert len(many.silent) > 5
    assert set(many.silent) == fake.silent
    assert set(many.values) == {each.path for each in wanted[1::2]}


@given(SETS, SETS)
def test_differences_are_exactly_the_values_that_differ(one, other):
    found = {each.path: each for each in backup.differences(one, other)}
    for path in {*one, *other}:
        equal = path in one and path in other and values.same(one[path], other[path])
        assert (path in found) != equal
    assert all(each.words for each in found.values())


# -- the plan of a restore ----------------------------------------------------------------------------------------------------


def changed(fake, **more):
    taken = backup.take(fake)
    return backup.ParameterBackup(
        taken.serial, taken.firmware, {**taken.values, LIMIT: 10.0, KT: 0.2, NODE: 9, **more}
    )


def test_a_restore_leaves_protected_parameters_unless_they_are_named():
    fake = Fake()
    present = backup.take(fake).values
    plan = backup.plan(changed(fake), fake, present, frozenset())
    assert plan.writes == ((LIMIT, 10.0),)
    assert dict(plan.left).keys() == {KT, NODE}
    assert "--include" in dict(plan.left)[KT]
    assert set(backup.plan(changed(fake), fake, present, frozenset({KT})).writes) == {
        (LIMIT, 10.0),
        (KT, 0.2),
    }


def test_a_parameter_that_the_backup_does_not_have_is_left_unchanged():
    fake = Fake()
    present = backup.take(fake).values
    short = backup.ParameterBackup(fake.serial, V13, {LIMIT: 10.0})
    plan = backup.plan(short, fake, present, frozenset())
    assert (plan.writes, plan.left) == (((LIMIT, 10.0),), ())


def test_parameters_that_are_never_written_cannot_be_included():
    fake = Fake()
    present = backup.take(fake).values
    wild = changed(fake, **{"axis0.requested_state": 8, "axis0.none": 1})
    plan = backup.plan(wild, fake, present, frozenset())
    assert plan.writes == ((LIMIT, 10.0),)
    assert {"axis0.requested_state", "axis0.none"} < dict(plan.left).keys()
    for path in (NODE, "axis0.requested_state", "not.there"):
        with pytest.raises(ArgumentError):
            backup.plan(wild, fake, present, frozenset({path}))


def test_a_backup_of_another_module_or_firmware_is_refused_unless_explicitly_allowed():
    fake = Fake()
    good = {"other_module": False, "other_firmware": False}
    backup.require_same(backup.take(fake), fake, **good)
    other = backup.ParameterBackup(1, V13, {})
    with pytest.raises(StateError, match="--other-module"):
        backup.require_same(other, fake, **good)
    backup.require_same(other, fake, **{**good, "other_module": True})
    newer = backup.ParameterBackup(fake.serial, Firmware(0, 6, 0), {})
    with pytest.raises(StateError, match="--other-firmware"):
        backup.require_same(newer, fake, **{**good, "other_module": True})
    backup.require_same(newer, fake, **{**good, "other_firmware": True})


def test_every_protected_setting_has_a_reason():
    for path in (KT, OFFSET, NODE, "can.config.baud_rate"):
        found = protected(path)
        assert found is not None
        assert found.why
        assert found.why in backup.ParameterDifference(path, 1, 2).words
