"""A second master: opening a cell's bus listens first, and is refused where another master is at work; nothing was sent then."""

from __future__ import annotations

import threading
import time

import pytest

from axisbus.bus.link import detect_other_master
from axisbus.bus.node.events import NodeEvent, NodeEventKind
from axisbus.cell.model import BusConfig
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.master_detection import ExpectedMasters, MasterDetector
from axisbus.cia301.nmt import NmtState
from axisbus.clock import REAL
from axisbus.core import canlink
from axisbus.core.master_detection import LONGEST, listening_time
from axisbus.errors import BusError, LimitError, SecondMasterError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.cell import cell_text
from kit.plant_probe import ENABLED, OFF, QUICK_STOP
from kit.scenarios import other_master as others
from kit.scenarios.other_master import Ear, OtherMaster, RepeatedFrame
from kit.scenarios.simulated_bus import Line, enable, turning, until

ALL = {**others.SIGNS, **others.MASTERS}
QUICK = {
    "heartbeat": "100ms"
}  # it listens for 0.2 s; if a machine is opened then, it is as slow as in every scenario


# -- a second machine ----------------------------------------------------------------------------------------------------


def test_a_second_machine_is_refused_and_the_first_ones_motion_continues_undisturbed(tmp_path):
    with Line(tmp_path, "xyz") as line, line.open() as first:
        for axis in first:
            enable(axis)
        first["z"].move_velocity(60.0).wait(10)
        line.must_move("z")
        since = line.moment("z")
        with pytest.raises(SecondMasterError):
            line.open()
        line.run(0.5)
        speeds = line.speeds("z", since)
        assert min(speeds) > 59.0
        assert max(speeds) < 61.0
        line.must_be(ENABLED, "z")
        for name in "xy":  # at standstill before and after
            assert line.top_speed(name, since) == 0.0
            line.must_be(ENABLED, name)
        assert [axis.error for axis in first] == [None, None, None]
        first["x"].move_relative(30.0).wait(10)  # the first one still commands
        assert line.where("x") == pytest.approx(30.0, abs=0.5)
    for name in "xyz":
        line.must_be(OFF, name)


def test_two_attempts_at_once_to_open_a_running_machine_s_bus_are_both_refused(tmp_path):
    with Line(tmp_path, "xy") as line, line.open() as first:
        turning(first, line)
        since = line.moment()
        for _ in range(3):
            with pytest.raises(SecondMasterError):
                line.open()
        assert min(line.speeds(since=since)) > 80.0
        assert all(axis.error is None for axis in first)


def test_a_machine_that_was_closed_is_no_other_master(tmp_path):
    with Line(tmp_path, "x") as line:
        for _ in range(3):
            with line.open() as machine:
                enable(machine["x"])
                line.must_be(ENABLED)


def line_refused(line: Line, says: tuple[RepeatedFrame, ...]) -> list[str]:
    """Open beside another master, which must be refused; return the observed frames, without the numbers."""
    with OtherMaster(line.channel, says, 0.02), pytest.raises(SecondMasterError) as caught:
        line.open()
    return [text.partition(": ")[0] for text in caught.value.heard]


# -- received frames -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("who", ALL)
def test_another_master_is_detected_and_nothing_was_sent(tmp_path, who):
    with Line(tmp_path, "x", present="", **QUICK) as line, OtherMaster(line.channel, ALL[who]) as other:
        with Ear(line.channel) as ear, pytest.raises(SecondMasterError) as caught:
            line.open()
        assert ear.ids == {one.can_id for one in ALL[who]}
        assert len(ear.heard) <= other.counted
        for one in ALL[who]:
            hidden = one.can_id == 0x701 and not one.remote  # lely's own ID is 1, which is a drive here
            assert hidden or f"({one.can_id:03X}h)" in " ".join(caught.value.heard)


def test_the_drives_of_a_refused_cell_see_nothing(tmp_path):
    with Line(tmp_path, "xy") as line, OtherMaster(line.channel, others.SIGNS["a heartbeat of 127"]):
        since = line.moment()
        written = []
        for device in line.devices.values():
            device.write = lambda *arguments: written.append(arguments)
            device.nmt_command = lambda *arguments: written.append(arguments)
        with pytest.raises(SecondMasterError):
            line.open()
        line.run(0.3)
        assert written == []
        for name in "xy":
            assert not line.was_energised(name, since)


