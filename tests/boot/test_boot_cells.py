"""Boot-up and direct access on simulated cells: values written, read back, reported, refused and restored."""

import itertools
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from axisbus import Machine, Recorder, eds
from axisbus.boot.configure import DriveMonitoringSetup
from axisbus.boot.node import NodeBoot
from axisbus.boot.stop_report import NO_WATCHDOG, Watchdog, stop_sequence_report
from axisbus.cell.reader import load as load_cell
from axisbus.cell.scale_proposal import compare
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.core import canlink
from axisbus.errors import ArgumentError, BootError, LimitError, SdoAbort, StateError
from axisbus.motion.parameters import HoldsLoad, StopTimes
from axisbus.sim.build import device_from_eds
from axisbus.units import Scale

ROOT = Path(__file__).parents[2]
GENERIC = eds.load(ROOT / "eds" / "generic-cia402.eds")
CELL = """
[bus]
interface = "sim"
scan_period = "5ms"
[nodes.3]
eds = "builtin:generic-cia402"
[nodes.3.objects]
"6065" = 3000
[axes.x]
node = 3
unit = "deg"
scale = 100
[axes.x.defaults]
velocity = 50.0
acceleration = 500.0
[axes.x.stop]
quick_stop = "ramp-hold"
deceleration = 900.0
"""


def cell(folder, *changes):
    text = CELL
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "cell.toml"
    path.write_text(text)
    return path


def device(**objects):
    made = device_from_eds(GENERIC, 3)
    for key, value in objects.items():
        made.write(int(key[1:], 16), 0, value)
    return made


def simulated(path, made=None):
    return Machine.simulated(path, {3: made} if made is not None else None)


def test_values_of_the_cell_file_are_written_into_the_drive(tmp_path):
    made = device()
    with simulated(cell(tmp_path), made):
        assert made.read(0x6065) == 3000
        assert made.read(0x605A) == 6
        assert made.read(0x6085) == 90000
        assert made.read(0x1016, 1) == 127 << 16 | 300
        assert made.read(0x1017) == 100


def test_monitoring_that_boot_armed_is_restored(tmp_path):
    made = device()
    with simulated(cell(tmp_path), made):
        pass
    assert made.read(0x1016, 1) == 0


def test_a_watchdog_left_behind_by_a_killed_program_is_taken_over_and_then_disarmed(tmp_path):
    made = device()
    made.write(0x1016, 1, 127 << 16 | 9999)
    with simulated(cell(tmp_path), made):
        assert made.read(0x1016, 1) == 127 << 16 | 300
    assert made.read(0x1016, 1) == 0


def test_the_modes_are_those_that_objects_and_the_drives_own_6502h_show(tmp_path):
    made = device()
    key = 0x6502 << 8
    made.dictionary.live[key] = lambda: 0x61  # pp, hm, ip
    with simulated(cell(tmp_path), made) as machine:
        report = machine.reports[0]
        assert report.axes[0].modes == ("pp", "hm")
        assert report.axes[0].mode_doubts == (
            "6502h lists ip, but 60C1h is missing",
            "objects of pv, tq, csp, csv, cst are present, but 6502h does not list them: not used unless modes = [...] "
            "names it",
        )
        assert "6502h lists ip, but 60C1h is missing" in report.text()


def test_a_drive_that_refuses_to_monitor_the_master_is_reported_with_object_and_abort_code(tmp_path):
    made = device()
    made.dials.sdo_write_aborts[0x1016, 1] = 0x0604_0043
    for number in range(4):
        made.dials.sdo_write_aborts[0x1400 + number, 5] = 0x0601_0002
    with simulated(cell(tmp_path), made) as machine:
        report = machine.reports[0]
        assert report.watchdog.kind is Watchdog.NONE
        assert "1016h:01 = 0x7F012C (abort code 0x06040043)" in report.watchdog.text
        assert report.watchdog.text in report.warnings


def test_a_heartbeat_consumer_entry_of_another_producer_is_kept(tmp_path):
    made = device()
    entries = made.read(0x1016, 0)
    made.write(0x1016, 1, 5 << 16 | 500)
    with simulated(cell(tmp_path), made) as machine:
        kind = machine.reports[0].watchdog.kind
        assert made.read(0x1016, 1) == 5 << 16 | 500
        assert kind is (Watchdog.NONE if entries == 1 else Watchdog.ARMED)


