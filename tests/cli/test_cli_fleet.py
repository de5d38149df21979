"""``axisbus fleet`` with fake cells: the report of a plant, and the confirmed stops."""

from __future__ import annotations

import json
import re
import sys

import pytest
from rich.console import Console

pytest.importorskip("zenoh", reason="a fleet needs eclipse-zenoh")

from axisbus.cli.fleet import live
from axisbus.fleet.fleet import Fleet
from axisbus.fleet.messages import PROTOCOL
from kit.fleet.zenoh_network import Plant, free_endpoint
from kit.served_page import until


@pytest.fixture
def plant():
    plant = Plant()
    yield plant
    plant.end()


def way(plant):
    return ["--plant", plant.name, *(word for each in plant.endpoints for word in ("--connect", each))]


def test_list_prints_cells_axes_incidents_and_recordings(axisbus, plant):
    press, saw = plant.cell("press", ("x", "y")), plant.cell("saw", version="0.0.1")
    press.happen("the drive has \x1b[2Jstopped")
    code, out, err = axisbus("fleet", "list", *way(plant))
    assert (code, err) == (0, "")
    assert re.search(r"^press: alive, simulated$", out, re.M)
    assert re.search(r"^  x +Standstill +0\.000 deg +0\.000 deg/s +\d+ ms", out, re.M)
    assert "the drive has  [2Jstopped" in out  # nothing of a plant moves the cursor of a terminal
    assert "cause: a cause" in out
    assert "remedy: a remedy" in out
    assert "1 recording, 0.0 MB, the newest run.mcap" in out
    assert "VERSION DIFFERS: axisbus 0.0.1" in out
    assert saw.name in out


def test_an_invalid_time_of_an_event_does_not_break_the_list(axisbus, plant, monkeypatch):
    press = plant.cell("press")
    with monkeypatch.context() as mad:
        mad.setattr("time.time", lambda: 1e20)
        press.happen("the drive has stopped")
    code, out, _ = axisbus("fleet", "list", *way(plant))
    assert (code, "--:--:-- " in out, "the drive has stopped" in out) == (0, True, True)


def test_list_as_json_has_no_value_that_is_not_known(axisbus, plant):
    press = plant.cell("press")
    press.silent = True
    plant.cell("saw")
    code, out, _ = axisbus("fleet", "list", *way(plant), "--json")
    found = {cell["cell"]: cell for cell in json.loads(out)}
    assert code == 0
    assert found["press"]["axes"][0]["position"] is None
    assert found["press"]["axes"][0]["unit"] == "deg"
    assert found["saw"]["axes"][0]["position"] == 0.0
    assert found["saw"]["recordings"][0]["name"] == "run.mcap"
    assert found["saw"]["differs"] is None


def test_a_plant_without_cells_is_reported(axisbus):
    nobody = ["--plant", "hall", "--listen", free_endpoint()]
    code, out, _ = axisbus("fleet", "list", *nobody)
    assert (code, "no cell of plant hall was found" in out) == (1, True)
    code, _, err = axisbus("fleet", "stop", *nobody)
    assert (code, "none was stopped" in err) == (1, True)


def test_without_an_endpoint_the_command_is_misuse(axisbus):
    for command in ("list", "watch", "stop"):
        code, _, err = axisbus("fleet", command, "--plant", "hall")
        assert (code, "--listen" in err) == (2, True)
        assert axisbus("fleet", command, "--plant", "ha/ll", "--listen", free_endpoint()).code == 2


def test_stop_reports_for_each_cell_if_it_was_confirmed(axisbus, plant):
    press, saw = plant.cell("press"), plant.cell("saw")
    code, out, _ = axisbus("fleet", "stop", *way(plant))
    assert (code, out) == (0, "press: stopped (it stands)\nsaw: stopped (it stands)\n")
    saw.dumb = 1000
    code, out, err = axisbus("fleet", "stop", *way(plant), "--wait", "0.5")
    assert code == 3
    assert "press: stopped" in out
    assert "saw: NOT CONFIRMED: no answer in time" in out
    assert err == ""
    assert axisbus("fleet", "stop", "press", *way(plant)).code == 0
    assert press.stopped["quick_stop_all"] == 3
    code, out, _ = axisbus("fleet", "stop", "press", "mill", *way(plant))
    assert (code, "mill: NOT CONFIRMED" in out) == (3, True)


