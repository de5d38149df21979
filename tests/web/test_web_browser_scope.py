"""The scope of the page in a real Chromium: its drawings and files are compared with the values seen by the machine's program."""

from __future__ import annotations

import csv
import io
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from types import SimpleNamespace

import pytest

if sys.platform != "linux":
    pytest.skip("a core in a process of its own is for Linux", allow_module_level=True)
pytest.importorskip("nicegui", reason="the page needs nicegui")
pytest.importorskip("selenium", reason="the browser is driven by selenium")

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.support.select import Select

from kit.browser import ENTER, MARKS, SPACE, Page, opened_page
from kit.served_page import until

pytestmark = MARKS


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    with opened_page(tmp_path_factory.mktemp("web")) as (at, page):
        page.view("scope")
        page.press("take")
        until(lambda: page.one("[data-do=give_back]").is_displayed())
        page.view("axis-x")
        page.press("enable")
        until(lambda: page.text(".state") == "Standstill")
        yield SimpleNamespace(machine=at.machine, page=page, x=at.machine["x"])


@pytest.fixture
def scope(scene: SimpleNamespace) -> SimpleNamespace:
    """The view of the scope, running, of position and velocity of x, without a trigger."""
    page = scene.page
    page.view("scope")
    for box in page.driver.find_elements("css selector", "[data-signal]"):
        wanted = box.get_attribute("data-signal") in ("x.position", "x.velocity")
        if box.is_selected() != wanted:
            box.click()
    for name, value in (("trigger", ""), ("span", "5")):
        chosen(page, name, value)
    if page.text("#run") == "Run":
        page.one("#run").click()
    until(lambda: page.run("return axisbusScope.count()") > 20)
    return scene


def chosen(page: Page, name: str, value: str) -> None:
    Select(page.one(f"#{name}")).select_by_value(value)


def saved(page: Page) -> tuple[list[str], list[list[float]]]:
    """The file of "Save CSV": the head and the rows."""
    head, *rows = csv.reader(io.StringIO(page.run("return axisbusScope.csv()")))
    return head, [[float(each) for each in row] for row in rows]


def moved(scene: SimpleNamespace, distance: float) -> None:
    """Let the page move the axis, and wait for standstill; then show the scope again."""
    page, begin = scene.page, scene.x.position
    page.view("axis-x")
    page.type("distance", str(distance))
    page.press("move_relative")
    page.view("scope")
    until(lambda: abs(scene.x.position - begin - distance) < 0.1, 10.0)
    time.sleep(0.3)


def test_every_cycle_of_a_move_is_there_once_with_its_values(scope):
    seen = []
    scope.machine.session.observe(observer := lambda now, images: seen.append((now, images["x"].position)))
    moved(scope, 30.0)
    scope.machine.session.forget(observer)
    scope.page.one("#run").click()
    head, rows = saved(scope.page)
    assert head == ["time [s]", "x.position [deg]", "x.velocity [deg/s]"]
    taller = "return axisbusScope.png().height - document.querySelector('#picture').height"
    assert scope.page.run(taller) > 15  # pixels, for the names of the lines
    assert not [each for row in rows for each in row[1:] if len(repr(each).strip("-0.").replace(".", "")) > 9]
    steps = [after[0] - before[0] for before, after in pairwise(rows)]
    assert min(steps) > 0.0
    drawn = [row[0] for row in rows]  # with six digits
    during = [now for now, _ in seen if rows[0][0] < now < rows[-1][0]]
    assert len(during) > 20
    assert [now for now in during if min(abs(now - each) for each in drawn) > 2e-6] == []
    assert max(row[1] for row in rows) - min(row[1] for row in rows) == pytest.approx(30.0, abs=0.5)
    assert max(row[2] for row in rows) > 10.0


def test_a_trigger_catches_the_beginning_of_a_move_and_stops(scope):
    page = scope.page
    chosen(page, "span", "1")
    chosen(page, "trigger", "single")
    chosen(page, "trigger-on", "x.velocity")
    chosen(page, "edge", "rising")
    level = page.one("#level")
    level.clear()
    level.send_keys("5", ENTER)
    time.sleep(0.5)
    assert "Waiting for the trigger" in page.text("#scope-state")
    moved(scope, 30.0)
    until(lambda: page.text("#run") == "Run")
    _, rows = saved(page)
    crossing = next(row[0] for row in rows if row[2] >= 5.0)
    assert crossing - rows[0][0] == pytest.approx(0.25, abs=0.06)
    assert rows[-1][0] - rows[0][0] == pytest.approx(1.0, abs=0.06)


def test_cursors_report_the_difference_and_a_wheel_zooms(scope):
    page = scope.page
    chosen(page, "span", "2")
    moved(scope, -30.0)
    picture = page.one("#picture")
    wide = picture.size["width"]
    hand = ActionChains(page.driver)
    hand.move_to_element_with_offset(picture, -wide // 4, 0).click()
    hand.key_down("\ue008").move_to_element_with_offset(picture, wide // 4, 0).click().key_up(
        "\ue008"
    ).perform()
    until(lambda: page.text("#traces tr td:nth-child(5)"))
    a, b, apart = (float(page.text(f"#traces tr td:nth-child({n})")) for n in (3, 4, 5))
    assert apart == pytest.approx(b - a, abs=1e-3)
    words = page.text("#scope-state")
    assert "B − A" in words
    assert page.text("#run") == "Run"
    before = saved(page)[1]
    _zoomed(page)
    after = saved(page)[1]
    assert len(after) < len(before)
    page.pictures("scope")


def _zoomed(page: Page) -> None:
    """Turn the wheel by one notch, with the mouse in the middle of the picture."""
    page.run(
        "const box = arguments[0].getBoundingClientRect(), x = box.left + box.width / 2;"
        "arguments[0].dispatchEvent(new WheelEvent('wheel', {deltaY: -1, clientX: x, bubbles: true, cancelable: true}))",
        page.one("#picture"),
    )


def test_the_choice_is_kept_and_the_space_bar_ticks_no_box(scope):
    page = scope.page
    box = page.one("[data-signal='y.position']")
    page.run("arguments[0].focus()", box)
    page.key(SPACE)
    assert not box.is_selected()
    page.run("arguments[0].focus()", box)
    page.key(ENTER)
    until(box.is_selected)
    page.driver.refresh()
    until(lambda: page.driver.find_elements("css selector", "[data-signal]") and not page.gone, 20.0)
    page.view("scope")
    until(lambda: page.one("[data-signal='y.position']").is_selected())
    until(lambda: page.run("return axisbusScope.count()") > 10)
    assert saved(page)[0] == ["time [s]", "x.position [deg]", "x.velocity [deg/s]", "y.position [deg]"]


def test_the_console_of_the_browser_stays_empty(scene):
    told = [entry for entry in scene.page.driver.get_log("browser") if "/enter" not in entry["message"]]
    assert told == []
