"""Limits as bars, a torque, the command of the machine and axes that join, on the page in a real Chromium; judged on the plants."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

if sys.platform != "linux":
    pytest.skip("a core in a process of its own is for Linux", allow_module_level=True)
pytest.importorskip("nicegui", reason="the page needs nicegui")
pytest.importorskip("selenium", reason="the browser is driven by selenium")

from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.web import address
from axisbus.web.access.tokens import Role
from axisbus.web.server import PageServer
from kit.browser import ENTER, MARKS, SPACE, TAB, Page, chromium, opened_page
from kit.scenarios.core_process import turns
from kit.scenarios.simulated_bus import Line
from kit.served_page import until

pytestmark = MARKS
LIMITED = "max_torque = 5.0\nposition_limits = [-20000.0, 20000.0]\nfollowing_error = 100.0"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    folder = tmp_path_factory.mktemp("web")
    with opened_page(folder, LIMITED) as (at, page):
        yield SimpleNamespace(machine=at.machine, page=page, file=folder / "cell.toml")


@pytest.fixture
def x(scene: SimpleNamespace) -> Iterator[SimpleNamespace]:
    """The view of axis x, enabled, with the controls; at the end it is at standstill."""
    page, axis = scene.page, scene.machine["x"]
    page.usual()
    page.operate(axis)
    yield SimpleNamespace(
        page=page, axis=axis, machine=scene.machine, speed=lambda: abs(turns(scene.machine))
    )
    page.press("halt_all")
    until(lambda: abs(turns(scene.machine)) < 0.1)


def bar(page: Page, name: str) -> SimpleNamespace:
    """The content of a bar: its attributes as a meter, its words, and the position of its mark, as a share of its length."""
    track = page.one(f"[data-bar={name}] .track")
    seen = page.run(
        "const [track] = arguments, [a, b] = [track, track.children[1]].map((each) => each.getBoundingClientRect());"
        "return [track.getAttribute('aria-valuenow'), track.getAttribute('aria-valuetext'), track.role,"
        "(b.left + b.width / 2 - a.left) / a.width]",
        track,
    )
    return SimpleNamespace(
        now=float(seen[0]), text=seen[1], role=seen[2], at=seen[3], shown=track.is_displayed()
    )


def test_a_bar_shows_the_position_of_a_value_within_its_limits(x):
    x.page.type("velocity", "-380")
    x.page.press("move_velocity")
    until(lambda: x.speed() > 370)
    until(lambda: bar(x.page, "velocity").now < -375.0)
    velocity = bar(x.page, "velocity")
    assert velocity.role == "meter"
    assert velocity.text.endswith("deg/s, near its limit")
    assert velocity.at == pytest.approx(20 / 800, abs=0.02)
    assert x.page.text("[data-bar=velocity] em") == "near its limit"
    x.page.pictures("bars")
    x.page.press("halt")
    until(lambda: x.speed() < 0.1)
    until(lambda: x.page.text("[data-bar=velocity] em") == "")
    until(lambda: bar(x.page, "velocity").at == pytest.approx(0.5, abs=0.02))
    assert x.page.text("[data-bar=following_error] em") == "applies while it follows position set-points"


def test_a_torque_needs_confirmation_and_the_space_bar_ends_it(x):
    x.page.type("torque", "0,3")
    x.page.type("slope", "50")
    button = x.page.one("[data-do=torque_control]")
    button.click()
    assert "Apply 0,3 N·m to x?" in x.page.text("#asked")
    x.page.pictures("question")
    x.page.key(ENTER)  # the focus is on No
    time.sleep(0.3)
    assert x.speed() < 0.1
    button.click()
    x.page.key(TAB)
    x.page.key(ENTER)
    until(lambda: x.speed() > 5.0)
    x.page.key(SPACE)
    until(lambda: x.speed() < 0.1)
    until(lambda: x.axis.state is AxisState.DISABLED)


def test_a_torque_beyond_the_limit_is_refused_in_the_words_of_the_library(x):
    x.page.type("torque", "6")
    x.page.press("torque_control")
    until(lambda: "max_torque is 5 N·m" in x.page.text("#told"))
    assert x.speed() < 0.1


def test_control_that_another_program_took_is_taken_back(scene, x):
    assert not x.page.one("#command").is_displayed()
    with Machine.attach(scene.file, command=True, force=True) as other:
        until(lambda: x.page.one("#command").is_displayed())
        # For a moment it belongs to nobody: the axes halt before it is given to the other program.
        until(lambda: "control of the machine belongs to process" in x.page.text("#commanded"))
        x.page.type("velocity", "50")
        x.page.press("move_velocity")
        until(lambda: "control" in x.page.text("#told"))
        x.page.pictures("command")
        moving = other["x"].move_velocity(60.0)
        until(lambda: x.speed() > 55.0)
        x.page.told()
        x.page.one("[data-do=take_command]").click()
        x.page.key(ENTER)  # the focus is on No
        time.sleep(0.3)
        assert other.has_control
        x.page.press("take_command")
        until(lambda: x.speed() < 0.1)
        until(lambda: not x.page.one("#command").is_displayed())
        assert not other.has_control
        moving.exception()
        x.page.press("move_velocity")
        until(lambda: x.speed() > 45.0)


# -- axes that join ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def late(tmp_path: Path) -> Iterator[SimpleNamespace]:
    """A page of a machine whose second axis is not there yet."""
    with Line(tmp_path, "xy", heartbeat="1s") as line:
        text = line.file.read_text("utf-8").replace("[nodes.2]\n", "[nodes.2]\noptional = true\n")
        line.file.write_text(text, encoding="utf-8")
        line.devices["y"].dials.dead = True
        listening, where = address.opened("127.0.0.1", 0, tls=False)
        with line.open() as machine:
            server = PageServer(machine, where, listening, None, list)
            server.begin()
            driver = chromium()
            try:
                yield SimpleNamespace(
                    line=line, machine=machine, page=Page(driver, server.link(Role.OPERATOR))
                )
            finally:
                driver.quit()
                server.end()


def test_an_axis_that_joins_appears_on_the_open_page(late):
    page, y = late.page, "[data-view='axis-y']"
    assert not page.driver.find_elements("css selector", "nav a[href='#axis-y']")
    page.view("axis-x")
    page.type("position", "12")
    assert not page.driver.find_elements("css selector", y)
    late.line.devices["y"].dials.dead = False
    until(lambda: page.driver.find_elements("css selector", y), 20.0)
    assert page.one("[data-view='axis-x']").is_displayed()
    assert not page.driver.find_element("css selector", y).is_displayed()
    assert page.one("fieldset:not([data-values]) [data-value=position]").get_attribute("value") == "12"
    page.press("take")
    page.view("axis-y")
    until(lambda: page.text(".state") == "Disabled")
    page.press("enable")
    until(lambda: page.text(".state") == "Standstill")
    page.type("distance", "5")
    page.press("move_relative")
    until(lambda: page.text("[data-live='y.position']").startswith(("4.9", "5.0")), 10.0)
    page.pictures("joined")
    page.view("scope")
    page.one("[data-signal='y.position']").click()
    until(lambda: "y.position" in page.text("#traces"))
    assert [entry for entry in page.driver.get_log("browser") if "/enter" not in entry["message"]] == []