def test_an_unreachable_endpoint_is_reported_and_a_stop_of_all_has_failed(axisbus, plant):
    plant.cell("press")
    plant.endpoints.append(nobody := free_endpoint())
    code, out, err = axisbus("fleet", "list", *way(plant))
    assert (code, "press: alive" in out) == (1, True)
    assert f"NOT REACHED: {nobody}" in err
    code, out, _ = axisbus("fleet", "stop", *way(plant))
    assert code == 3
    assert "press: stopped" in out
    assert f"NOT REACHED: {nobody}: its cells were not stopped" in out
    assert axisbus("fleet", "stop", "press", *way(plant)).code == 0
    code, out, _ = axisbus("fleet", "watch", *way(plant), "--count", "1")
    assert (code, f"NOT REACHED: {nobody}" in out) == (0, True)


def test_watch_looks_again_and_again(axisbus, plant):
    plant.cell("press")
    code, out, _ = axisbus("fleet", "watch", *way(plant), "--count", "2", "--every", "0.1")
    assert (code, out.count("press: alive")) == (0, 2)
    code, out, _ = axisbus("fleet", "watch", *way(plant), "--count", "1", "--json")
    assert json.loads(out)[0]["cell"] == "press"


def test_on_a_terminal_a_lost_cell_and_its_unknown_values_are_shown_as_such(plant, capsys):
    press = plant.cell("press", protocol=PROTOCOL + 1)
    press.happen("the drive has stopped")
    with Fleet(plant.name, connect=plant.endpoints) as fleet:
        until(lambda: fleet["press"].events and fleet["press"].last_state("x"))
        live.show(lambda: [(cell, ()) for cell in fleet], lambda: ["plant hall"], 0.0, 1)
        seen = capsys.readouterr().out
        assert "1 of 1 cell alive" in seen
        assert "Standstill" in seen
        assert "VERSION DIFFERS" in seen
        press.cut()
        until(lambda: not fleet["press"].bridge_online)
        live.show(lambda: [(cell, ()) for cell in fleet], lambda: ["plant hall", "NOT REACHED"], 0.0, 1)
        seen = capsys.readouterr().out
        assert "0 of 1 cell alive" in seen
        assert "NOT REACHED" in seen
        assert "GONE for" in seen
        assert "Standstill" not in seen
        assert "unknown" in seen


def test_in_a_small_terminal_cells_with_errors_are_not_cut_off(plant, capsys):
    many = [plant.cell(f"cell-{number:02}") for number in range(14)]
    many[12].happen("the drive has stopped")
    with Fleet(plant.name, connect=plant.endpoints) as fleet:
        until(lambda: len(fleet) == 14 and fleet["cell-12"].incidents)
        many[13].cut()
        until(lambda: not fleet["cell-13"].alive)
        drawn = Console(width=80, height=12)
        drawn.print(*live._parts([(cell, ()) for cell in fleet], "plant hall"), sep="\n")
    first = capsys.readouterr().out.splitlines()[:11]
    assert any(line.startswith("cell-13  ") and "GONE" in line for line in first)
    assert any("cell-12" in line and "the drive has stopped" in line for line in first)


def test_without_zenoh_the_error_names_the_package_to_install(axisbus, monkeypatch):
    monkeypatch.setitem(sys.modules, "zenoh", None)
    code, _, err = axisbus("fleet", "list", "--plant", "hall", "--listen", free_endpoint())
    assert (code, 'pip install "axisbus[zenoh]"' in err) == (1, True)
