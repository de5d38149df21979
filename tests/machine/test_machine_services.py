"""SYNC, TIME, PDO tables and emergency messages of whole simulated cells: the settings of boot-up, and the traffic on the bus."""

from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import can
import pytest

from axisbus import Machine, eds
from axisbus.bus.pdo.tpdo_timeout import Reception
from axisbus.check.run import check
from axisbus.cia301.incident import IncidentState
from axisbus.cli.monitor import axes as monitor
from axisbus.errors import BootError, ScanError, SyncError
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device

SOURCE = (Path(__file__).parents[2] / "eds" / "generic-cia402.eds").read_text()
ADDED = """
[1012]
ParameterName=COB-ID time stamp object
ObjectType=7
DataType=7
AccessType=rw
DefaultValue=0x100

[1019]
ParameterName=Synchronous counter overflow value
ObjectType=7
DataType=5
AccessType=rw
DefaultValue=0
"""
CELL = """
[bus]
interface = "sim"
scan_period = "50ms"
{bus}
[nodes.3]
eds = "drive.eds"
{node}
[axes.x]
node = 3
unit = "deg"
scale = 100
[axes.x.defaults]
velocity = 50.0
acceleration = 500.0
[axes.x.stop]
quick_stop = "ramp"
deceleration = 900.0
{more}
"""
PRODUCER = """
[nodes.4]
eds = "drive.eds"
[nodes.4.objects]
"1006" = 50000
"1005" = 0x40000080
"""
EXTERNAL = 'sync_producer = "external"\nsync_timeout = "5s"'


def write(folder: Path, bus: str = "", node: str = "", more: str = "", source: str = SOURCE + ADDED) -> Path:
    (folder / "drive.eds").write_text(source)
    path = folder / "cell.toml"
    path.write_text(CELL.format(bus=bus, node=node, more=more))
    return path


def device(folder: Path, **objects: int) -> Device:
    made = device_from_eds(eds.load(folder / "drive.eds"), 3)
    for key, value in objects.items():
        made.write(int(key[1:], 16), 0, value)
    return made


