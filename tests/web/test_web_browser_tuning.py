"""Tuning in a real Chromium: trials with their questions, seen on the plant, ended by interruptions, and the display."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

if sys.platform != "linux":
    pytest.skip("a core in a process of its own is for Linux", allow_module_level=True)
pytest.importorskip("nicegui", reason="the page needs nicegui")
pytest.importorskip("selenium", reason="the browser is driven by selenium")

from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

from axisbus.machine.axis import Axis
from axisbus.motion.states import AxisState
from kit.accessibility import violations
from kit.browser import ENTER, MARKS, SPACE, TAB, Page, opened_page
from kit.served_page import until

pytestmark = MARKS
LIMITED = "position_limits = [-1000.0, 1000.0]"
ACCELERATION, QUICK = "1:6083:00", "1:6085:00"
HOSTILE = "<img src=x onerror=alert(1)>"
MOVE = {"distance": "20", "velocity": "60", "acceleration": "400", "seconds": "1"}
LONG = MOVE | {"distance": "200", "seconds": "6"}
# How much of the picture has the colour of a line.
INK = """
const canvas = document.querySelector('#response'), copy = document.createElement('canvas');
Object.assign(copy, { width: canvas.width, height: canvas.height });
const pen = copy.getContext('2d', { willReadFrequently: true });
pen.drawImage(canvas, 0, 0);
const name = arguments[0], probe = document.createElement('i');
probe.style.color = getComputedStyle(canvas).getPropertyValue(name);
document.body.append(probe);
const [r, g, b] = getComputedStyle(probe).color.match(/[0-9]+/g).map(Number);
probe.remove();
const { data } = pen.getImageData(0, 0, canvas.width, canvas.height);
let count = 0;
for (let i = 0; i < data.length; i += 4) if (data[i] === r && data[i + 1] === g && data[i + 2] === b) count += 1;
return count;
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    with opened_page(tmp_path_factory.mktemp("web"), LIMITED) as (at, page):
        yield SimpleNamespace(machine=at.machine, page=page, link=at.link)


@pytest.fixture
def at(scene: SimpleNamespace) -> SimpleNamespace:
    """The view of tuning, with the controls; axis x is at standstill and enabled, no gain is shown."""
    page, x = scene.page, scene.machine["x"]
    page.usual()
    page.take_controls()
    page.view("axis-x")
    if x.state is AxisState.ERRORSTOP:
        page.press("reset")
        until(lambda: x.state is AxisState.DISABLED)
    page.press("enable")
    until(lambda: x.state is AxisState.STANDSTILL)
    page.view("tuning")
    while away := page.driver.find_elements(By.XPATH, "//ul[@id='gains']//button[text()='Remove']"):
        press(page, away[0])
    page.told()
    return scene


def press(page: Page, node: Any) -> None:
    page.run("arguments[0].scrollIntoView({block: 'center'})", node)
    node.click()


def fill(page: Page, kind: str = "position", **values: str) -> None:
    Select(page.one("#tune-kind")).select_by_value(kind)
    for name, text in values.items():
        field = page.one(f"[data-step={name}] input")
        field.clear()
        field.send_keys(text)


def asked(page: Page) -> str:
    """Press *Try*, and return the question that it asks."""
    press(page, page.one("#tune-try"))
    until(lambda: page.one("#question").is_displayed())
    return page.text("#asked")


def begun(page: Page, axis: Axis, **values: str) -> None:
    """A trial whose axis moves."""
    fill(page, **values)
    asked(page)
    page.one("#yes").click()
    until(lambda: abs(axis.velocity) > 10.0)


def state(page: Page) -> str:
    return page.text("#tune-state")


def measured(page: Page, **values: str) -> None:
    """A whole trial."""
    count = rows(page)
    fill(page, **values)
    asked(page)
    page.one("#yes").click()
    until(lambda: state(page) == "Measured.", 10.0)
    assert rows(page) == count + 1


def rows(page: Page) -> int:
    return len(page.driver.find_elements(By.CSS_SELECTOR, "#trials tr"))


def newest(page: Page) -> str:
    return page.text("#trials tr")


