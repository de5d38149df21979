"""Errors before any motion: files, devices, and missing answers on the bus."""

from __future__ import annotations

import re
import threading
import time

import pytest

from axisbus import eds
from axisbus.core import canlink
from axisbus.eds.builtin import resolve
from axisbus.errors import BootError, ConfigError
from axisbus.machine.machine import Machine
from axisbus.sim.build import device_from_eds
from kit.cell import GENERIC, cell_text
from kit.plant_probe import OFF
from kit.scenarios.simulated_bus import Line, enable

PNG = (
    b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x00\x10\x00\x00\x00\x10\x08\x06\x00\x00\x00\x1f\xf3\xffa"
    + bytes(range(256))
)

FILES = {
    "missing": None,
    "png": PNG,
    "empty": b"",
    "text": b"This is a letter to my aunt.\n",
    "half": b"[FileInfo]\nFileName=half.eds\n[DeviceInfo]\nVendorName=nobody\n[1000]\nParameterName=Device ty",
}
OPENERS = {"open": Machine.open, "simulated": Machine.simulated}


@pytest.fixture
def impatient(monkeypatch):
    """Nodes that are not there are given up soon."""
    monkeypatch.setattr(canlink, "FIND_TIME", 0.8)


# -- files ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("opener", OPENERS)
@pytest.mark.parametrize("name", FILES)
def test_an_eds_that_cannot_serve_is_named_with_file_and_line(tmp_path, golden, name, opener):
    if FILES[name] is not None:
        (tmp_path / "drive.eds").write_bytes(FILES[name])
    (tmp_path / "cell.toml").write_text(cell_text("x", eds="drive.eds"), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        OPENERS[opener](tmp_path / "cell.toml")
    golden(f"eds_{name}", caught.value)


@pytest.mark.parametrize("opener", OPENERS)
def test_a_cell_file_that_is_missing_is_named(tmp_path, golden, opener):
    with pytest.raises(ConfigError) as caught:
        OPENERS[opener](tmp_path / "cell.toml")
    golden("cell_missing", caught.value)


def eds_of_maker(folder, vendor: int) -> None:
    """Write the generic drive's EDS as that of another maker: 1018h:01."""
    text = resolve(GENERIC, folder).read_text(encoding="ascii")
    head, section, tail = text.partition("[1018sub1]")
    tail = re.sub(r"DefaultValue=\S*", f"DefaultValue=0x{vendor:08X}", tail, count=1)
    (folder / "drive.eds").write_text(head + section + tail, encoding="ascii")


def test_an_eds_for_another_device_is_reported_by_both_identities(tmp_path, golden):
    eds_of_maker(tmp_path, 0x123)
    with Line(tmp_path, eds="drive.eds") as line:  # these are its devices
        eds_of_maker(tmp_path, 0x456)
        with pytest.raises(BootError) as caught:
            line.open()
        assert line.stage() in OFF
    golden("eds_of_another_device", caught.value)


def test_an_eds_for_another_device_is_reported_in_virtual_time_too(scenario, golden):
    eds_of_maker(scenario.folder, 0x123)
    other = device_from_eds(eds.load(scenario.folder / "drive.eds"), 1)
    eds_of_maker(scenario.folder, 0x456)
    with pytest.raises(BootError) as caught:
        scenario.simulated("x", eds="drive.eds", devices=lambda: {1: other})
    golden("eds_of_another_device", caught.value)


# -- answering nodes -----------------------------------------------------------------------------------------------------


def test_no_node_answers(tmp_path, golden, impatient):
    with Line(tmp_path, "xy", present="") as line, pytest.raises(ExceptionGroup) as caught:
        line.open()
    assert [type(error) for error in caught.value.exceptions] == [BootError, BootError]
    assert [error.node for error in caught.value.exceptions] == [1, 2]
    golden("nobody_answers", caught.value)


def test_an_opening_with_one_of_three_nodes_missing_is_a_boot_error(tmp_path, golden, impatient):
    with Line(tmp_path, "xyz", present="xz") as line:
        with pytest.raises(BootError) as caught:
            line.open()
        assert line.stage("x") in OFF
        assert line.stage("z") in OFF
    assert caught.value.node == 2
    golden("one_of_three_missing", caught.value)


def test_an_opening_with_one_of_three_nodes_missing_in_virtual_time_is_a_boot_error(scenario, golden):
    def two_alive():
        devices = {
            node: device_from_eds(eds.load(resolve(GENERIC, scenario.folder)), node) for node in (1, 2, 3)
        }
        devices[2].dials.dead = True
        return devices

    with pytest.raises(BootError) as caught:
        scenario.simulated("xyz", devices=two_alive)
    golden("one_of_three_missing_simulated", caught.value)


def test_a_node_that_answers_sdo_after_the_client_gave_up_is_no_mix_up(tmp_path, golden, impatient):
    """Every answer comes 0.7 s late, after the 0.5 s that a transfer waits: it must not pass for the answer to the next one."""
    with Line(tmp_path) as line:
        line.devices["x"].dials.sdo_delay = 0.7
        with pytest.raises(BootError) as caught:
            line.open()
    golden("answers_too_late", caught.value)


def test_a_node_that_appears_while_it_is_awaited_is_booted(tmp_path):
    with Line(tmp_path) as line:
        line.devices["x"].dials.dead = True
        threading.Timer(0.8, lambda: setattr(line.devices["x"].dials, "dead", False)).start()
        with line.open() as machine:
            enable(machine["x"])
            machine["x"].move_relative(2.0).wait(10)


def test_late_heartbeats_within_the_limit_end_no_motion(tmp_path):
    with Line(tmp_path, heartbeat="400ms") as line, line.open() as machine:
        enable(machine["x"])
        monitor = machine.node(1)._node.nmt
        handle = machine["x"].move_relative(150.0)
        for _ in range(2):
            assert monitor.wait_report(monitor.reports, 5.0)
            line.devices["x"].dials.heartbeat_stops = True
            # The beat after 400 ms is left out; the one after 800 ms is in time, the limit is 1.2 s.
            time.sleep(0.5)
            line.devices["x"].dials.heartbeat_stops = False
        handle.wait(10)


def test_a_refused_configuration_names_object_line_and_abort_code(tmp_path, golden):
    with Line(tmp_path) as line:
        line.devices["x"].dials.sdo_write_aborts[0x605A, 0] = 0x0609_0030
        with pytest.raises(BootError) as caught:
            line.open()
    golden("configuration_refused", caught.value)
