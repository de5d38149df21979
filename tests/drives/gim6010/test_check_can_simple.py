"""A module that speaks CAN Simple in a check: its settings, its dangers, and the bus load of its frames."""

from __future__ import annotations

import ast
import inspect
import string
from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.check.bus_load import streams
from axisbus.check.cycle_schedule import timetable
from axisbus.check.ids.table import id_of
from axisbus.check.run import check
from axisbus.cia301.tables import rows
from axisbus.core.files import load_dictionaries
from axisbus.drives.gim6010 import check_ids, checks
from kit.can_simple.mixed_cell import write

SIM = 'interface = "sim"'


def told(path: Path, word: str) -> list[str]:
    return [str(problem) for problem in check(path) if word in str(problem)]


def errors(path: Path) -> list[str]:
    return [str(problem) for problem in check(path) if problem.severity.value == "error"]


def test_a_mixed_cell_is_sound(tmp_path):
    assert errors(write(tmp_path, SIM)) == []
    assert errors(write(tmp_path, SIM, 'quick_stop = "ramp-hold"')) == []


@pytest.mark.parametrize(
    ("stop", "words"),
    [
        ('quick_stop = "coast"', "quick stop is 2, brakes on the quick-stop ramp, then power off"),
        ('fault = "ramp"', "fault is 0, the motor coasts"),
        ('disable = "slow-ramp"', "disable operation is 0, the motor coasts"),
        ("deceleration = 5.0", ": 655360"),
    ],
)
def test_a_reaction_that_it_has_not_is_an_error(tmp_path, stop, words):
    (found,) = errors(write(tmp_path, SIM, stop))
    assert "cannot be set in a module" in found
    assert words in found


def test_the_quick_stop_ramp_of_the_module_may_be_repeated_in_the_cell_file(tmp_path):
    """40 turns/s² of the rotor are 1800 deg/s² of the output."""
    assert errors(write(tmp_path, SIM, 'quick_stop = "ramp"\ndeceleration = 1800.0')) == []


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('[io.lamp]\nnode = 16\nobject = "6200h:01"\nbit = 0\nsafe = 0\n', "has no inputs and outputs"),
        ("[axes.m.feed_forward]\nvelocity = true\n", "a module with CAN Simple gets no feed-forward"),
    ],
)
def test_a_key_that_a_module_does_not_support_is_an_error(tmp_path, more, words):
    path = write(tmp_path, SIM)
    path.write_text(path.read_text() + more, "utf-8")
    assert any(words in each for each in errors(path))


def test_a_module_can_only_be_homed_in_place(tmp_path):
    path = write(tmp_path, SIM)
    path.write_text(path.read_text().replace("method = 37", "method = 17"), "utf-8")
    assert any("does not have homing method 17" in each for each in errors(path))


def test_a_limit_is_checked_as_that_of_any_drive(tmp_path):
    path = write(tmp_path, SIM)
    text = path.read_text().replace("velocity = 180.0\n", "velocity = 900.0\n", 1)  # its max_velocity is 800
    path.write_text(text, "utf-8")
    assert any("900" in each and "axes.m" in each for each in errors(path))


@pytest.mark.parametrize(
    ("bus", "worse"),
    [
        (SIM, False),
        ('interface = "socketcan"\nchannel = "can0"', False),
        ('interface = "socketcan"\nchannel = "can0"\nprocess = "thread"', True),
    ],
)
def test_a_module_without_detection_of_a_dead_master_is_a_warning(tmp_path, bus, worse):
    (found,) = told(write(tmp_path, bus), "is known to detect the loss of the master")
    assert found.split(":")[2].strip() == "warning"
    assert ("nothing stops it when this program is killed" in found) is worse


def test_the_frames_of_a_module_are_in_the_load_and_in_the_timetable(tmp_path):
    cell = reader.load(write(tmp_path, SIM + "\nbitrate = 1_000_000"))
    files = load_dictionaries(cell)
    # a scan of 20 ms: estimates are sent unasked every 10 ms, a target in each cycle
    rates = {(each.kind, each.name): each.rate for each in streams(cell, files) if each.node == 16}
    assert rates == pytest.approx(
        {
            ("heartbeat", "Heartbeat"): 10.0,
            ("request", "Get_Encoder_Estimates"): 50.0,
            ("answer", "Get_Encoder_Estimates"): 100.0,
            ("request", "Get_Encoder_Count"): 10.0,
            ("answer", "Get_Encoder_Count"): 10.0,
            ("target", "Set_Input_Pos"): 50.0,
        }
    )
    slots = {(each.kind, each.can_id): each.share for each in timetable(cell, files, 1_000_000).slots}
    assert slots["heartbeat", 0x201] == pytest.approx(0.2)
    assert slots["target", 0x20C] == 1.0
    assert ("heartbeat", 0x710) not in slots
    (load,) = told(write(tmp_path, SIM + "\nbitrate = 1_000_000"), "the bus load is")
    assert "answers of CAN Simple" in load


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("endpoints_0.5.13.json", None, "cannot be read"),
        ("endpoints_0.5.13.json", "{", "is not JSON"),
        (
            "endpoints_0.5.11.json",
            "[]",
            "for firmware 0.5.11 according to its name, but the node must have 0.5.13",
        ),
        ("endpoints.json", "[]", ""),
    ],
)
def test_a_list_of_endpoints_is_read_before_anything_is_opened(tmp_path, name, text, words):
    path = write(tmp_path, SIM)
    path.write_text(path.read_text().replace("[axes.m]", f'endpoints = "{name}"\n[axes.m]', 1))
    if text is not None:
        (tmp_path / name).write_text(text)
    found = errors(path)
    assert [words in each for each in found] == ([True] if words else []), found


def test_a_list_without_a_version_is_an_error(tmp_path):
    path = write(tmp_path, SIM)
    text = path.read_text().replace('firmware = "0.5.13"\n', "", 1)
    path.write_text(text.replace("[axes.m]", 'endpoints = "mine.json"\n[axes.m]', 1))
    (tmp_path / "mine.json").write_text("[]")
    (found,) = errors(path)
    assert "does not give its firmware version" in found


def test_each_check_of_a_module_has_an_id_and_each_of_its_ids_a_check():
    of_checks = [
        id_of(each) for each in checks.CHECKS if each is not checks.as_drives
    ]  # that one makes others
    assert sorted(of_checks) == [row["rule"] for row in check_ids.rows()]


def test_each_text_of_a_check_is_used_with_the_values_in_its_braces():
    calls = [
        node
        for node in ast.walk(ast.parse(inspect.getsource(checks)))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "_told"
    ]
    given = {call.args[0].value: {each.arg for each in call.keywords} for call in calls}
    named = {
        row["key"]: {
            name for text in row.values() for _, name, _, _ in string.Formatter().parse(text) if name
        }
        for row in rows("axisbus.drives.gim6010", "check_texts.tsv")
    }
    assert given == named