def test_without_1016_the_node_is_guarded(tmp_path):
    """A drive with 100Ch and 100Dh only: the scan polls its state, the drive notices missing polls."""
    source = (ROOT / "eds" / "generic-cia402.eds").read_text()
    for section in ("1016", "1016sub0", "1016sub1", "1017"):
        begin = source.index(f"[{section}]")
        end = source.index("\n[", begin)
        source = source[:begin] + source[end + 1 :]
    if "[100C]" not in source:
        source += (
            "\n[100C]\nParameterName=Guard time\nObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=0\n"
            "\n[100D]\nParameterName=Life time factor\nObjectType=7\nDataType=5\nAccessType=rw\nDefaultValue=0\n"
        )
    (tmp_path / "guarded.eds").write_text(source)
    path = cell(tmp_path, ("builtin:generic-cia402", "guarded.eds"))
    with Machine.open(path) as machine:
        assert (
            "100Ch and 100Dh expect the master's guarding within 300 ms" in machine.reports[0].watchdog.text
        )
        machine["x"].enable().wait()
        machine["x"].move_relative(30.0).wait()  # longer than the life time
        assert machine.node(3).nmt is NmtState.OPERATIONAL
        made = machine.simulated_node(3).device
        assert made.drive.error_code == 0
    time.sleep(0.5)  # our silence afterwards causes no fault
    assert made.drive.error_code == 0


SLOW_STATUSWORD = """
[nodes.3.pdo.tpdo1]
transmission = 255
[axes.x]
"""


def reports_of(path, *, timer, enabled=False, **dials):
    """Boot a simulated drive on a bus whose TPDO1 has this event timer in ms; return its reports and the timer that it has then."""
    made = device()
    if enabled:
        made.power_on()
        made.drives[0].start_enabled(1)
        made.step(0.5)
    made.write(0x1800, 5, timer)
    for name, value in dials.items():
        setattr(made.dials, name, value)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(canlink, "devices", lambda *_: {3: made})
        with Machine.open(path) as machine:
            return machine.reports, made.read(0x1800, 5)


def test_a_slow_event_timer_of_the_statusword_is_shortened_and_reported(tmp_path):
    path = cell(tmp_path, ("[axes.x]", SLOW_STATUSWORD))
    (report,), now = reports_of(path, timer=1000)
    assert now == 20
    assert "    event timer   TPDO1 (statusword, mode, position) was 1000 ms, is now 20 ms" in report.text()
    (axis,) = report.as_json()["axes"]
    assert axis["event_timers"] == [{"pdo": "TPDO1", "was_ms": 1000, "wanted_ms": 20, "now_ms": 20}]


def test_a_setting_that_the_drive_refuses_to_write_is_reported_as_well(tmp_path):
    path = cell(tmp_path, ("[axes.x]", SLOW_STATUSWORD))
    (report,), now = reports_of(path, timer=1000, sdo_write_aborts={(0x1800, 5): 0x0601_0002})
    assert now == 1000
    assert "stays 1000 ms: the drive does not accept 20 ms" in report.text()


def test_a_drive_found_enabled_keeps_its_event_timer(tmp_path):
    (report,), now = reports_of(cell(tmp_path), timer=1000, enabled=True)
    assert report.axes[0].found_enabled
    assert now == 1000
    assert report.axes[0].event_timers == ()


@pytest.mark.parametrize("timer", [0, 5, 20])
def test_an_event_timer_that_is_short_enough_is_not_reported(tmp_path, timer):
    path = cell(tmp_path, ("[axes.x]", SLOW_STATUSWORD))
    (report,), now = reports_of(path, timer=timer)
    assert now == timer
    assert "event timer" not in report.text()
    assert report.as_json()["axes"][0]["event_timers"] == []


def test_an_event_timer_of_the_cell_file_stays(tmp_path):
    own = SLOW_STATUSWORD.replace("255", '255\nevent_timer = "300ms"')
    (report,), now = reports_of(cell(tmp_path, ("[axes.x]", own)), timer=1000)
    assert now == 300
    assert "event timer" not in report.text()


def test_without_sync_event_timers_are_set_and_reported(tmp_path):
    path = cell(tmp_path, ('scan_period = "5ms"', 'scan_period = "5ms"\nsync = false'))
    (report,), now = reports_of(path, timer=0)
    assert now == 20
    assert "TPDO1 (statusword, mode, position) was off, is now 20 ms" in report.text()


