"""``axisbus monitor --listen``: the state of the bus from received frames, with or without a running master; nothing is sent."""

from __future__ import annotations

import json
import re
import threading

import pytest
from can.interfaces.virtual import VirtualBus

from axisbus.bus.link import adapter
from axisbus.machine.machine import Machine
from kit.cell import cell_text
from kit.command_line import Result
from kit.plant_probe import ENABLED
from kit.scenarios import other_master as others
from kit.scenarios.other_master import Ear, OtherMaster, RepeatedFrame
from kit.scenarios.simulated_bus import Line, enable


@pytest.fixture
def monitor(axisbus, monkeypatch):
    """Type ``axisbus monitor CELL --listen``, which must send no frame; returns exit code, output and errors."""
    send = VirtualBus.send

    def guarded(bus: VirtualBus, *arguments: object) -> None:
        assert threading.current_thread() is not threading.main_thread(), "the listener has sent a frame"
        send(bus, *arguments)

    def call(line: Line, *options: object) -> Result:
        with monkeypatch.context() as patched:
            patched.setattr(VirtualBus, "send", guarded)
            patched.setattr(Machine, "open", lambda *_, **__: pytest.fail("booted"))
            return axisbus("monitor", line.file, "--listen", "--every", "0.4", "--count", "1", *options)

    return call


def test_a_silent_bus_stays_silent(tmp_path, monitor):
    with Line(tmp_path, "xy") as line, Ear(line.channel) as ear:
        code, told, _ = monitor(line)
        ear.take()
        assert ear.heard == []
    assert code == 0
    assert "nothing was heard" in told
    assert "1 x        nothing heard" in told


def test_monitor_with_beside_shows_the_axes_of_a_running_machine_and_disturbs_nothing(tmp_path, monitor):
    with Line(tmp_path, "xy") as line, line.open() as machine:
        for axis in machine:
            enable(axis)
        machine["x"].move_velocity(90.0).wait(10)
        since = line.moment()
        code, told, _ = monitor(line, "--every", "1.2")
        speeds = line.speeds(since=since)
        assert min(speeds) > 85.0
        assert max(speeds) < 95.0
        line.must_be(ENABLED, "y")
        assert all(axis.error is None for axis in machine)
    assert code == 0
    assert re.search(r"SYNC every (19|2\d)\.\d ms", told)
    assert "a master sends heartbeats of node 127 (77Fh), SYNC (080h), RPDOs to nodes 1, 2" in told
    assert "1 x        operational; heartbeat every " in told
    assert "> RPDO1: Controlword 0x000F (enable operation)" in told
    assert "Velocity actual value 9000 = 90 deg/s" in told
    assert "127 master operational; heartbeat every " in told


def test_every_frame_on_the_bus_belongs_to_others(tmp_path, monitor):
    with Line(tmp_path, "x", present="") as line, Ear(line.channel) as ear:
        with OtherMaster(line.channel, others.MASTERS["CODESYS"]) as other:
            code, told, _ = monitor(line)
        ear.take()
        assert len(ear.heard) == other.counted
    assert code == 0
    assert "a master sends heartbeats of node 127 (77Fh), SYNC (080h), node guarding requests" in told


def test_events_since_the_last_refresh_are_reported_as_news(tmp_path, monitor):
    says = (
        RepeatedFrame(0x081, "20 43 08 00 00 00 00 00", every=8),
        RepeatedFrame(0x000, "80 01", every=8),
        RepeatedFrame(0x701, "7F", every=5),
        RepeatedFrame(0x732, "05", every=5),
        RepeatedFrame(0x123, "01 02"),
    )
    with Line(tmp_path, "x", present="") as line, OtherMaster(line.channel, says):
        code, told, _ = monitor(line)
    assert code == 0
    assert "!! 1 x EMCY: 0x4320" in told
    assert "!! > 1 x NMT: enter pre-operational: node 1 (x)" in told
    assert "1 x        pre-operational; heartbeat every" in told
    assert "\n50         operational; heartbeat every" in told  # a node of no cell
    assert "frames of no known service" in told


def test_as_json_one_value_per_look(tmp_path, monitor):
    with Line(tmp_path, "x", present="") as line, OtherMaster(line.channel, others.MASTERS["ros2_canopen"]):
        code, told, _ = monitor(line, "--json")
    look = json.loads(told)
    assert code == 0
    assert look["sync"]["period"] == pytest.approx(0.01, abs=0.005)
    assert look["master"][0].startswith("SYNC (080h): ")
    (node,) = [each for each in look["nodes"] if each["node"] == 1]
    assert node["newest"]["RPDO1"]["count"] > 10
    assert node["state"] is None


def test_a_simulated_cell_can_be_listened_to(scenario, axisbus):
    file = scenario.file(cell_text("x"))
    code, out, _ = axisbus("monitor", file, "--listen", "--every", "0.3", "--count", "1")
    assert code == 0
    assert "!! 1 x boot-up: boot-up: enters pre-operational" in out


def test_listening_does_not_need_beside(tmp_path, monitor):
    with Line(tmp_path, "x", present="") as line:
        code, _, told = monitor(line, "--beside")
    assert code == 2
    assert "--beside" in told


@pytest.mark.parametrize(
    ("interface", "key"),
    [("slcan", "listen_only"), ("pcan", "state"), ("systec", "state"), ("cantact", "monitor")],
)
def test_an_adapter_that_supports_listen_only_is_opened_so(tmp_path, axisbus, monkeypatch, interface, key):
    asked = {}

    def opening(name, channel, bitrate, options):
        asked.update(options)
        return adapter.can.Bus(interface="virtual", channel="listen-only")

    monkeypatch.setattr(adapter, "open_adapter", opening)
    with Line(tmp_path, "x", present="") as line:
        text = line.file.read_text(encoding="utf-8").replace('"virtual"', f'"{interface}"')
        line.file.write_text(text.replace("scan_period", "bitrate = 500000\nscan_period"), encoding="utf-8")
        code, out, _ = axisbus("monitor", line.file, "--listen", "--every", "0.02", "--count", "1")
    assert code == 0
    assert asked[key] == adapter.silent(interface, {})[key]
    assert "does not even acknowledge" in out


def test_options_of_the_user_for_the_adapter_are_kept():
    assert adapter.silent("slcan", {"listen_only": False, "tty_baudrate": 9600}) == {
        "listen_only": False,
        "tty_baudrate": 9600,
    }
    assert adapter.silent("socketcan", {}) == {}