def test_our_own_node_id_counts_as_that_of_a_master(tmp_path):
    says = (RepeatedFrame(0x705, "05", every=2),)
    with Line(tmp_path, "x", bus="master_id = 5", **QUICK) as line:
        assert line_refused(line, says) == ["heartbeats of node 5 (705h)"]


@pytest.mark.parametrize("what", others.HARMLESS)
def test_slaves_and_listeners_are_no_master(tmp_path, what):
    with (
        Line(tmp_path, "x") as line,
        OtherMaster(line.channel, others.HARMLESS[what]),
        line.open() as machine,
    ):
        enable(machine["x"])
        line.must_be(ENABLED)


def test_a_drive_of_the_cell_with_id_127_is_no_master(tmp_path):
    text = cell_text("x", interface="virtual", channel="", bus="master_id = 5").replace(
        "nodes.1", "nodes.127"
    )
    with Line(tmp_path, "x", **QUICK) as line:
        cell = text.replace("node = 1\n", "node = 127\n").replace(
            'interface = "virtual"\n', f'interface = "virtual"\nchannel = "{line.channel}"\n'
        )
        line.file.write_text(cell, encoding="utf-8")
        heartbeat = others.SIGNS["a heartbeat of 127"]
        with OtherMaster(line.channel, heartbeat), pytest.raises(BusError) as caught:  # it answers no SDO
            line.open()
    assert not isinstance(caught.value, SecondMasterError)


def test_the_sync_of_another_device_is_no_sign_of_a_master_if_the_cell_file_allows_it(tmp_path):
    bus = 'sync_producer = "external"\nsync_timeout = "1s"'  # this computer may be late
    with (
        Line(tmp_path, "x", bus=bus) as line,
        OtherMaster(line.channel, (RepeatedFrame(0x80),), 0.02),
        line.open() as machine,
    ):
        enable(machine["x"])
        line.must_be(ENABLED)


def test_a_master_is_detected_next_to_the_sync_of_another_device(tmp_path):
    bus, says = 'sync_producer = "external"', (RepeatedFrame(0x80), RepeatedFrame(0x77F, "05"))
    with Line(tmp_path, "x", bus=bus, **QUICK) as line:
        assert line_refused(line, says) == ["heartbeats of node 127 (77Fh)"]


def test_sync_at_a_cob_id_other_than_that_of_the_cell_is_detected_at_both(tmp_path):
    bus, says = "sync_cob_id = 0x90", (RepeatedFrame(0x80), RepeatedFrame(0x90))
    with Line(tmp_path, "x", bus=bus, **QUICK) as line:
        assert line_refused(line, says) == ["SYNC (080h, 090h)"]


# -- in operation --------------------------------------------------------------------------------------------------------


def masters_in(machine: Machine) -> list[NodeEvent]:
    """The machine's events about another master."""
    return [one for one in machine.session.node_events if one.kind is NodeEventKind.MASTER]


@pytest.mark.parametrize("what", others.COMMANDS)
def test_axes_that_another_master_commands_are_stopped_and_it_is_an_event(tmp_path, what):
    says, names, words = others.COMMANDS[what]
    with Line(tmp_path, "xy") as line, line.open() as machine:
        turning(machine, line)
        assert masters_in(machine) == []
        with OtherMaster(line.channel, says, 0.005):
            for name in "xy":  # the fault policy stops the other one too
                line.must_be_still(name, stages=(ENABLED, QUICK_STOP, *OFF), within=1.5)
            until(lambda: all(machine[name].state is AxisState.ERRORSTOP for name in names))
        for name in names:
            assert isinstance(machine[name].error, SecondMasterError)
            assert words in str(machine[name].error)
        first, *_ = masters_in(machine)
        assert words in str(first)
        assert "stopped" in str(first)
        assert first.node == (0 if names == "xy" else "xy".index(names) + 1)


