"""Errors of named inputs and outputs; each cell has just one defect."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.cell.problem import CellProblem
from axisbus.check.bus_load import streams
from axisbus.check.cycle_schedule import timetable
from axisbus.check.run import check
from axisbus.core.files import load_dictionaries
from kit.cell import cell_file, cell_text

MODULE = '[nodes.5]\neds = "builtin:generic-cia401"\n'
LAMP = 'node = 5\nobject = "6200h:01"\nbit = 3\nsafe = 0\n'


def found(folder: Path, io: str, node: str = "", **changes: str) -> list[CellProblem]:
    path = cell_file(folder, "x", more=f"{MODULE}{node}{io}", **changes)
    return [problem for problem in check(path) if "io." in problem.message or "[io" in problem.message]


def only(folder: Path, io: str, **changes: str) -> CellProblem:
    problems = [problem for problem in found(folder, io, **changes) if problem.severity.value == "error"]
    assert len(problems) == 1, problems
    return problems[0]


def lamp(folder: Path, before: str, after: str) -> CellProblem:
    assert before in LAMP
    return only(folder, f"[io.lamp]\n{LAMP.replace(before, after)}")


def test_a_lamp_and_an_input_are_in_order(tmp_path):
    assert (
        found(
            tmp_path,
            f'[io.lamp]\n{LAMP}[io.part]\nnode = 5\nobject = "6000"\n'.replace('"6000"', '"6000:02"'),
        )
        == []
    )


@pytest.mark.parametrize(
    ("before", "after", "message", "remedy"),
    [
        ("node = 5", "node = 6", "on node 6, which the cell does not have", "[nodes.6]"),
        ('"6200h:01"', '"6200h:03"', "is not an input or output of node 5", "correct object"),
        ('"6200h:01"', '"6206h:01"', "6206h:01 cannot be mapped into a PDO", "an object that can"),
        ('"6200h:01"', '"lamps"', "is not an input or output of node 5", "an index is written"),
        ("bit = 3", "bit = 8", "6200h:01 has no bit 8", "bit = 0 to 7"),
        ("safe = 0\n", "", "does not give its safe state", "safe = 0"),
        ("safe = 0", "safe = 2", "lamp cannot be 2", "True or False"),
        ("safe = 0", "safe = 0\nscale = 2", "scale is for numbers", "leave scale or bit out"),
        ("bit = 3", "bitt = 3", "unknown key 'bitt'", "did you mean bit?"),
        ('"6200h:01"', '"6000h:01"', "6000h:01 is an input, which has no safe state", "leave safe out"),
    ],
)
def test_a_mistake_in_a_table_is_named_with_the_remedy(tmp_path, before, after, message, remedy):
    problem = lamp(tmp_path, before, after)
    assert message in problem.message
    assert remedy in problem.remedy
    assert problem.line > 20


def test_a_number_must_hold_its_safe_state(tmp_path):
    problem = only(
        tmp_path, '[io.valve]\nnode = 5\nobject = "6411h:01"\nscale = 1000\nunit = "V"\nsafe = 40\n'
    )
    assert "valve cannot be 40 V" in problem.message
    assert "-32.768 to 32.767 V" in problem.observed


def test_two_outputs_on_one_bit_are_reported(tmp_path):
    problem = only(tmp_path, f"[io.lamp]\n{LAMP}[io.horn]\n{LAMP}")
    assert "[io.lamp] and [io.horn] are the same output: 6200h:01 bit 3" in problem.message
    whole = '[io.all]\nnode = 5\nobject = "6200h:01"\nsafe = 0\n'
    assert "are the same output" in only(tmp_path, f"[io.lamp]\n{LAMP}{whole}").message


@pytest.mark.parametrize("key", ["6040", "607A", "60FEh:02", "1017"])
def test_objects_of_an_axis_or_of_the_communication_are_no_outputs(tmp_path, key):
    problems = found(tmp_path, f'[io.bad]\nnode = 1\nobject = "{key}"\nsafe = 0\n')
    assert any("not an output" in each.message or "into a PDO" in each.message for each in problems)


def test_a_drive_whose_mapping_is_fixed_is_reported_as_without_room_for_the_output(tmp_path):
    text = cell_text("x", more='[io.relay]\nnode = 1\nobject = "60FEh:01"\nbit = 16\nsafe = 0\n')
    path = tmp_path / "cell.toml"
    path.write_text(text.replace("[nodes.1]\n", '[nodes.1]\nremap = "never"\n'), encoding="utf-8")
    (problem,) = [each for each in check(path) if each.severity.value == "error"]
    assert "60FEh:01 is in no PDO: the mapping is fixed and does not contain it" in problem.message


@pytest.mark.parametrize(
    "more", ['map = ["6000:02"]', 'map = ["6000:01"]\ntransmission = 253\nrtr = "100ms"']
)
def test_an_input_that_would_never_be_received_is_refused(tmp_path, more):
    """Its PDOs are used otherwise, or are sent only on request, and inputs are not requested."""
    others = '[nodes.5.pdo.tpdo2]\nmap = ["6401:01"]\n'
    problem = only(
        tmp_path,
        '[io.part]\nnode = 5\nobject = "6000:01"\nbit = 0\n',
        node=f"[nodes.5.pdo.tpdo1]\n{more}\n{others}",
    )
    assert "[io.part]: 6000h:01 is in no PDO" in problem.message
    assert "inputs are not requested" in problem.observed


@pytest.mark.parametrize(
    ("first", "module", "bus", "node"),
    [('on_lost = "report"', "", "", 1), ("", 'on_lost = "stop"', 'on_lost_node = "report"', 5)],
)
def test_an_on_lost_that_decides_nothing_is_reported(tmp_path, first, module, bus, node):
    path = tmp_path / "cell.toml"
    text = cell_text("x", bus=bus, more=f"{MODULE}{module}\n[io.lamp]\n{LAMP}")
    path.write_text(text.replace("[nodes.1]\n", f"[nodes.1]\n{first}\n"), encoding="utf-8")
    (problem,) = [each for each in check(path) if "on_lost" in each.message]
    assert problem.message == f"on_lost of [nodes.{node}] has no effect"
    path.write_text(path.read_text().replace(first or bus, ""), encoding="utf-8")
    assert not [each for each in check(path) if "on_lost" in each.message]


def test_an_output_that_is_not_made_safe_without_the_master_is_a_warning(tmp_path):
    relay = '[io.relay]\nnode = 1\nobject = "60FEh:01"\nbit = 16\nsafe = 0\n'
    (problem,) = found(tmp_path, relay)
    assert problem.severity.value == "warning"
    assert "does not set it to its safe state" in problem.message
    path = cell_file(tmp_path, "x", heartbeat="off", more=f"{MODULE}[io.lamp]\n{LAMP}")
    assert any("without heartbeat" in each.observed for each in check(path))


VALVE = '[io.valve]\nnode = 5\nobject = "6411h:01"\nscale = 1000\nsafe = {}\n'


def test_a_safe_number_that_makers_differ_about_is_warned_of(tmp_path):
    """6444h has 32 bits for an output of 16; 0 is the same in both halves, and a value in the cell file is left unchanged."""
    (problem,) = found(tmp_path, VALVE.format(0.5))
    assert problem.severity.value == "warning"
    assert "manufacturers differ in the effect of 6444h:01" in problem.message
    assert found(tmp_path, VALVE.format(0)) == []
    own = '[nodes.5.objects]\n"6444:01" = 0x1F40000\n'
    assert found(tmp_path, VALVE.format(0.5), node=own) == []


def test_the_frames_of_inputs_and_outputs_are_in_the_load_and_in_the_timetable(tmp_path):
    path = tmp_path / "cell.toml"
    io = f'[io.lamp]\n{LAMP}[io.part]\nnode = 5\nobject = "6000h:01"\nbit = 0\n'
    io += '[io.relay]\nnode = 1\nobject = "60FEh:01"\nbit = 16\nsafe = 0\n'
    path.write_text(cell_text("x", bus="bitrate = 1_000_000", more=MODULE + io), encoding="utf-8")
    cell = reader.load(path)
    files = load_dictionaries(cell)
    of_module = {(each.kind, each.name) for each in streams(cell, files) if each.node == 5}
    assert {("RPDO", "RPDO1"), ("TPDO", "TPDO1")} <= of_module
    slots = [
        slot for slot in timetable(cell, files, 1_000_000).slots if slot.node == 1 and slot.kind == "RPDO"
    ]
    carries = [" ".join(slot.carries) for slot in slots]
    assert len(slots) == 3  # two of the axis, and one of its own for the relay
    assert sum("utputs" in each for each in carries) == 1
