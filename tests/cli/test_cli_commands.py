"""Every subcommand with typical arguments: its output, and its exit code."""

import csv
import json
import re
from pathlib import Path

import click
import pytest

from axisbus.bus.link.controller import CanErrorState, ControllerEvent, ErrorCounters
from axisbus.cli.main import COMMANDS, cli
from axisbus.machine.machine import Machine
from kit.command_line import CELL
from kit.corpus import CORPUS

ROOT = Path(__file__).parents[2]
ONE_AXIS = """
[bus]
interface = "{interface}"
channel = "{channel}"
scan_period = "4ms"
[nodes.5]
eds = "{eds}"
[axes.x]
node = 5
unit = "increments"
[axes.x.defaults]
velocity = {velocity}
acceleration = {acceleration}
"""


def cell(
    folder, eds="builtin:generic-cia402", interface="sim", channel="c", velocity=5000, acceleration=50000
):
    path = folder / "cell.toml"
    text = ONE_AXIS.format(
        eds=eds, interface=interface, channel=channel, velocity=velocity, acceleration=acceleration
    )
    path.write_text(text)
    return path


def test_check_of_a_clean_cell(axisbus):
    code, out, _ = axisbus("check", CELL)
    assert code == 0
    assert "0 errors, 0 warnings" in out
    assert f"next: axisbus boot {CELL}" in out


def test_check_names_line_and_remedy_and_exits_with_1(axisbus, tmp_path):
    path = cell(tmp_path)
    path.write_text(path.read_text().replace("scan_period", "scan_perod"))
    code, out, _ = axisbus("check", path)
    assert code == 1
    assert f"{path}:5: error: unknown key 'scan_perod'" in out
    assert "did you mean scan_period?" in out


def test_check_as_json(axisbus, tmp_path):
    path = cell(tmp_path, eds="no.eds")
    code, out, _ = axisbus("check", path, "--json")
    found = json.loads(out)
    assert (code, found["ok"]) == (1, False)
    assert [
        (each["line"], each["severity"]) for each in found["findings"] if each["severity"] == "error"
    ] == [(7, "error")]


def test_scan_lists_the_nodes(axisbus):
    code, out, _ = axisbus("scan", CELL)
    assert code == 0
    assert out.count("servo drive (CiA 402)") == 3
    assert "vendor 0xC0B00" in out


def test_scan_as_json(axisbus):
    code, out, _ = axisbus("scan", CELL, "--json")
    assert code == 0
    assert [(node["node_id"], node["identity"]["vendor_id"]) for node in json.loads(out)] == [
        (1, 0x0C0B00),
        (2, 0x0C0B00),
        (3, 0x0C0B00),
    ]


def test_scan_of_an_empty_bus_exits_with_1(axisbus):
    code, out, _ = axisbus("scan", "-i", "virtual", "-c", "nobody-here")
    assert code == 1
    assert "no node answered" in out


def test_scan_without_a_bus_is_misuse(axisbus):
    code, _, err = axisbus("scan")
    assert code == 2
    assert "give a cell file, or the bus with -i and -c" in err


def test_boot_reports_each_node(axisbus):
    code, out, _ = axisbus("boot", CELL)
    assert code == 0
    assert "3 of 3 nodes came up" in out
    assert out.count("stop sequence") == 3
    assert "605Ah = 2" in out
    assert "watchdog      armed, reaction unknown" in out


def test_boot_without_nodes_names_the_failed_step(axisbus, tmp_path):
    code, out, _ = axisbus("boot", cell(tmp_path, interface="virtual", channel="empty"))
    assert code == 3
    assert "FAILED at find: node 5, step find: node 5 does not answer" in out
    assert "check its supply, cable and termination, its node ID and bit rate" in out


def test_boot_as_json(axisbus):
    code, out, _ = axisbus("boot", CELL, "--json")
    reports = json.loads(out)
    assert code == 0
    assert [report["node"] for report in reports] == [1, 2, 3]
    assert reports[0]["axes"][0]["stop_sequence"][0]["step"] == "1 halt"
    assert reports[0]["axes"][0]["scale"]["agrees"] is True


def test_monitor_shows_state_and_position(axisbus):
    code, out, _ = axisbus("monitor", CELL, "--count", 1)
    assert code == 0
    assert re.search(r"^x +Disabled +0\.000 deg", out, re.MULTILINE)


def test_monitor_prints_each_event_of_the_can_controller_once(axisbus, monkeypatch):
    off = ControllerEvent(1.0, "socketcan:can0", CanErrorState.OFF, ErrorCounters(248, 3))
    back = ControllerEvent(2.0, "socketcan:can0", CanErrorState.ACTIVE, None, restarted=True)
    monkeypatch.setattr(Machine, "bus_events", [off, back])
    _, out, _ = axisbus("monitor", CELL, "--count", 2, "--every", 0.01)
    told = [line.strip() for line in out.splitlines() if "CAN controller" in line]
    assert told == [
        "the CAN controller of socketcan:can0 is bus-off (transmit errors 248, receive errors 3)",
        "the CAN controller of socketcan:can0 has been restarted and takes part in the bus again: check every node again",
    ]


def test_monitor_as_json(axisbus):
    code, out, _ = axisbus("monitor", CELL, "--count", 1, "--json")
    assert code == 0
    seen = json.loads(out)
    assert [axis["axis"] for axis in seen] == ["x", "y", "z"]
    assert [(axis["node"], axis["incidents"]) for axis in seen] == [(1, []), (2, []), (3, [])]
    assert all(0 <= axis["age"] < 1 for axis in seen)