def test_an_axis_that_holds_its_power_after_an_error_is_stopped_by_a_quick_stop_first(scenario):
    cell = scenario.simulated("x", axis="position_limits = [-90.0, 90.0]").enabled()
    cell.x.move_velocity(100.0)
    cell.run(3.0)
    assert isinstance(cell.x.error, LimitError)
    assert cell.stage("x") == ENABLED
    adapter = cell.wire.connect()
    adapter.send(0x201, b"\x0f\x00")
    cell.run(1.0)
    assert cell.stage("x") in OFF
    assert cell.device("x").nmt is NmtState.OPERATIONAL
    assert "another master" in str(cell.x.error)


@pytest.mark.parametrize("what", others.ASIDE)
def test_frames_of_another_master_that_command_no_drive_are_an_event_and_stop_nothing(tmp_path, what):
    says, words = others.ASIDE[what]
    with Line(tmp_path, "xy") as line, line.open() as machine:
        turning(machine, line)
        since = line.moment()
        with OtherMaster(line.channel, says, 0.005):
            line.run(1.3)
        assert [axis.error for axis in machine] == [None, None]
        assert min(line.speeds(since=since)) > 80.0
        events = masters_in(machine)
        assert words in str(events[0])
        assert len(events) <= 3  # one at once, then one in a second
        assert sum(event.times for event in events) > 5


def test_with_beside_the_commands_of_another_master_are_events_and_stop_nothing(tmp_path):
    says = (RepeatedFrame(0x602, "23 81 60 00 00 10 00 00", every=20),)
    with Line(tmp_path, "xy", bus="beside = true") as line, line.open() as machine:
        turning(machine, line)
        with OtherMaster(line.channel, says, 0.005):
            line.run(0.5)
        assert machine["y"].error is None
        assert "opened in spite of it, and nothing is stopped" in str(masters_in(machine)[0])


def test_an_axis_that_another_master_has_never_seen_us_command_is_left_to_it(tmp_path):
    says = (RepeatedFrame(0x201, "06 00"),)
    with Line(tmp_path, "xy") as line, line.open() as machine:
        enable(machine["y"])
        with OtherMaster(line.channel, says, 0.005):
            until(lambda: bool(masters_in(machine)))
            line.run(0.3)
        assert machine["x"].error is None
        assert machine["y"].error is None


def test_our_own_frames_are_no_masters(tmp_path):
    bus = 'time = "100ms"\nsync_counter = 10'
    with Line(tmp_path, "xy", bus=bus) as line, line.open() as machine:
        turning(machine, line)
        machine.node(1).sdo[0x6081] = 4321
        machine["x"].halt().wait(10)
        machine["y"].disable().wait(10)
        assert masters_in(machine) == []


# -- opened all the same -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["the call", "the cell file"])
def test_beside_opens_the_bus_nevertheless(tmp_path, way):
    bus, says = "beside = true" if way == "the cell file" else "", others.SIGNS["a heartbeat of 127"]
    with Line(tmp_path, "x", bus=bus) as line, OtherMaster(line.channel, says):
        machine = Machine.open(line.file, allow_other_master=way == "the call")
        with machine:
            enable(machine["x"])
            machine["x"].move_relative(20.0).wait(10)
            assert line.where() == pytest.approx(20.0, abs=0.5)


def test_a_private_bus_with_our_own_simulated_drives_is_not_listened_to(scenario, monkeypatch):
    monkeypatch.setattr(canlink, "require_no_other_master", lambda *_: pytest.fail("listened"))
    cell = scenario.real("x").enabled()
    cell.must_be(ENABLED)


# -- the command line ----------------------------------------------------------------------------------------------------

BOOTING = {"boot": (), "move": ("x=5", "--relative"), "home": (), "reset": (), "monitor": ("--count", "1")}


@pytest.mark.parametrize("command", BOOTING)
def test_commands_that_boot_are_refused_without_beside_and_accepted_with_it(tmp_path, axisbus, command):
    with Line(tmp_path, "x") as line, OtherMaster(line.channel, others.SIGNS["a heartbeat of 127"]):
        before = line.where()
        code, _, told = axisbus(command, line.file, *BOOTING[command])
        assert code == 3
        assert "another master" in told
        assert "heartbeats of node 127 (77Fh)" in told
        assert line.where() == before
        assert line.stage() in OFF
        code, _, told = axisbus(command, line.file, "--beside", *BOOTING[command])
        assert code == 0, told
        assert line.where() == pytest.approx(5.0 if command == "move" else before, abs=0.1)