def looked_at(page: Page, search: str, name: str) -> None:
    """Look at a gain."""
    field = page.one("#gain-search")
    field.send_keys(search)
    until(
        lambda: page.driver.find_elements(By.CSS_SELECTOR, f"#gains-found button[aria-label='Add {name}']"),
        10.0,
    )
    press(page, page.one(f"#gains-found button[aria-label='Add {name}']"))


def disturbed(page: Page, axis: Axis, words: str) -> None:
    until(lambda: words in state(page), 3.0)
    until(lambda: abs(axis.velocity) < 0.5, 2.0)
    time.sleep(0.5)
    assert abs(axis.velocity) < 0.5


def test_no_moves_nothing_and_the_question_names_all_values(at):
    page, x = at.page, at.machine["x"]
    before = x.position
    fill(page, **MOVE)
    words = asked(page)
    for each in ("x", "20 deg", "60 deg/s", "400 deg/s²", "-1000 to 1000 deg", "1 s"):
        assert each in words
    page.pictures("tuning-question")
    page.one("#no").click()
    time.sleep(0.5)
    assert x.position == pytest.approx(before, abs=0.1)
    assert rows(page) == 0


def test_a_yes_confirms_the_step_of_the_question(at):
    page, x = at.page, at.machine["x"]
    before = x.position
    fill(page, **MOVE)
    page.run(
        "const press = document.querySelector('#tune-try'), field = document.querySelector('[data-step=distance] input');"
        "press.click(); field.value = '-5'; press.click();"
    )
    until(lambda: page.one("#question").is_displayed())
    assert "Move x by -5 deg" in page.text("#asked")
    page.one("#yes").click()
    until(lambda: abs(x.position - before + 5.0) < 0.1)
    until(lambda: state(page) == "Measured.", 6.0)


def test_no_field_has_a_default_and_missing_values_are_reported(at):
    page = at.page
    fields = page.driver.find_elements(By.CSS_SELECTOR, "[data-step] input")
    for field in fields:
        field.clear()
    press(page, page.one("#tune-try"))
    until(lambda: "no distance given" in page.text("#told"))


def test_a_trial_is_measured_drawn_and_laid_over_a_pinned_one(at):
    page, x = at.page, at.machine["x"]
    looked_at(page, "profile acc", "Profile acceleration")
    looked_at(page, "6085", "Quick stop deceleration")
    before = at.machine.simulated_node(1).device.read(0x6085, 0)
    measured(page, **MOVE)
    assert x.state is AxisState.STANDSTILL
    assert "position 20 deg" in newest(page)
    assert f"6085h:00: {before} = " in newest(page)
    assert "there 0." in newest(page)
    until(lambda: page.run(INK, "--actual") > 100)
    assert page.run(INK, "--pinned") == 0
    press(page, page.one("#tune-pin"))
    measured(page, **MOVE | {"acceleration": "250"})
    until(lambda: page.run(INK, "--pinned") > 100)
    page.told()
    page.pictures("tuning")
    for width, scheme in ((1280, "light"), (390, "dark")):
        page.as_seen(width, scheme)
        assert violations(page) == []
    page.usual()
    press(page, page.one("#tune-unpin"))
    assert page.run(INK, "--pinned") == 0


def test_a_velocity_there_and_back(at):
    page, x = at.page, at.machine["x"]
    measured(page, kind="velocity", velocity="-30", acceleration="300", seconds="0.8")
    until(lambda: x.state is AxisState.STANDSTILL)
    assert "velocity -30 deg/s" in newest(page)
    page.pictures("tuning-velocity")


def test_a_gain_is_written_by_the_guarded_write_and_kept_by_the_browser(at):
    page, device = at.page, at.machine.simulated_node(1).device
    looked_at(page, "6085", "Quick stop deceleration")
    field = page.one(f"[data-gain-writes='{QUICK}']")
    field.send_keys("81000")
    press(page, page.one("button[aria-label='Write Quick stop deceleration']"))
    until(lambda: page.one("#question").is_displayed())
    assert "energised" in page.text("#asked")
    page.one("#yes").click()
    until(lambda: "read back" in page.text(f"[data-gain-said='{QUICK}']"))
    assert device.read(0x6085, 0) == 81000
    until(lambda: page.text(f"[data-gain='{QUICK}']").startswith("81000"))
    field = page.one(f"[data-gain-writes='{QUICK}']")
    field.clear()
    field.send_keys("-1")
    press(page, page.one("button[aria-label='Write Quick stop deceleration']"))
    until(lambda: "read back" not in page.text(f"[data-gain-said='{QUICK}']"))
    assert device.read(0x6085, 0) == 81000
    page.driver.refresh()
    until(lambda: page.driver.find_elements(By.CSS_SELECTOR, "#gains li") and not page.gone, 20.0)
    assert page.one("[data-view=tuning]").is_displayed()


