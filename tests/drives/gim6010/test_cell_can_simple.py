"""A node that speaks CAN Simple in a cell file: required and forbidden keys, and commands that include the node."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus.cell import reader
from axisbus.cell.other_protocols import with_dictionaries
from axisbus.check.run import check
from axisbus.core.files import load_dictionaries
from axisbus.drives.gim6010.cell import module_parameters
from axisbus.errors import ConfigError

CELL = """[bus]
interface = "sim"
scan_period = "10ms"
[nodes.40]
eds = "builtin:gim6010-8"
[nodes.16]
protocol = "can_simple"
firmware = "0.5.13"
[nodes.16.can_simple]
velocity_limit = 20.0
current_limit = 10.0
velocity_ramp = 40.0
acceleration = 80.0
gear_ratio = 8.0
torque_constant = 0.097
torque_ramp = 1.0
[axes.m]
node = 16
unit = "deg"
scale = "131072/360"
rated_torque = 5.0
[axes.m.stop]
quick_stop = "ramp-hold"
"""


@pytest.fixture
def cell(tmp_path):
    def write(old: str = "", new: str = ""):
        assert old in CELL
        (tmp_path / "cell.toml").write_text(CELL.replace(old, new) if old else CELL, "utf-8")
        return tmp_path / "cell.toml"

    return write


def errors(path) -> list[str]:
    return [str(problem) for problem in check(path) if problem.severity.value == "error"]


def test_a_module_is_read_with_its_settings(cell):
    found = reader.load(cell())
    node, axis = found.nodes[16], found.axes["m"]
    assert (node.protocol, node.firmware) == ("can_simple", "0.5.13")
    settings = node.module.settings(16, axis, found.bus.scan_period)
    assert (settings.node, settings.velocity_limit, settings.current_limit) == (16, 20.0, 10.0)
    assert (settings.velocity_ramp, settings.acceleration, settings.period) == (40.0, 80.0, 0.01)
    assert settings.torque.rated == pytest.approx(0.625)  # 5 N·m at the output
    assert settings.torque.constant == 0.097
    assert settings.quick_stop_holds
    assert settings.filter_bandwidth is None
    assert found.nodes[40].module is None


def test_a_module_without_rated_torque_has_no_torque_settings(cell):
    found = reader.load(cell())
    module, axis = found.nodes[16].module, replace(found.axes["m"], rated_torque=None)
    assert module.settings(16, axis, 0.01).torque is None
    assert module.settings(16, None, 0.01).torque is None
    assert not module.settings(16, None, 0.01).quick_stop_holds


@pytest.mark.parametrize("key", ["velocity_limit", "current_limit", "velocity_ramp", "acceleration"])
def test_required_values_are_never_guessed(cell, key):
    (line,) = [each for each in CELL.splitlines() if each.startswith(key)]
    with pytest.raises(ConfigError, match=key):
        reader.load(cell(line + "\n", ""))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('firmware = "0.5.13"\n', 'eds = "builtin:gim6010-8"\n', "has no eds"),
        ('firmware = "0.5.13"\n', 'remap = "never"\n', "has no remap"),
        ('protocol = "can_simple"\n', "", "does not use CAN Simple"),
        ('protocol = "can_simple"\n', 'protocol = "canopen"\n', "does not use CAN Simple"),
        ('protocol = "can_simple"\n', 'protocol = "modbus"\n', "protocol"),
        ("velocity_limit = 20.0", "velocity_limit = 0", "velocity_limit"),
        ("velocity_limit = 20.0", "velocity_limt = 20.0", "velocity_limt"),
    ],
)
def test_mistakes_are_reported_with_their_line(cell, old, new, words):
    with pytest.raises(ConfigError) as caught:
        reader.load(cell(old, new))
    assert words in str(caught.value)
    assert caught.value.line


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[nodes.40]", "[nodes.1]", "identifiers have two owners"),
        ("current_limit = 10.0", "current_limit = 60.0", "more than the module permits"),
        ('firmware = "0.5.13"', 'firmware = "new"', "is not a firmware version"),
        ("node = 16", "node = 16\ndrive_axis = 2", "a module with one axis"),
    ],
)
def test_a_check_finds_invalid_keys(cell, old, new, words):
    assert any(words in each for each in errors(cell(old, new)))


def test_two_owners_of_an_identifier_are_an_error_that_reports_a_free_node_id(cell):
    assert not any("two owners" in each for each in errors(cell()))
    (found,) = [each for each in errors(cell("[nodes.40]", "[nodes.1]")) if "two owners" in each]
    assert "free:" in found


def test_incomplete_keys_for_torques_are_reported(cell):
    warnings = [str(each) for each in check(cell("torque_ramp = 1.0\n", ""))]
    assert any("axis m has no torques" in each and "torque_ramp" in each for each in warnings)


def test_a_protocol_other_than_can_simple_is_suspected_from_its_first_firmware_on(cell):
    assert any("possibly does not use CAN Simple" in str(each) for each in check(cell("0.5.13", "0.6.8")))
    assert not any("possibly does not use CAN Simple" in str(each) for each in check(cell("0.5.13", "0.6.7")))


def test_a_can_simple_module_has_no_dictionary_and_is_described_by_its_port(cell):
    found = reader.load(cell())
    files = load_dictionaries(found)
    assert sorted(files) == [40]
    assert sorted(with_dictionaries(found, files)) == [16, 40]
    parameters = module_parameters(found, "m")
    # pp, pv, tq, hm, csp: the modes of the port; it has the objects of csv and cst too, and does not use these
    assert {int(mode) for mode in parameters.modes} == {1, 3, 4, 6, 8}
    assert parameters.quick_stop_holds
    assert parameters.limits.torque == 5.0
    assert parameters.torque_slope == round(1.0 / 0.625 * 1000)
    assert parameters.node == 16
    assert parameters.fault_objects[0] == (0x2F00, 1)