def test_an_event_driven_rpdo_is_sent_three_times_within_the_deadline_that_boot_arms(tmp_path):
    """A drive that knows neither 1016h nor guarding watches for the controlword's RPDO (14xxh:05): three heartbeat periods."""
    source = (ROOT / "eds" / "generic-cia402.eds").read_text()
    for section in ("1016", "1016sub0", "1016sub1"):
        begin = source.index(f"[{section}]")
        end = source.index("\n[", begin)
        source = source[:begin] + source[end + 1 :]
    (tmp_path / "deaf.eds").write_text(source)
    path = cell(
        tmp_path,
        ("builtin:generic-cia402", "deaf.eds"),
        ('scan_period = "5ms"', 'scan_period = "5ms"\nsync = false\nheartbeat = "60ms"'),
    )
    with Machine.open(path) as machine:
        assert "1400h:05 expects the master's RPDO within 180 ms" in machine.reports[0].watchdog.text
        assert machine.simulated_node(3).device.read(0x1400, 5) == 180
        (port,) = machine._core.scan.cycle._ports
        assert {rpdo.repeat for rpdo in port._pace._rpdos.values()} == {0.06}


def test_a_value_that_reads_back_otherwise_names_line_expected_and_got(tmp_path):
    made = device()
    made.dictionary.live[0x6065 << 8] = lambda: 2999
    path = cell(tmp_path)
    with pytest.raises(BootError) as caught:
        simulated(path, made)
    error = caught.value
    assert (error.step, error.index) == ("configuration", 0x6065)
    assert (
        f"6065h:00 cannot be set to 3000 (6065 in [nodes.3.objects], {path}:8): reads back another value"
        in str(error)
    )
    assert error.observed == "expected 3000, got 2999"


def test_a_value_that_the_drive_refuses_names_the_abort_code(tmp_path):
    made = device()
    made.dials.sdo_write_aborts[0x6065, 0] = 0x08000022
    with pytest.raises(BootError, match=r"6065h:00 cannot be set to 3000.*the drive refuses it") as caught:
        simulated(cell(tmp_path), made)
    assert "0x08000022, Data cannot be transferred" in caught.value.observed
    assert "pre-operational" in caught.value.remedy


class Busy(dict):
    """Abort codes by object (``sdo_aborts``); the node is busy for its first ``refusals`` requests of these objects."""

    def __init__(self, refusals, *objects, code=0x0800_0022):
        super().__init__(dict.fromkeys(objects, code))
        self.left = refusals

    def get(self, key, default=None):
        if key not in self or not self.left:
            return default
        self.left -= 1
        return self[key]


STATUSWORD, MODES, HEARTBEAT, MAPPING = (0x6041, 0), (0x6502, 0), (0x1017, 0), (0x1A00, 0)


@pytest.mark.parametrize("code", [0x0800_0020, 0x0800_0021, 0x0800_0022])
def test_boot_up_repeats_a_request_that_the_node_refuses_because_it_is_busy(tmp_path, code):
    made = device()
    made.dials.sdo_aborts = Busy(20, STATUSWORD, MODES, HEARTBEAT, MAPPING, (0x6065, 0), code=code)
    with simulated(cell(tmp_path), made) as machine:
        assert made.dials.sdo_aborts.left == 0
        assert made.read(0x6065) == 3000
        assert made.read(0x1017) == 100
        assert machine["x"].modes == simulated_modes(tmp_path)


def simulated_modes(folder):
    with simulated(folder / "cell.toml", device()) as machine:
        return machine["x"].modes


@pytest.mark.parametrize("refused", [STATUSWORD, MODES, HEARTBEAT, MAPPING, (0x1005, 0), (0x1018, 4)])
def test_a_node_that_stays_busy_is_not_booted_as_if_it_had_no_such_object(tmp_path, refused):
    made = device()
    made.dials.sdo_aborts = Busy(10**9, refused)
    with pytest.raises(BootError, match=r"was refused|cannot be") as caught:
        simulated(cell(tmp_path), made)
    assert caught.value.index == refused[0]
    assert "0x08000022" in caught.value.observed
    assert "were repeated for 2 s" in caught.value.observed