def test_monitor_prints_bus_load_and_cycle(axisbus):
    code, out, _ = axisbus("monitor", CELL, "--count", 2, "--every", 0.5)
    assert code == 0
    found = re.search(r"bus: (\d+)% to (\d+)% of 1000 kbit/s, (\d+) frames/s", out)
    least, most, frames = map(int, found.groups())
    assert 0 < least <= most < 100
    assert 250 * 3 < frames < 10_000  # a SYNC and some PDOs in each cycle of 4 ms
    assert re.search(r"cycle of 4 ms: \d+ cycles, half of them", out)


def test_move_homes_and_moves(axisbus):
    code, out, _ = axisbus("move", CELL, "x=30", "y=-20", "--home", "--velocity", "300")
    assert code == 0
    assert re.search(r"x: at (29\.9|30\.0)", out)
    assert re.search(r"y: at (-19\.9|-20\.0)", out)
    assert "all axes are at standstill and disabled" in out


def test_move_of_an_axis_that_is_not_homed_is_refused_before_anything_moves(axisbus):
    code, out, err = axisbus("move", CELL, "x=30")
    assert code == 2
    assert "the axis is not homed" in err
    assert "moving" not in out


def test_move_with_words_that_are_no_target_is_misuse(axisbus):
    code, _, err = axisbus("move", CELL, "x")
    assert code == 2
    assert "write AXIS=POSITION" in err


def test_move_of_an_unknown_axis_names_those_that_exist(axisbus):
    code, _, err = axisbus("move", CELL, "w=1")
    assert code == 1
    assert "the cell has no axis 'w'" in err
    assert "x, y, z" in err


def test_home_and_reset(axisbus):
    code, out, _ = axisbus("home", CELL, "x")
    assert code == 0
    assert "x: homed, at 0.0000 deg" in out
    code, out, _ = axisbus("reset", CELL, "x")
    assert (code, "x: no fault" in out) == (0, True)


def test_a_stop_of_simulated_drives_without_a_machine_reports_not_reached(axisbus):
    code, out, _ = axisbus("stop", CELL)
    assert code == 3
    assert out.count("NOT REACHED: no machine of this cell was found") == 3
    code, out, _ = axisbus("stop", CELL, "--json")
    assert code == 3
    assert [(each["axis"], each["ok"]) for each in json.loads(out)] == [
        ("x", False),
        ("y", False),
        ("z", False),
    ]


def test_a_cell_that_is_not_there(axisbus, tmp_path):
    code, _, err = axisbus("boot", tmp_path / "nothing.toml")
    assert code == 1
    assert "nothing.toml" in err


def test_demo_writes_recording_and_picture(axisbus, tmp_path):
    code, out, err = axisbus("demo", "--output", tmp_path / "out")
    assert code == 0, out + err
    with (tmp_path / "out" / "recording.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:4] == ["time [s]", "x.position [deg]", "x.velocity [deg/s]", "x.torque [N·m]"]
    assert len(rows[0]) == 1 + 3 * 11
    assert {"Homing", "DiscreteMotion", "SynchronizedMotion", "ErrorStop", "Standstill", "Disabled"} <= {
        row["y.state"] for row in rows
    }
    assert rows[-1]["x.state"] == "Disabled"
    assert (tmp_path / "out" / "motion.png").read_bytes().startswith(b"\x89PNG")
    assert "the drive went into fault" in out


def test_help_lists_every_command(axisbus):
    code, out, _ = axisbus("--help")
    assert code == 0
    for name in COMMANDS:
        assert f"  {name} " in out


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_has_help(axisbus, name):
    code, out, _ = axisbus(name, "--help")
    assert code == 0
    assert out.startswith(f"Usage: axisbus {name}")


def within(command, path=()):
    """A command and all that are below it."""
    yield path, command
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from within(command.get_command(context, name), (*path, name))


def test_each_option_of_each_command_has_a_help_text():
    options = [
        (path, each.opts, each.help)
        for path, command in within(cli)
        for each in command.params
        if isinstance(each, click.Option)
    ]
    assert len(options) > 300
    assert [(path, names) for path, names, text in options if not text] == []


@pytest.mark.skipif(not CORPUS.is_dir(), reason="the corpus of real EDS files is not here")
@pytest.mark.parametrize(
    "eds",
    [
        "maxon-motor-ag__epos4-module-50-5_maxonepos4_older__pejman712-crf.eds",
        "nanotec-electronic-g__c5-e-2-09__abmorobotics-isaac-rover-physic.eds",
        "trinamic-motion-cont__tmcm-1670-hw1.2-fw2.00__analogdevicesinc-pytrinamic.eds",
        "elmo-motion-control__gold-drive_elmo__ros-industrial-ros-canopen.eds",
    ],
    ids=lambda name: name.split("__")[0],
)
def test_move_with_another_makers_eds(axisbus, tmp_path, eds):
    code, out, err = axisbus(
        "move", cell(tmp_path, eds=CORPUS / eds, velocity=300, acceleration=500), "x=2000"
    )
    assert code == 0, err
    position = float(re.search(r"x: at (-?[\d.]+)", out)[1])
    assert abs(position - 2000) <= 100