def test_stop_is_never_refused(tmp_path, axisbus):
    with Line(tmp_path, "xy") as line:
        machine = line.open()
        try:
            turning(machine, line)
            code, told, _ = axisbus("stop", line.file)
            assert code == 0, told
            for name in "xy":
                line.must_be_still(name, stages=(5, *OFF), within=1.0)
        finally:
            machine._close("the scenario ends")


@pytest.mark.parametrize(
    "command", [("trace", "--seconds", "0.3"), ("load", "--seconds", "0.3", "-b", "1000000")]
)
def test_commands_that_only_listen_are_not_refused(tmp_path, axisbus, command):
    name, *options = command
    with Line(tmp_path, "x", present="") as line, OtherMaster(line.channel, others.MASTERS["lely"]):
        code, told, errors = axisbus(name, line.file, *options)
        assert code == 0, errors
        assert "SYNC" in told


# -- messages ------------------------------------------------------------------------------------------------------------


def test_the_refusal_lists_the_received_frames_the_unknowns_and_the_remedy(golden):
    signs = MasterDetector(ExpectedMasters(frozenset({1, 2, 3}), frozenset({127})))
    for tick in range(50):
        now = 100.002 + tick * 0.004
        signs.note(CanFrame(now, 0x80))
        for node in (1, 2, 3):
            signs.note(CanFrame(now, 0x200 + node, b"\x0f\0"))
            signs.note(CanFrame(now, 0x300 + node, b"\0\0\0\0"))
        if tick in (10, 35):
            signs.note(CanFrame(now, 0x77F, b"\x05"))
    signs.note(CanFrame(100.1, 0x603, bytes(8)))
    signs.note(CanFrame(100.15, 0x000, b"\x01\0"))
    golden("second_master", detect_other_master.refusal("socketcan:can0", signs.heard, 100.0, 0.2))


def test_a_tool_is_reported_with_its_frames(golden):
    signs = MasterDetector(ExpectedMasters(frozenset({1}), frozenset({127})))
    signs.note(CanFrame(7.05, 0x601, bytes.fromhex("40 41 60 00 00 00 00 00")))
    golden("second_master_tool", detect_other_master.refusal("pcan:PCAN_USBBUS1", signs.heard, 7.0, 0.2))


# -- how long ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heartbeat", "scan", "seconds"),
    [
        (0.1, 0.004, 0.2),
        (0.2, 0.01, 0.4),
        (1.0, 0.004, 0.5),
        (None, 0.004, 0.5),
        (0.01, 0.2, 0.4),
        (0.001, 0.001, 0.1),
    ],
)
def test_listening_for_another_master_takes_two_heartbeats_and_two_cycles_at_most_half_a_second(
    heartbeat, scan, seconds
):
    assert listening_time(BusConfig(heartbeat=heartbeat, scan_period=scan)) == pytest.approx(seconds)
    assert seconds <= LONGEST


def test_ctrl_c_while_listening_for_another_master_leaves_nothing_behind(tmp_path, monkeypatch):
    def interrupted(_: float) -> None:
        raise KeyboardInterrupt

    before = set(threading.enumerate())
    with Line(tmp_path, "x", present="") as line, Ear(line.channel) as ear:
        with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
            patched.setattr(REAL, "sleep", interrupted)
            line.open()
        ear.take()
        assert ear.heard == []
        left = [thread for thread in threading.enumerate() if thread not in before]
        assert not [thread for thread in left if "receive" in thread.name]


def test_a_quiet_bus_costs_no_more_than_that(tmp_path):
    with Line(tmp_path, "x", present="") as line:
        from axisbus.bus.link.channel import Channel

        with Channel.open("virtual", line.channel) as channel:
            begin = time.monotonic()
            detect_other_master.require_no_other_master(
                channel, ExpectedMasters(frozenset({1}), frozenset({127})), 0.2
            )
            assert 0.2 <= time.monotonic() - begin < 0.5
            assert channel.counters.sent == 0