def test_an_enabled_drive_is_left_alone_also_if_it_is_busy_when_its_state_is_read(tmp_path):
    made = device()
    made.drive.start_enabled()
    made.dials.sdo_aborts = Busy(10**9, STATUSWORD)
    with pytest.raises(BootError, match="6041h"):
        simulated(cell(tmp_path), made)
    assert made.read(0x6065) != 3000


def test_an_error_of_a_boot_step_is_not_its_own_cause():
    """A program that follows the causes of an error comes to an end."""
    boot, error = NodeBoot.__new__(NodeBoot), BootError("refused", node=3, step="configuration")
    boot._objects = SimpleNamespace(node_id=3)

    def fails() -> None:
        raise error

    with pytest.raises(BootError) as caught:
        boot._step("configuration", fails)
    assert caught.value is error
    assert error.__cause__ is None


def test_a_drive_of_another_vendor_is_refused(tmp_path):
    source = (ROOT / "eds" / "generic-cia402.eds").read_text()
    begin = source.index("[1018sub1]")
    end = source.index("\n[", begin)
    other = source[:begin] + source[begin:end].replace("DefaultValue=", "DefaultValue=0x12;") + source[end:]
    other = other.replace("DefaultValue=0x12;", "DefaultValue=0x12\n;")
    (tmp_path / "other.eds").write_text(other)
    made = device_from_eds(eds.load(tmp_path / "other.eds"), 3)
    made.dictionary.set(0x1018 << 8 | 1, 0x99)
    path = cell(tmp_path, ("builtin:generic-cia402", "other.eds"))
    with pytest.raises(
        BootError, match=r"not the device that other.eds describes: its vendor ID differs"
    ) as caught:
        simulated(path, made)
    assert "1018h:01 is 0x99, the EDS says 0x12" in caught.value.observed


def test_a_silent_node_is_named(tmp_path):
    made = device()
    made.dials.sdo_silent = True
    with pytest.raises(BootError, match="node 3, step find: node 3 does not answer"):
        simulated(cell(tmp_path), made)


def test_direct_access_reads_and_writes_by_number_and_name(tmp_path):
    with simulated(cell(tmp_path)) as machine:
        node = machine.node(3)
        node.sdo["Profile velocity"] = 1234
        assert node.sdo[0x6081] == 1234
        node.sdo[0x607D, 1] = -500
        assert node.sdo[0x607D, 1] == -500
        with pytest.raises(ArgumentError, match=r"did you mean .profile velocity."):
            node.sdo["Profile velocty"]
        with pytest.raises(SdoAbort, match="6502"):
            node.sdo[0x6502] = 1
        assert node.pdo_events == ()
        with pytest.raises(StateError, match="the cell has no node 4"):
            machine.node(4)


def test_direct_access_over_the_bus(tmp_path):
    with Machine.open(cell(tmp_path)) as machine:
        node = machine.node(3)
        assert node.nmt is NmtState.OPERATIONAL
        node.sdo[0x6081] = 777
        assert node.canopen.sdo["Profile velocity"].raw == 777
        with pytest.raises(LimitError):
            node.sdo[0x6081] = -1
        with pytest.raises(StateError, match="sent by PDO in every cycle"):
            node.sdo[0x607A] = 5
        machine.simulated_node(3).fault(0x2310)
        deadline = time.monotonic() + 5
        while not node.emcy and time.monotonic() < deadline:
            time.sleep(0.01)
        assert node.emcy[-1].code == 0x2310
        assert any("RPDO1" in line for line in node.pdos())


def test_pdo_tables_are_set_in_the_drive(tmp_path):
    table = """
[nodes.3.pdo.tpdo4]
map = ["60F4", "60FD"]
transmission = 255
event_timer = "50ms"
[axes.x]
"""
    with Machine.open(cell(tmp_path, ("[axes.x]\n", table))) as machine:
        read = machine.node(3).sdo
        assert [read[0x1A03, sub] for sub in range(3)] == [2, 0x60F40020, 0x60FD0020]
        assert (read[0x1803, 2], read[0x1803, 5]) == (255, 50)
        assert not read[0x1803, 1] & 1 << 31


