"""A page boots a node of the running machine: who may, which node is offered, the steps, and the error of a boot-up."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.web.commands.clients import PageClient
from axisbus.web.view import explained, whole_cell
from kit.core_in_threads import core_in_threads
from kit.page_clients import Pages
from kit.scenarios.core_process import OWN_PROCESS, enabled, own_cell

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]


@pytest.fixture
def pages(tmp_path: Path) -> Iterator[Pages]:
    file = own_cell(tmp_path)
    file.write_text(file.read_text("utf-8").replace("[bus]\n", '[bus]\non_lost_node = "report"\n'), "utf-8")
    with core_in_threads(), Machine.open(file) as machine:
        yield Pages(machine)


def offered(pages: Pages) -> list[int]:
    """The nodes that the pages offer to boot."""
    nodes = whole_cell(pages.machine, [], time.monotonic())["nodes"]
    assert isinstance(nodes, list)
    return [node["node"] for node in nodes if node["needs_boot"]]


class Steps(dict[int, str]):
    """The steps of the boot-ups under way; records each."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[str] = []

    def __setitem__(self, node: int, step: str) -> None:
        super().__setitem__(node, step)
        self.seen.append(step)


def wait_for_end(pages: Pages, place: PageClient) -> None:
    """Let time pass until no boot-up runs."""
    until = time.monotonic() + 30.0
    while pages.desk.boots.unread():
        assert time.monotonic() < until
        time.sleep(0.01)
    pages.pass_(0.1)
    assert not place.running


def test_a_page_with_the_controls_boots_a_node_that_has_lost_its_supply(pages):
    place, machine = pages.operator(), pages.machine
    assert offered(pages) == []
    enabled(machine["y"]).move_velocity(30.0).wait(10)
    machine.simulated_node(1).switch_off()
    machine.sleep(5.0)
    assert offered(pages) == [1]
    machine.simulated_node(1).switch_on()
    machine.sleep(1.0)
    assert offered(pages) == [1]
    error = machine["x"].error
    assert error is not None
    assert "boot it (Boot node 1 in the view Cell)" in explained(error)["remedy"]
    pages.desk.boots._steps = steps = Steps()
    pages.ask(place, "boot", node=1)
    assert [boot["node"] for boot in pages.desk.boots.unread()] == [1]
    wait_for_end(pages, place)
    assert steps.seen == [
        *("waiting for its axes", "step find", "step identity", "step state", "step pre-operational"),
        *("step program", "step restore", "step configuration", "step error control", "step completion"),
        "step start",
    ]
    assert pages.told(place) == []
    machine.sleep(0.5)
    assert offered(pages) == []
    assert machine["x"].state is AxisState.ERRORSTOP
    assert machine["y"].state is AxisState.CONTINUOUS_MOTION
    pages.ask(place, "reset", "x")
    pages.pass_(0.5)
    assert machine["x"].state is AxisState.DISABLED


def test_without_the_controls_no_node_is_booted(pages):
    pages.ask(place := pages.admit(), "boot", node=1)
    assert pages.told(place) == [("refused", "no page has the controls")]
    assert pages.desk.boots.unread() == []


def test_the_error_of_a_boot_up_is_shown_and_it_may_be_tried_again(pages):
    place, machine = pages.operator(), pages.machine
    machine.simulated_node(1).switch_off()
    machine.sleep(5.0)
    pages.ask(place, "boot", node=1)
    pages.ask(place, "boot", node=1)
    assert pages.told(place) == [("refused", "node 1 is already being booted")]
    wait_for_end(pages, place)
    [(kind, text)] = pages.told(place)
    assert kind == "failed"
    assert "node 1 does not answer" in text
    assert offered(pages) == [1]
    machine.simulated_node(1).switch_on()
    machine.sleep(1.0)
    pages.ask(place, "boot", node=1)
    wait_for_end(pages, place)
    assert pages.told(place) == []
    machine.sleep(0.5)
    assert offered(pages) == []


def test_a_node_with_an_enabled_axis_and_a_node_that_the_cell_does_not_have_are_refused(pages):
    place = pages.operator()
    enabled(pages.machine["x"])
    pages.ask(place, "boot", node=1)
    wait_for_end(pages, place)
    [(kind, text)] = pages.told(place)
    assert kind == "failed"
    assert "node 1 cannot be booted now" in text
    assert pages.machine["x"].state is AxisState.STANDSTILL
    pages.ask(place, "boot", node=9)
    assert pages.told(place)[0][0] == "refused"
