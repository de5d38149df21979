"""The objects of the page in a real Chromium, with values compared to those of the simulated drive."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

if sys.platform != "linux":
    pytest.skip("a core in a process of its own is for Linux", allow_module_level=True)
pytest.importorskip("nicegui", reason="the page needs nicegui")
pytest.importorskip("selenium", reason="the browser is driven by selenium")

from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.select import Select

from axisbus.cia301 import abort
from axisbus.machine.axis import Axis
from axisbus.motion.states import AxisState
from kit.accessibility import violations
from kit.browser import ENTER, MARKS, SPACE, TAB, Page, opened_page
from kit.served_page import until

pytestmark = MARKS
ACCELERATION, POSITION = "1:6083:00", "1:6064:00"
DRAWN = """
const texts = (nodes) => [...nodes].map((node) => node.firstChild.textContent);
const pdos = [...document.querySelectorAll('#part-pdos .pdo')];
return pdos.map((pdo) => [...texts([pdo.querySelector('h2')]), texts(pdo.querySelectorAll('.slot'))]);
"""
DOWN, RIGHT, LEFT = "\ue015", "\ue014", "\ue012"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    with opened_page(tmp_path_factory.mktemp("web")) as (at, page):
        yield SimpleNamespace(machine=at.machine, page=page, link=at.link)


@pytest.fixture
def at(scene: SimpleNamespace) -> SimpleNamespace:
    """The dictionary of node 1, with the controls; nothing is looked for, nothing is kept being read."""
    page, dials = scene.page, scene.machine.simulated_node(1).device.dials
    page.usual()
    dials.sdo_aborts, dials.sdo_silent = {}, False
    page.take_controls()
    page.view("objects")
    until(lambda: "objects by" in page.text("#objects-state"), 10.0)
    press(page, page.one("[data-part=dictionary]"))
    while ends := page.driver.find_elements(By.CSS_SELECTOR, "#kept button"):
        press(page, ends[0])
    sought(page, "")
    page.told()
    return scene


def press(page: Page, node: WebElement) -> None:
    """Press something, wherever on the page it is: the head that stays on screen may lie over it."""
    page.run("arguments[0].scrollIntoView({block: 'center'})", node)
    node.click()


def sought(page: Page, text: str) -> list[str]:
    """Search, and return the indices that are shown."""
    field = page.one("#object-search")
    page.run("arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))", field, text)
    return list(
        page.run("return [...document.querySelectorAll('#tree .branch')].map((each) => each.dataset.index)")
    )


def opened(page: Page, index: str) -> None:
    """Look for an object, and open it."""
    assert sought(page, index) == [index]
    folded(page, index, wanted=True)


def folded(page: Page, index: str, *, wanted: bool) -> None:
    """Let one of the objects that are shown be open, or not."""
    head = page.one(f"#tree [data-index='{index}']")
    if (head.get_attribute("aria-expanded") == "true") is not wanted:
        press(page, head)


def button(page: Page, text: str, key: str = "") -> None:
    """Press a button of an object that is open."""
    where = f"//*[@data-said='{key}']/.." if key else "//ul[@id='tree']"
    press(page, page.driver.find_element(By.XPATH, f"{where}//button[text()='{text}']"))


def write(page: Page, key: str, text: str) -> None:
    field = page.one(f"[data-writes='{key}']")
    field.clear()
    field.send_keys(text)
    button(page, "Write", key)


def value(page: Page, key: str) -> str:
    return page.text(f".entry [data-of='{key}']")


def said(page: Page, key: str) -> str:
    return page.text(f"[data-said='{key}']")


def enabled(page: Page, axis: Axis) -> None:
    """Let the page enable an axis."""
    page.view(f"axis-{axis.name}")
    page.press("enable")
    until(lambda: axis.state is AxisState.STANDSTILL)
    page.view("objects")


def has(scene: SimpleNamespace, key: str) -> int:
    """The value of the simulated drive itself."""
    node, index, sub = key.split(":")
    found: int = scene.machine.simulated_node(int(node)).device.read(int(index, 16), int(sub, 16))
    return found


def test_objects_are_found_by_index_name_and_pdo_mapping(at):
    page = at.page
    everything = sought(page, "")
    assert len(everything) > 90
    for text in ("6064", "0x6064", "6064h", "0x6064h"):
        assert sought(page, text) == ["6064"]
    assert sought(page, "profile ACCELERATION") == ["6083"]
    assert set(sought(page, "608")) >= {"6080", "6081", "6083"}
    assert sought(page, "min position limit") == ["607B", "607D"]  # by the names of sub-indices
    assert sought(page, "<img src=x onerror=alert(1)>") == []
    page.one("#in-pdos").send_keys(ENTER)
    mapped = sought(page, "")
    assert "6064" in mapped
    assert "1008" not in mapped
    page.one("#in-pdos").send_keys(ENTER)


def test_a_value_is_read_on_demand_with_its_age_and_turns_grey(at):
    page = at.page
    opened(page, "6083")
    assert "UNSIGNED32" in page.text(".entry .what")
    button(page, "Read", ACCELERATION)
    until(lambda: value(page, ACCELERATION).startswith(f"{has(at, ACCELERATION)} = "))
    assert page.text(f"[data-age='{ACCELERATION}']")
    until(
        lambda: "aged" in (page.one(f".entry [data-of='{ACCELERATION}']").get_attribute("class") or ""), 6.0
    )
    assert violations(page) == []


def test_objects_that_are_read_repeatedly_follow_the_drive_and_are_at_most_eight(at):
    page = at.page
    opened(page, "6083")
    button(page, "Keep reading", ACCELERATION)
    for wanted in (4711, 4712):
        at.machine.simulated_node(1).device.write(0x6083, 0, wanted)
        until(lambda wanted=wanted: page.text("#kept-rows").count(f"{wanted} = ") == 1, 3.0)
    opened(page, "1018")
    for number in range(5):
        button(page, "Keep reading", f"1:1018:{number:02X}")
    opened(page, "607D")
    for number in range(3):
        button(page, "Keep reading", f"1:607D:{number:02X}")
    assert "already being read repeatedly" in page.told()
    assert len(page.driver.find_elements(By.CSS_SELECTOR, "#kept-rows tr")) == 8


def test_a_value_is_written_and_read_back_and_a_wrong_one_is_not(at):
    page = at.page
    opened(page, "6083")
    write(page, ACCELERATION, "90 deg/s²")
    until(lambda: "read back" in said(page, ACCELERATION))
    assert has(at, ACCELERATION) == 9000
    for wrong, words in (
        ("-1", "-1"),
        ("ten", "not a whole number"),
        ("<b>1</b>", "<b>1</b>"),
        ("9" * 300, "9"),
    ):
        write(page, ACCELERATION, wrong)
        until(
            lambda words=words: (
                words in said(page, ACCELERATION) and "read back" not in said(page, ACCELERATION)
            )
        )
        assert has(at, ACCELERATION) == 9000
    opened(page, "6040")
    write(page, "1:6040:00", "15")
    until(lambda: "every cycle" in said(page, "1:6040:00"))
    opened(page, "60B2")
    write(page, "1:60B2:00", "1")
    until(lambda: "commands of the running machine" in said(page, "1:60B2:00"))


def test_a_write_to_an_energised_node_needs_confirmation_and_no_writes_nothing(at):
    page, x = at.page, at.machine["x"]
    enabled(page, x)
    opened(page, "6083")
    before = has(at, ACCELERATION)
    for answer, after in (("no", before), ("yes", 7700)):
        write(page, ACCELERATION, "7700")
        until(lambda: page.one("#question").is_displayed())
        assert "energised" in page.text("#asked")
        page.driver.find_element(By.ID, answer).click()
        if answer == "yes":
            until(lambda: "read back" in said(page, ACCELERATION))
        time.sleep(0.2)
        assert has(at, ACCELERATION) == after
    page.view("axis-x")
    page.press("disable")
    until(lambda: x.state is AxisState.DISABLED)


def test_aborts_and_silence_are_reported_next_to_the_object(at):
    page, dials = at.page, at.machine.simulated_node(1).device.dials
    dials.sdo_aborts = {(0x6083, 0): abort.OBJECT_MISSING}
    opened(page, "6083")
    button(page, "Read", ACCELERATION)
    until(lambda: "0602" in said(page, ACCELERATION))
    dials.sdo_aborts, dials.sdo_silent = {}, True
    button(page, "Read", ACCELERATION)
    until(lambda: "no answer" in said(page, ACCELERATION), 8.0)
    dials.sdo_silent = False
    button(page, "Read", ACCELERATION)
    until(lambda: "no answer" not in said(page, ACCELERATION))


def test_by_the_keyboard_alone_and_the_space_bar_stops(at):
    page, x = at.page, at.machine["x"]
    page.run("arguments[0].focus()", page.one("#object-search"))
    page.key("profile acc")
    until(lambda: page.run("return document.querySelectorAll('#tree .branch').length") == 1)
    for key in (TAB, TAB, RIGHT):
        page.key(key)
    assert page.run("return document.activeElement.dataset.index") == "6083"
    assert page.run("return document.activeElement.getAttribute('aria-expanded')") == "true"
    at.machine.simulated_node(1).device.write(0x6083, 0, 8100)
    page.key(TAB)
    page.key(ENTER)
    until(lambda: value(page, ACCELERATION).startswith("8100 = "))
    for key in (TAB, TAB, "8200", ENTER):
        page.key(key)
    until(lambda: has(at, ACCELERATION) == 8200)
    enabled(page, x)
    sought(page, "")
    page.run("arguments[0].focus()", page.one("#tree .branch"))
    page.key(DOWN)
    page.key(DOWN)
    third = page.run("return document.activeElement.dataset.index")
    assert third == "1003"
    page.key(RIGHT)
    page.key(SPACE)
    assert page.one(f"#tree [data-index='{third}']").get_attribute("aria-expanded") == "true"
    until(lambda: x.state is not AxisState.STANDSTILL)
    page.key(LEFT)
    assert page.one(f"#tree [data-index='{third}']").get_attribute("aria-expanded") == "false"


def test_pdos_and_findings_are_shown(at):
    page = at.page
    press(page, page.one("[data-part=pdos]"))
    until(lambda: "TPDO1" in page.text("#part-pdos"))
    drawn = dict(page.run(DRAWN))
    used = {pdo.name: pdo.target.mapping for plan in at.machine.node(1).plans for pdo in plan.active}
    assert {name: drawn[name] for name in used} == {
        name: [f"{mapped.index:04X}" for mapped in mapping] for name, mapping in used.items()
    }
    page.pictures("objects-pdos")
    press(page, page.one("[data-part=findings]"))
    until(lambda: "VendorNumber is 0" in page.text("#part-findings"))
    page.pictures("objects-findings")


def test_a_verification_continues_may_be_cancelled_and_finds_differences(at):
    page = at.page
    at.machine.simulated_node(1).device.dials.sdo_aborts = {(0x6083, 0): abort.OBJECT_MISSING}
    press(page, page.one("[data-part=verify]"))
    press(page, page.one("#verify"))
    until(lambda: float(page.run("return document.querySelector('#verify-bar').value")) > 5)
    press(page, page.one("#verify-end"))
    until(lambda: "cancelled" in page.text("#verify-error"))
    press(page, page.one("#verify"))
    until(lambda: "entries read" in page.text("#verify-state"), 30.0)
    assert "is not in the device" in page.text("#differences")
    assert page.run(
        "const bar = document.querySelector('#verify-bar'); return [bar.value, bar.max, bar.position]"
    ) == [260, 260, 1]
    page.pictures("objects-verify")


def test_another_node_has_its_own_dictionary(at):
    page = at.page
    Select(page.one("#object-node")).select_by_value("2")
    until(lambda: "objects by" in page.text("#objects-state"))
    opened(page, "6064")
    button(page, "Read", "2:6064:00")
    until(lambda: value(page, "2:6064:00") != "unknown")
    Select(page.one("#object-node")).select_by_value("1")
    until(lambda: "objects by" in page.text("#objects-state"))


def test_the_view_on_all_four_kinds_of_screen(at):
    page = at.page
    for key in (POSITION, "1:6041:00", "1:606C:00"):
        opened(page, key.split(":")[1])
        button(page, "Keep reading", key)
    for index in sought(page, "profile"):
        folded(page, index, wanted=index in ("6081", "6083"))
    button(page, "Read", "1:6081:00")
    write(page, ACCELERATION, "90 deg/s²")
    until(lambda: "90 deg/s², read back" in said(page, ACCELERATION))
    until(lambda: page.text("#kept-rows").count(" s") == 3)
    page.pictures("objects")


def test_the_console_of_the_browser_stays_empty(scene):
    told = [entry for entry in scene.page.driver.get_log("browser") if "/enter" not in entry["message"]]
    assert told == []