def eventually(condition, seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "did not happen in time"
        time.sleep(0.005)


# -- settings of boot-up (virtual time) ----

SETTINGS = [
    ("", {}, {0x1005: 0x80, 0x1019: 0, 0x1012: 0x100}),
    ("sync_cob_id = 0x90\nsync_counter = 10", {}, {0x1005: 0x90, 0x1019: 10, 0x1012: 0x100}),
    ("", {"x1019": 7}, {0x1019: 0}),  # left behind by another master
    ("", {"x1005": 0x4000_0080}, {0x1005: 0x80}),  # it sent SYNC: now we do
    ("sync_cob_id = 0x90", {"x1005": 0x4000_0080}, {0x1005: 0x90}),
    (EXTERNAL, {"x1005": 0x4000_0080}, {0x1005: 0x4000_0080}),  # it may be the one that sends
    (EXTERNAL + "\nsync_cob_id = 0x90", {"x1005": 0x4000_0080}, {0x1005: 0x4000_0090}),
    ('time = "1s"', {}, {0x1012: 0x8000_0100}),
    ('time = "1s"\ntime_cob_id = 0x190', {"x1012": 0xC000_0100}, {0x1012: 0x8000_0190}),
    ("sync = false", {"x1005": 0x90}, {0x1005: 0x90}),
]


@pytest.mark.parametrize(("bus", "before", "after"), SETTINGS)
def test_boot_reports_each_node_which_sync_and_time_the_bus_has(
    tmp_path: Path, bus: str, before: dict[str, int], after: dict[int, int]
) -> None:
    path = write(tmp_path, bus)
    made = device(tmp_path, **before)
    with Machine.simulated(path, {3: made}):
        assert {index: made.read(index) for index in after} == after


def test_a_sync_counter_that_1006h_locks_is_nevertheless_set(tmp_path: Path) -> None:
    """CiA 301 7.5.2.22: 1019h is refused while 1006h is not 0."""
    path = write(tmp_path, "sync_counter = 10")
    made = device(tmp_path, x1006=20_000)
    made.dictionary.check_write(0x1019 << 8, lambda _: _locked(made))
    with Machine.simulated(path, {3: made}):
        assert (made.read(0x1019), made.read(0x1006)) == (10, 20_000)


def _locked(made: Device) -> None:
    from axisbus.sim.dictionary import DEVICE_STATE, Refused

    if made.read(0x1006):
        raise Refused(DEVICE_STATE)


@pytest.mark.parametrize(
    ("bus", "window", "warned"),
    [
        ("", 200, True),
        ("", 1_999, True),  # RPDOs may come 2 ms after SYNC
        ("", 2_000, False),
        ("", 0, False),  # no window
        ("sync = false", 200, False),
        (EXTERNAL, 1_999, True),
        (EXTERNAL, 2_000, False),
    ],
)
def test_a_window_that_closes_before_our_rpdos_are_sent_is_reported(
    tmp_path: Path, bus: str, window: int, warned: bool
) -> None:
    path = write(tmp_path, bus)
    made = device(tmp_path, x1007=window)
    with Machine.simulated(path, {3: made}) as machine:
        told = [each for each in machine.reports[0].warnings if "1007h" in each]
    assert len(told) == warned
    if warned:
        assert f"closes {window} µs after SYNC, and they may come 2000 µs after it" in told[0]
        assert 'write "1007" = 0 in [nodes.3.objects]' in told[0]
    path = write(tmp_path, bus, f'[nodes.3.objects]\n"1007" = {window}')
    assert len([each for each in check(path) if "synchronous RPDOs" in each.message]) == warned


def test_a_node_whose_sync_cannot_be_set_is_a_boot_error_that_names_it(tmp_path: Path) -> None:
    path = write(tmp_path, "sync_cob_id = 0x90")
    made = device(tmp_path)
    made.dials.sdo_write_aborts[0x1005, 0] = 0x0601_0002
    with pytest.raises(BootError, match="node 3: it does not receive the bus's SYNC") as raised:
        Machine.simulated(path, {3: made})
    assert "1005h is 0x80, SYNC has COB-ID 0x90" in raised.value.observed


# -- on the bus, in real time


def test_an_axis_moves_by_a_sync_of_another_identifier_with_a_counter(tmp_path: Path) -> None:
    path = write(tmp_path, 'sync_cob_id = 0x90\nsync_counter = 240\ntime = "50ms"')
    with Machine.open(path) as machine:
        x = machine["x"]
        x.enable().wait(20)
        x.move_relative(5.0).wait(20)
        assert list(machine.node(3).emcy) == []  # no 8240h: the length of SYNC is that of 1019h


def test_the_sync_of_another_device_drives_the_scan_and_its_silence_stops_the_axis(tmp_path: Path) -> None:
    """Node 4 sends SYNC every 50 ms; when it no longer does, the axis is stopped and disabled without SYNC."""
    path = write(tmp_path, 'sync_producer = "external"\nsync_timeout = "2s"', more=PRODUCER)
    machine = Machine.open(path)
    drive = machine.simulated_node(3).drive()
    try:
        x = machine["x"]
        x.enable().wait(30)
        x.move_relative(2.0).wait(30)
        handle = x.move_velocity(20.0)
        eventually(lambda: abs(drive.velocity) > 100)
        with machine.simulated_node(4).lock:
            machine.simulated_node(4).device.dictionary.write(0x1005, 0, 0x80)
        eventually(lambda: machine._core.scan.ended, 20)
        assert isinstance(machine._core.scan.failure, SyncError)
        assert isinstance(handle.exception(), ScanError)
        eventually(lambda: abs(drive.velocity) < 1)
    finally:
        with pytest.raises(ScanError, match="SYNC"):
            machine.close()
    assert drive.statusword & 0x6F != 0x27


def test_without_the_other_producer_nothing_begins(tmp_path: Path) -> None:
    path = write(tmp_path, EXTERNAL)
    with pytest.raises(SyncError, match="no steady SYNC on 080h, which another device must send"):
        Machine.open(path)


TABLES = """
[nodes.3.pdo.rpdo1]
map = ["0005", "6040", "6060/8", "607A:00/32"]
[nodes.3.pdo.tpdo1]
map = ["6041", "6061", "6064"]
transmission = 1
[nodes.3.pdo.tpdo2]
map = ["606C"]
transmission = 2
[nodes.3.pdo.tpdo3]
map = ["6077"]
transmission = 0
[nodes.3.pdo.tpdo4]
map = ["6062"]
transmission = 254
event_timer = "100ms"
"""


def test_tables_with_dummies_sizes_and_every_kind_of_transmission_are_set_and_used(tmp_path: Path) -> None:
    path = write(tmp_path, node=TABLES)
    with Machine.open(path) as machine:
        made = machine.simulated_node(3).device
        mapped = [made.read(0x1600, sub) for sub in range(1, made.read(0x1600) + 1)]
        assert mapped == [0x0005_0008, 0x6040_0010, 0x6060_0008, 0x607A_0020]
        assert [made.read(0x1800 + number, 2) for number in range(4)] == [1, 2, 0, 254]
        machine["x"].enable().wait(20)
        machine["x"].move_relative(3.0).wait(20)
        words = "\n".join(machine.node(3).pdos())
        assert "TPDO2 283h with SYNC (type 2)" in words
        assert "TPDO3 383h with SYNC (type 0)" in words
        assert "TPDO4 483h on change (type 254) and every 100 ms" in words


def test_mapping_objects_typed_array_make_no_difference(tmp_path: Path) -> None:
    """CiA 301 calls them RECORDs of type 21h; files that say ARRAY are common."""
    source = SOURCE + ADDED
    for index in ("1600", "1601", "1A00", "1A01"):
        begin = source.index(f"[{index}]\n")
        end = source.index("\n\n", begin)
        source = source[:begin] + source[begin:end].replace("ObjectType=0x9", "ObjectType=0x8") + source[end:]
    assert source.count("ObjectType=0x8") >= 4
    path = write(tmp_path, source=source)
    with Machine.open(path) as machine:
        machine["x"].enable().wait(20)
        machine["x"].move_relative(3.0).wait(20)
        assert "TPDO1 183h with SYNC (type 1): 6041:00/16 statusword" in "\n".join(machine.node(3).pdos())


# -- deadlines and incidents


def test_a_tpdo_that_stops_is_reported_and_its_values_do_not_count_as_fresh(tmp_path: Path) -> None:
    with Machine.open(write(tmp_path)) as machine:
        machine["x"].enable().wait(20)
        node = machine.node(3)
        with machine.simulated_node(3).lock:
            machine.simulated_node(3).device.dials.tpdos_stop = frozenset({1, 2, 3, 4})
        eventually(lambda: [event for event in node.pdo_events if event.what is Reception.MISSING])
        eventually(lambda: machine["x"].snapshot.position is None)
        texts = [str(event) for event in node.pdo_events]
        assert any(
            text.startswith("node 3: TPDO1 (183h) no longer comes: the last one is ") for text in texts
        )
        with machine.simulated_node(3).lock:
            machine.simulated_node(3).device.dials.tpdos_stop = frozenset()
        eventually(lambda: [event for event in node.pdo_events if event.what is Reception.RETURNED])
        eventually(lambda: machine["x"].snapshot.position is not None)


def test_a_fault_and_its_reset_are_an_incident_and_an_entry_in_1003h(tmp_path: Path) -> None:
    with Machine.open(write(tmp_path)) as machine:
        node, x = machine.node(3), machine["x"]
        assert node.incidents == ()
        x.enable().wait(20)
        machine.simulated_node(3).fault(0x2310, maker_bits=0x1234)
        eventually(lambda: node.incidents)
        eventually(lambda: x.snapshot.error is not None)
        (incident,) = node.incidents
        assert (incident.codes, incident.outcome) == ((0x2310,), IncidentState.UNRESOLVED)
        history = node.error_history()
        assert history is not None
        assert (history[0].number, history[0].code, history[0].additional) == (1, 0x2310, 0x1234)
        assert node.format_error_history()[0].startswith("1. 0x2310, ")
        head, first = monitor.histories(machine)
        assert head == "node 3, earlier errors (1003h), the newest first:"
        assert first.startswith("  1. 0x2310, ")
        x.reset().wait(20)
        eventually(lambda: node.incidents[0].outcome is IncidentState.RECOVERED)
        words = node.format_incident(node.incidents[0])
        assert words[0].startswith("incident 1: recovered after ")
        assert "0x2310" in words[1]
        assert "error register: generic error, current" in words[1]
        assert "error reset" in words[2]


def test_a_node_without_1003h_is_reported(tmp_path: Path) -> None:
    path = write(tmp_path)
    made = device(tmp_path)
    made.dials.sdo_aborts[0x1003, 0] = 0x0602_0000
    with Machine.simulated(path, {3: made}) as machine:
        assert machine.node(3).error_history() is None
        assert "no 1003h" in machine.node(3).format_error_history()[0]


def incident_lines(machine: Machine, told: set[str]) -> list[str]:
    """The output of monitor, without PDOs that a busy computer may have missed."""
    return [line for line in monitor.new_lines(machine, told) if "TPDO" not in line]


def test_monitor_reports_an_incident_once_and_again_when_it_changes(tmp_path: Path) -> None:
    with Machine.open(write(tmp_path)) as machine:
        told: set[str] = set()
        machine["x"].enable().wait(20)
        assert incident_lines(machine, told) == []
        machine.simulated_node(3).fault(0x2310)
        eventually(lambda: machine.node(3).incidents)
        eventually(lambda: machine["x"].snapshot.error is not None)
        first, fault, *_ = incident_lines(machine, told)
        assert first.startswith("node 3, incident 1: unresolved, ")
        assert "0x2310" in fault
        assert incident_lines(machine, told) == []
        machine["x"].reset().wait(20)
        eventually(lambda: machine.node(3).incidents[0].outcome is IncidentState.RECOVERED)
        assert incident_lines(machine, told)[0].startswith("node 3, incident 1: recovered after")
        (one,) = monitor.of_node(machine, machine["x"])["incidents"]
        assert (one["outcome"], one["codes"]) == ("recovered", ["0x2310"])


def test_time_of_another_device_is_known_to_the_machine(tmp_path: Path) -> None:
    """Day 15000 after 1 January 1984 is 25 January 2025; one hour after midnight."""
    with Machine.open(write(tmp_path)) as machine:
        assert machine.bus_time is None
        network = machine._core.scan.cycle._channel.network  # type: ignore[attr-defined]
        with can.Bus(interface="virtual", channel=network.bus.channel_id) as other:
            other.send(
                can.Message(arbitration_id=0x100, data=bytes.fromhex("80ee3600983a"), is_extended_id=False)
            )
            eventually(lambda: machine.bus_time is not None)
        moment = machine.bus_time
        assert moment is not None
        assert timedelta(0) <= moment - datetime(2025, 1, 25, 1, tzinfo=UTC) < timedelta(minutes=1)
