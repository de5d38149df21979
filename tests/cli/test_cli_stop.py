"""``axisbus stop`` and ``halt``: however the machine runs, its axes are stopped, or the command reports that they were not."""

from __future__ import annotations

from contextlib import ExitStack

import pytest

from axisbus.bus.link.claims import CellFileId, claim
from axisbus.errors import ScanError
from axisbus.machine.machine import Machine
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, enabled, own_cell, turns, under_way

pytestmark = [OWN_PROCESS, pytest.mark.timeout(180)]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("found"))


@pytest.fixture(scope="module")
def opened(file):
    with core_in_threads(), Machine.open(file) as machine:
        yield machine


def crowd(file, stack):
    for _ in range(20):
        stack.enter_context(Machine.attach(file))


STOPS = [("halt", "x"), ("halt",), ("stop",)]


@pytest.mark.parametrize("words", STOPS, ids=" ".join)
def test_a_machine_with_its_maximum_of_clients_is_stopped_from_the_command_line(axisbus, moving, file, words):
    machine, handle = moving
    with ExitStack() as stack:
        with pytest.raises(ScanError) as caught:
            crowd(file, stack)
        assert "its maximum number of clients" in caught.value.observed
        code, out, err = axisbus(words[0], file, *words[1:])
        assert code == 0, err
        assert "x: is at standstill" in out
        assert turns(machine) == pytest.approx(0.0, abs=0.1)
    assert not handle.active


@pytest.mark.parametrize("words", STOPS, ids=" ".join)
def test_a_machine_whose_cell_file_was_changed_is_stopped_from_the_command_line(axisbus, moving, file, words):
    machine, _ = moving
    before = file.read_text()
    new = file.with_suffix(".new")
    try:
        new.write_text(before + "\n# changed\n")
        new.rename(file)
        code, out, err = axisbus(words[0], file, *words[1:])
        assert code == 0, err
        assert "x: is at standstill" in out
        assert turns(machine) == pytest.approx(0.0, abs=0.1)
    finally:
        file.write_text(before)


@pytest.mark.parametrize("words", STOPS, ids=" ".join)
def test_a_machine_whose_cell_file_can_no_longer_be_read_is_stopped_from_the_command_line(
    axisbus, moving, file, words
):
    machine, _ = moving
    before = file.read_text()
    try:
        file.write_text(before + "\n[axes")
        code, out, err = axisbus(words[0], file, *words[1:])
        assert code == 1
        assert "x: is at standstill" in out
        assert "cell.toml" in err
        assert turns(machine) == pytest.approx(0.0, abs=0.1)
    finally:
        file.write_text(before)


@pytest.mark.usefixtures("moving")
def test_an_axis_that_the_machine_does_not_have_is_not_reported_as_stopped(axisbus, file):
    before = file.read_text()
    try:
        file.write_text(before.replace("axes.y", "axes.q"))
        code, out, _ = axisbus("halt", file)
        assert code == 3
        assert "x: is at standstill" in out
        assert "q: NOT REACHED" in out
    finally:
        file.write_text(before)


def test_of_two_machines_of_one_simulated_cell_both_are_stopped(axisbus, moving, file):
    machine, _ = moving
    with Machine.open(file) as second:
        other = under_way(enabled(second["y"]))
        code, out, err = axisbus("stop", file)
        assert code == 0, err
        assert out.count("x: is at standstill") == out.count("y: is at standstill") == 2
        assert not other.active
    assert turns(machine) == pytest.approx(0.0, abs=0.1)


def test_a_claim_without_an_answer_reports_no_axis_as_stopped(axisbus, tmp_path):
    file = own_cell(tmp_path, "x")
    with claim(None, CellFileId.of(file), exclusive=False, accepts_clients=False):
        code, out, _ = axisbus("stop", file)
    assert (code, "NOT REACHED" in out) == (3, True)


# -- on a bus that others can reach ----------------------------------------------------------------------------------------------