def test_reports_of_the_stop_sequence_name_coasting():
    codes = {0x605A: 0, 0x605C: 0, 0x605D: 1, 0x605E: 2, 0x6007: None}
    report = stop_sequence_report("x", codes, StopTimes(1.0, 2.0, 3.0), HoldsLoad.BRAKE)
    rows = {title: (what, text) for title, what, text in report.rows}
    assert rows["2 quick stop"][0] == "605Ah = 0"
    assert "coasts" in rows["2 quick stop"][1]
    assert "at most 2 s" in rows["2 quick stop"][1]
    assert rows["on a lost link"] == ("6007h missing", "not in this drive: its manual says how it reacts")
    assert "holds a load" in rows
    assert len(report.warnings) == 2
    assert all("coasts" in warning for warning in report.warnings)


@pytest.mark.parametrize(
    ("scale", "agrees", "words"),
    [
        (364.0889, True, "at the gear's output"),
        (45.5111, True, "at the motor"),
        (100.0, False, "suggest 364.089 (at the gear's output), 45.5111 (at the motor)"),
    ],
)
def test_scale_is_printed_next_to_the_scale_of_the_drive_s_objects(scale, agrees, words):
    """16384 counts per motor turn, gear 8:1: 131072 counts per output turn, by hand."""
    values = {(0x608F, 1): 16384, (0x608F, 2): 1, (0x6091, 1): 8, (0x6091, 2): 1}
    report = compare(Scale.of(scale, "deg"), values)
    assert report.agrees is agrees
    assert words in report.proposed


def test_no_scale_is_suggested_for_other_units():
    report = compare(Scale.of(100, "mm"), {(0x608F, 1): 4096, (0x608F, 2): 1})
    assert report.agrees is None
    assert "4096 increments per motor turn" in report.proposed


def test_a_recording_holds_every_cycle(tmp_path):
    with simulated(cell(tmp_path)) as machine:
        with Recorder(machine) as recorder:
            machine["x"].enable().wait()
            machine["x"].move_absolute(5.0).wait()
        rows = list(recorder.rows())
        assert len(rows) == len(recorder)
        assert recorder.header()[:2] == ["time", "x.position"]
        times = [row[0] for row in rows]
        assert all(abs(b - a - 0.005) < 1e-6 for a, b in itertools.pairwise(times))
        assert rows[-1][1] == pytest.approx(5.0, abs=1.0)  # the drive's own window is 1 degree here
        assert rows[-1][4] == pytest.approx(5.0)
        before = len(recorder)
        machine.sleep(0.1)
        assert len(recorder) == before
        path = recorder.write_csv(tmp_path / "deep" / "r.csv")
        assert path.read_text().startswith("time [s],x.position [deg],x.velocity [deg/s],")


def test_a_node_that_leaves_operational_is_lost_for_its_axis(tmp_path):
    with Machine.open(cell(tmp_path)) as machine:
        machine["x"].enable().wait()
        machine.node(3).command(NmtCommand.ENTER_PRE_OPERATIONAL)
        deadline = time.monotonic() + 5
        while machine["x"].error is None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert "node 3 is lost" in machine["x"].error.message


def test_axes_groups_and_names(tmp_path):
    with simulated(ROOT / "examples" / "cell.toml") as machine:
        assert [axis.name for axis in machine] == ["x", "y", "z"]
        assert len(machine) == 3
        assert "x" in machine
        assert machine.group("xyz") is machine.group("xyz")
        assert [axis.name for axis in machine.group("z", "x")] == ["z", "x"]
        for wrong in ("w", "xy"):
            with pytest.raises(StateError, match="no axis"):
                machine.group(wrong)
        with pytest.raises(StateError, match="needs a name"):
            machine.group()
        assert machine.is_simulated
    machine.close()  # once more does nothing


def test_the_number_of_consumer_heartbeats_that_are_read_is_limited_by_the_number_of_nodes(
    tmp_path,
):
    asked = []

    class Objects:
        def read(self, index, subindex=0):
            asked.append((index, subindex))
            if index != 0x1016:
                return None
            return 0xFFFF if subindex == 0 else 5 << 16 | 100  # each of them watches another node

    report = DriveMonitoringSetup(Objects(), simulated_bus(tmp_path)).arm(None)
    assert report == NO_WATCHDOG
    assert [key for key in asked if key[0] == 0x1016] == [(0x1016, number) for number in range(128)]


def simulated_bus(tmp_path):
    return replace(load_cell(cell(tmp_path)).bus, heartbeat=0.1)
