"""The content of the page, on a simulated cell: values that are never passed off as fresh, and errors with their remedy."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from axisbus.cia301.nmt import NmtCommand
from axisbus.eds import builtin, load
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.sim.build import device_from_eds
from axisbus.web.page.axis_view import svg
from axisbus.web.view import all_axes, whole_cell
from kit.cell import GENERIC, cell_file, cell_text

# The states and their transitions, typed off from CiA 402-2, figure of 7.2; 0 has no source in it, 9, 10 and 8 are not drawn.
STATES = """\
not ready to switch on,1
switch on disabled,2
ready to switch on,3 7
switched on,4 6
operation enabled,5 11
quick stop active,12 16
fault reaction active,14 13
fault,15
"""


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    path = cell_file(tmp_path, "xy", axis="rated_torque = 10.0")
    with Machine.simulated(path) as machine:
        yield machine


def now(machine: Machine) -> float:
    return machine["x"].snapshot.now


def test_an_axis_has_its_states_and_values_with_their_ages(machine):
    machine["x"].enable().wait()
    machine["x"].move_absolute(12.5).wait()
    seen = all_axes(machine, now(machine))
    x = seen["x"]
    assert (x["state"], x["power"], x["mode"], x["known"]) == (
        "Standstill",
        "operation enabled",
        "mode pp",
        True,
    )
    assert float(str(x["position"])) == pytest.approx(12.5, abs=0.05)
    assert re.fullmatch(r"\d+ ms", str(x["position_age"]))
    assert x["error"] is None
    assert seen["y"]["state"] == "Disabled"
    json.dumps(seen)


@pytest.mark.parametrize(("late", "known"), [(0.5, True), (1.5, False), (3600.0, False)])
def test_an_old_value_is_not_shown_as_current(machine, late, known):
    x = all_axes(machine, now(machine) + late)["x"]
    assert x["known"] == known
    for key in ("state", "power", "homed", "position", "velocity", "torque"):
        assert (x[key] == "unknown") != known
    assert float(str(x["image_age"]).split()[0]) == pytest.approx(
        late if late > 1.0 else late * 1000, rel=0.1
    )


def test_after_the_machine_is_closed_nothing_is_known(machine):
    machine.close()
    x = all_axes(machine, now(machine) + 2.0)["x"]
    assert not x["known"]
    assert x["position"] == "unknown"


def test_how_a_machine_ended_is_still_reported(machine):
    assert whole_cell(machine, [], now(machine))["command"] == {"ours": True, "by": "nobody"}
    machine.close()
    seen = whole_cell(machine, ["ended"], now(machine))
    assert seen["beside"][0] == "ended"
    assert seen["command"] == {"ours": True, "by": ""}


def test_a_silent_drive_has_no_position(machine):
    machine["x"].enable().wait()
    machine.simulated_node(1).device.dials.dead = True
    machine.sleep(3.0)
    x = all_axes(machine, now(machine))["x"]
    machine.simulated_node(1).device.dials.dead = False  # its standstill could not be seen during closing
    machine.sleep(1.0)
    assert x["position"] == "unknown"
    assert x["position_age"] == ""
    assert x["state"] == "ErrorStop"


def test_a_fault_is_reported_with_cause_and_remedy_before_earlier_ones(machine):
    quiet = whole_cell(machine, ["bus: fine"], now(machine))
    assert quiet["incidents"] == []
    assert quiet["beside"] == ["bus: fine"]
    machine["x"].enable().wait()
    machine.simulated_node(1).fault(0x4310)
    machine.sleep(0.5)
    assert machine["x"].state is AxisState.ERRORSTOP
    first, *rest = whole_cell(machine, [], now(machine))["incidents"]
    assert first["ago"] == "now"
    assert first["what"].startswith("x: ")
    assert "4310" in first["lines"][0]
    assert "cool down" in first["remedy"]
    assert any(
        one["what"].startswith("node 1, incident 1: unresolved") and "4310" in one["lines"][0] for one in rest
    )
    json.dumps(first)


def test_nodes_are_reported_with_identity_state_and_error(machine):
    one, two = whole_cell(machine, [], now(machine))["nodes"]
    assert (one["node"], two["node"]) == (1, 2)
    assert one["nmt"] == "operational"
    assert one["identity"].startswith("vendor")
    assert one["boot"] == "the node is booted"
    assert one["axes"] == ["x"]
    assert one["wrong"] is None


def test_a_node_in_fault_or_lost_is_reported_with_its_error(machine):
    def wrong() -> list[dict[str, str] | None]:
        return [each["wrong"] for each in whole_cell(machine, [], now(machine))["nodes"]]

    assert wrong() == [None, None]
    machine.simulated_node(1).fault(0x4310)
    machine.sleep(0.5)
    of_x, of_y = wrong()
    assert of_x is not None
    assert of_x["message"] == "x: the drive went into fault"
    assert of_x["page"] == "too-hot"
    assert of_y is None
    machine["x"].reset().wait()
    machine.simulated_node(2).device.dials.dead = True
    machine.sleep(3.0)
    of_x, of_y = wrong()
    machine.simulated_node(2).device.dials.dead = False
    machine.sleep(1.0)
    assert of_x is None
    assert of_y is not None
    assert "node 2 is lost" in of_y["message"]


def test_a_node_without_axes_is_wrong_while_it_is_not_operational(machine):
    report = next(each for each in machine.reports if each.node_id == 2)
    axes, report.axes[:] = list(report.axes), []
    machine.node(2).command(NmtCommand.ENTER_PRE_OPERATIONAL)
    machine.sleep(0.2)
    wrong = whole_cell(machine, [], now(machine))["nodes"][1]["wrong"]
    report.axes[:] = axes
    assert wrong is not None
    assert "pre-operational" in wrong["message"]


def test_the_diagram_has_each_state_once_and_each_transition():
    drawn = svg()
    rows = list(csv.reader(io.StringIO(STATES)))
    assert re.findall(r'data-power="([^"]+)"', drawn) == [state for state, _ in rows]
    numbers = sorted(number for _, each in rows for number in each.split())
    assert sorted(re.findall(r'class="number"[^>]*>(\d+)<', drawn)) == numbers


def test_incidents_are_reported_newest_first(machine):
    x = machine["x"]
    for code in (0x4310, 0x2310):
        machine.simulated_node(1).fault(code)
        machine.sleep(0.5)
        x.reset().wait()
        machine.sleep(0.5)
    told = [one["what"] for one in whole_cell(machine, [], now(machine))["incidents"]]
    assert [what.partition(":")[0] for what in told] == ["node 1, incident 2", "node 1, incident 1"]
    assert all("recovered after" in what for what in told)


def test_a_node_that_is_not_there_and_an_axis_without_a_drive_are_shown_too(tmp_path):
    more = '\n[axes.v]\nvirtual = true\nunit = "deg"\nscale = 100\n[axes.v.defaults]\nvelocity = 50.0\nacceleration = 100.0\n'
    path = tmp_path / "cell.toml"
    path.write_text(
        cell_text("xy", more=more).replace("[nodes.2]\n", "[nodes.2]\noptional = true\n"), encoding="utf-8"
    )
    eds = load(builtin.resolve(GENERIC, Path()))
    devices = {node_id: device_from_eds(eds, node_id) for node_id in (1, 2)}
    devices[2].dials.dead = True
    with Machine.simulated(path, devices) as machine:
        _, absent = whole_cell(machine, [], now(machine))["nodes"]
        assert (absent["letter"], absent["nmt"]) == ("B", "unknown")
        assert "it is optional" in absent["wrong"]["message"]
        axes = all_axes(machine, now(machine))
        assert list(axes) == ["x", "v"]
        assert axes["v"]["torque"] == "unknown"
        assert float(axes["v"]["position"]) == 0.0