@pytest.mark.parametrize("do", ["end", "space", "halt", "hidden", "cut", "covered", "fault"])
def test_any_interruption_of_a_trial_stops_the_plant_and_is_reported(at, do):
    page, x = at.page, at.machine["x"]
    begun(page, x, **LONG)
    if do == "end":
        press(page, page.one("#tune-end"))
        disturbed(page, x, "its page has ended it")
    elif do == "space":
        page.key(SPACE)
        disturbed(page, x, "halted, or stopped")
    elif do == "halt":
        page.press("halt_all")
        disturbed(page, x, "halted, or stopped")
    elif do == "hidden":
        page.run("Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
                 "document.dispatchEvent(new Event('visibilitychange')); delete document.hidden;")  # fmt: skip
        disturbed(page, x, "its page has ended it")
    elif do == "cut":
        page.run("sockets.filter((each) => each.url.endsWith('/live')).forEach((each) => each.close())")
        disturbed(page, x, "the connection was lost")
    elif do == "covered":
        page.run("open('/')")
        other = page.driver.window_handles[-1]
        first = page.driver.current_window_handle
        page.driver.switch_to.window(other)
        until(lambda: abs(x.velocity) < 0.5, 3.0)  # the first one is hidden by it
        page.driver.close()
        page.driver.switch_to.window(first)
        disturbed(page, x, "Disturbed")
    else:
        at.machine.simulated_node(1).fault(0x4310)
        disturbed(page, x, "Disturbed")
    if do != "cut":
        assert "disturbed, not measured" in newest(page)


def test_by_the_keyboard_alone(at):
    page, x = at.page, at.machine["x"]
    Select(page.one("#tune-kind")).select_by_value("position")
    for each in page.driver.find_elements(By.CSS_SELECTOR, "[data-step] input"):
        each.clear()
    page.run("arguments[0].focus()", page.one("#tune-kind"))
    for key in (TAB, "5", TAB, "50", TAB, "400", TAB, "0.5", TAB, ENTER):
        page.key(key)
    until(lambda: page.one("#question").is_displayed())
    for key in (TAB, ENTER):
        page.key(key)
    until(lambda: state(page) == "Measured.", 6.0)
    assert x.state is AxisState.STANDSTILL


def test_texts_of_files_and_drives_are_shown_as_text(at):
    page = at.page
    page.run("document.querySelector('#tune-kind')")
    field = page.one("#gain-search")
    field.send_keys(HOSTILE)
    until(lambda: page.text("#gain-state"), 5.0)
    field.clear()
    kept = '{"x": [{"key": "1:6083:00", "name": "' + HOSTILE + '"}, {"key": "junk"}, 7, null], "y": 3}'
    page.run("localStorage.setItem('axisbus.tuning.' + arguments[0], arguments[1])",
             page.run("return document.querySelector('[data-view=tuning]').dataset.cell"), kept)  # fmt: skip
    page.driver.refresh()
    until(lambda: page.driver.find_elements(By.CSS_SELECTOR, "#gains li") and not page.gone, 20.0)
    assert page.driver.find_elements(By.CSS_SELECTOR, "#gains img") == []
    assert HOSTILE in page.text("#gains")
    page.run(
        "localStorage.removeItem('axisbus.tuning.' + document.querySelector('[data-view=tuning]').dataset.cell)"
    )
    page.driver.refresh()
    until(lambda: page.driver.find_elements(By.CSS_SELECTOR, "[data-view=cell]") and not page.gone, 20.0)


def test_the_console_of_the_browser_stays_empty(scene):
    told = [entry for entry in scene.page.driver.get_log("browser") if "/enter" not in entry["message"]]
    assert told == []
