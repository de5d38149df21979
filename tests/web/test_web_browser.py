"""The page in a real Chromium, beside a program that has opened the machine: display and actions are judged on the plant."""

from __future__ import annotations

import os
import re
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from types import SimpleNamespace

import pytest

if sys.platform != "linux":
    pytest.skip("a core in a process of its own is for Linux", allow_module_level=True)
pytest.importorskip("nicegui", reason="the page needs nicegui")
pytest.importorskip("selenium", reason="the browser is driven by selenium")

from axisbus.motion.states import AxisState
from kit.browser import ENTER, ESCAPE, MARKS, SPACE, Page, opened_page
from kit.scenarios.core_process import turns
from kit.served_page import until

pytestmark = MARKS
FAST = 25.0  # deg/s, less than a jog has


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """The machine of this program, ``axisbus web`` beside it, and its page in a browser."""
    with opened_page(tmp_path_factory.mktemp("web")) as (at, page):
        yield SimpleNamespace(machine=at.machine, web=at.web, page=page, link=at.link)


@pytest.fixture
def x(scene: SimpleNamespace) -> Iterator[SimpleNamespace]:
    """The view of axis x, enabled, with the controls; at the end it is at standstill."""
    page, axis = scene.page, scene.machine["x"]
    page.usual()
    page.operate(axis)
    ramp = page.one("[data-values] [data-value=velocity]")
    ramp.clear()
    ramp.send_keys("40")  # deg/s, which are braked in less than 0.1 s
    yield SimpleNamespace(
        page=page, axis=axis, speed=lambda: abs(turns(scene.machine)), machine=scene.machine
    )
    page.release()
    page.press("halt_all")
    until(lambda: abs(turns(scene.machine)) < 0.1)


def test_the_cell_is_shown_with_nodes_bus_and_nothing_wrong(scene):
    page = scene.page
    page.view("cell")
    until(lambda: "nodes" and page.text("#nodes"))
    assert page.text("#nodes").count("operational") == 2
    assert "the node is booted" in page.text("#nodes")
    assert "cycle of 20 ms" in page.text("#beside")
    assert page.text("#incidents") == "None."
    assert page.text("#controls") == "No page has the controls"


def test_enable_asks_once_and_no_leaves_the_axis_off(scene):
    page, axis = scene.page, scene.machine["y"]
    page.view("axis-y")
    page.press("take")
    until(lambda: page.one("[data-do=give_back]").is_displayed())
    button = page.one("[data-do=enable]")
    button.click()
    page.key(ENTER)  # the focus is on No
    time.sleep(0.3)
    assert axis.state is AxisState.DISABLED
    assert not page.one("#question").is_displayed()
    page.press("enable")
    until(lambda: page.text(".state") == "Standstill")
    assert page.text(".lit") == "operation enabled"
    page.press("disable")
    until(lambda: page.text(".state") == "Disabled")


def jogs(x: SimpleNamespace, way: str = "1") -> None:
    """Hold a button until the axis has moved for 0.6 s; a browser that is delayed releases it, and has another try."""
    for _ in range(5):
        x.page.hold(f"[data-jog='{way}']")
        with suppress(AssertionError):
            until(lambda: x.speed() > FAST, 1.5)
        time.sleep(0.6)
        if x.speed() > FAST:
            return
        x.page.release()
    raise AssertionError("it does not go on")


def test_a_jog_continues_while_the_button_is_held(x):
    jogs(x, "-1")
    x.page.release()
    assert until(lambda: x.speed() < 0.1) < 0.5


def test_the_key_on_a_jog_button_is_a_jog_too(x):
    x.page.run("arguments[0].focus()", x.page.one("[data-jog='1']"))
    x.page.driver.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": "keyDown", "key": "Enter"})
    until(lambda: x.speed() > FAST)
    x.page.driver.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": "keyUp", "key": "Enter"})
    assert until(lambda: x.speed() < 0.1) < 0.5


@pytest.mark.parametrize(
    "happens",
    [
        "dispatchEvent(new Event('blur'))",
        "Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
        "document.dispatchEvent(new Event('visibilitychange')); delete document.hidden",
        "location.hash = '#cell'",
    ],
    ids=["blur", "hidden", "another view"],
)
def test_a_jog_ends_when_the_page_is_hidden_or_loses_the_focus(x, happens):
    jogs(x)
    x.page.run(happens)
    assert until(lambda: x.speed() < 0.1) < 1.0
    time.sleep(0.2)
    assert x.speed() < 0.1


def test_a_jog_whose_socket_is_cut_ends_within_half_a_second(x):
    jogs(x)
    x.page.run("sockets.filter((socket) => socket.url.endsWith('/live')).at(-1).close()")
    assert until(lambda: x.speed() < 0.1) < 0.5
    until(lambda: x.page.text("#controls") == "No page has the controls")
    assert x.speed() < 0.1


def test_a_page_that_hangs_ends_its_jog_and_does_not_continue_it(x):
    jogs(x)
    x.page.run("setTimeout(() => { const t = performance.now(); while (performance.now() - t < 1000); })")
    assert until(lambda: x.speed() < 0.1) < 0.6  # the beginning of the hanging is not seen from here
    time.sleep(1.3)
    assert x.speed() < 0.1


def test_the_space_bar_stops_and_never_presses_the_focused_button(x):
    x.page.type("distance", "1000")
    x.page.press("move_relative")
    until(lambda: x.speed() > FAST)
    x.page.run("arguments[0].focus()", x.page.one("[data-do=move_relative]"))
    x.page.key(SPACE)
    until(lambda: x.speed() < 0.1)
    until(lambda: x.axis.state is AxisState.DISABLED)
    x.page.run("arguments[0].focus()", x.page.one("[data-do=enable]"))
    x.page.key(SPACE)
    time.sleep(0.2)
    assert not x.page.one("#question").is_displayed()


def mouse(x: SimpleNamespace, kind: str, button: str, buttons: int) -> None:
    """Do something with a button of the mouse over the jog button; ``buttons`` are those that are down then, as bits."""
    box = x.page.run("return arguments[0].getBoundingClientRect()", x.page.one("[data-jog='1']"))
    at = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2, "clickCount": 1}
    event = {"type": f"mouse{kind}", "button": button, "buttons": buttons, **at}
    x.page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)


def test_a_jog_ends_with_its_button_though_another_one_is_down(x):
    x.page.run("arguments[0].scrollIntoView({block: 'center'})", x.page.one("[data-jog='1']"))
    mouse(x, "Pressed", "left", 1)
    until(lambda: x.speed() > FAST)
    mouse(x, "Pressed", "middle", 5)
    mouse(x, "Released", "left", 4)
    assert until(lambda: x.speed() < 0.1) < 0.5
    mouse(x, "Released", "middle", 0)


def test_a_finger_jogs_for_as_long_as_it_holds_and_opens_no_menu(x):
    button, driver = x.page.one("[data-jog='1']"), x.page.driver
    x.page.run("arguments[0].scrollIntoView({block: 'center'})", button)
    box = x.page.run("return arguments[0].getBoundingClientRect()", button)
    finger = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    menu = (
        "return !arguments[0].dispatchEvent(new MouseEvent('contextmenu', {bubbles: true, cancelable: true}))"
    )
    driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 2})
    try:
        touch = {"type": "touchStart", "touchPoints": [finger]}
        driver.execute_cdp_cmd("Input.dispatchTouchEvent", touch)
        until(lambda: x.speed() > FAST)
        assert x.page.run(menu, button)  # as a tablet asks for one after half a second
        time.sleep(0.5)
        assert x.speed() > FAST
        driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchCancel", "touchPoints": []})
        assert until(lambda: x.speed() < 0.1) < 0.5
    finally:
        driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})


def test_a_jog_that_another_program_has_ended_is_released_and_reported(x):
    jogs(x)
    x.machine["x"].halt()
    until(lambda: x.speed() < 0.1)
    assert "The jog of x has ended" in until_text(x.page, "#told", "ended")
    assert "held" not in x.page.one("[data-jog='1']").get_attribute("class")


def test_one_press_of_the_enter_key_is_one_step_for_any_duration(x):
    x.page.type("distance", "1")
    x.page.run("arguments[0].focus()", x.page.one("[data-do=move_relative]"))
    before = x.axis.position
    key = {"key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13, "text": "\r"}
    for repeat in (False, True, True, True):
        x.page.driver.execute_cdp_cmd(
            "Input.dispatchKeyEvent", {"type": "keyDown", "autoRepeat": repeat, **key}
        )
    x.page.driver.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": "keyUp", **key})
    time.sleep(0.8)
    assert x.axis.position == pytest.approx(before + 1.0, abs=0.1)


def test_a_question_does_not_lie_between_a_finger_and_the_stop(x):
    x.page.type("velocity", "50")
    x.page.press("move_velocity")
    until(lambda: x.speed() > FAST)
    x.page.one("[data-do=home]").click()
    x.page.driver.find_element("css selector", "#question [data-do=quick_stop_all]").click()
    until(lambda: x.speed() < 0.1)
    assert not x.page.one("#question").is_displayed()


def test_in_a_text_field_the_escape_key_stops_and_the_space_bar_writes(x):
    x.page.type("velocity", "-50")
    x.page.press("move_velocity")
    until(lambda: x.speed() > FAST)
    x.page.type("velocity", "7 ")
    assert x.speed() > FAST
    x.page.key(ESCAPE)
    until(lambda: x.speed() < 0.1)
    assert "Disabled" in until_text(x.page, ".state", "Disabled")


def until_text(page: Page, selector: str, text: str) -> str:
    until(lambda: text in page.text(selector))
    return page.text(selector)


def test_a_move_arrives_and_a_refusal_has_the_words_of_the_library(x):
    x.page.type("position", "10,5")
    x.page.press("move_absolute")
    until(lambda: abs(x.axis.position - 10.5) < 0.1, 20.0)
    until(lambda: x.page.text("[data-live='x.position']").startswith("10.5"))
    assert re.fullmatch(r"\d+ ms", x.page.text("[data-live='x.position_age']"))
    x.page.type("velocity", "100000")
    x.page.press("move_velocity")
    assert "x.move_velocity(100000 deg/s)" in until_text(x.page, "#told", "max_velocity")


def test_a_fault_is_shown_with_its_cause_and_reset(x):
    x.page.type("velocity", "40")
    x.page.press("move_velocity")
    until(lambda: x.speed() > FAST)
    x.machine.simulated_node(1).fault(0x4310)
    until_text(x.page, ".state", "ErrorStop")
    error = until_text(x.page, ".error", "remedy")
    assert "4310" in error
    assert "more: axisbus explain too-hot" in error
    x.page.view("cell")
    incidents = until_text(x.page, "#incidents", "4310")
    assert "unresolved" in incidents
    assert "remedy" in incidents
    assert "the drive went into fault" in x.page.text("#nodes")
    x.page.pictures("cell")
    x.page.view("axis-x")
    x.page.pictures("axis")
    x.page.press("reset")
    until_text(x.page, ".state", "Disabled")
    until(lambda: not x.page.text(".error"))
    x.page.press("enable")
    until(lambda: x.axis.state is AxisState.STANDSTILL)


def test_values_are_grey_within_a_second_after_the_server_falls_silent(scene):
    page = scene.page
    until(lambda: not page.gone)
    os.kill(scene.web.pid, signal.SIGSTOP)
    try:
        assert until(lambda: page.gone, 2.0) < 1.0
        live = page.one("[data-live='x.position']")
        assert float(page.run("return getComputedStyle(arguments[0]).opacity", live)) < 0.6
        assert page.one("#gone").is_displayed()
    finally:
        os.kill(scene.web.pid, signal.SIGCONT)
    until(lambda: not page.gone)


def test_a_link_opens_one_page_once_which_may_stop_the_motions_of_others(scene, x):
    driver, first = x.page.driver, x.page.driver.current_window_handle
    x.page.type("velocity", "50")
    x.page.type("position", "5000")
    # While this page is in the background, a move to a position continues; move_velocity would be halted.
    x.page.press("move_absolute")
    x.page.press("link")
    link = re.search(r"http[\w:/.?=-]+", until_text(x.page, "#told", "http"))[0]
    driver.switch_to.new_window("window")
    try:
        looker = Page(driver, link)
        assert until_text(looker, "#controls", "This is an observer page")
        until(lambda: x.speed() > FAST)
        looker.press("quick_stop_all")
        until(lambda: x.speed() < 0.1)
        driver.get(link)
        assert "already been used" in driver.page_source
    finally:
        driver.close()
        driver.switch_to.window(first)


def test_a_node_that_has_lost_its_supply_is_booted_by_a_button_of_the_cell(scene, x):
    page, machine, button = x.page, scene.machine, "#boots [data-node='1']"
    page.view("cell")
    assert not page.one(button).is_displayed()
    machine.simulated_node(1).switch_off()
    until(lambda: page.one(button).is_displayed())
    page.one(button).click()
    until(lambda: page.text("#boot-state") == "Node 1 is being booted: step find.")
    assert not page.one(button).is_enabled()
    page.pictures("boot")
    assert "node 1 does not answer" in until_text(page, "#told", "node 1")
    page.told()
    assert page.text("#boot-state") == ""
    machine.simulated_node(1).switch_on()
    time.sleep(1.0)
    page.one(button).click()
    until_text(page, "#nodes", "node 1 was booted again")
    until(lambda: not page.one(button).is_displayed())
    assert page.one("#told").text == ""
    for name in "xy":
        page.view(f"axis-{name}")
        page.press("reset")
        until(lambda name=name: machine[name].state is not AxisState.ERRORSTOP)
    page.view("axis-x")
    page.press("enable")
    until(lambda: x.axis.state is AxisState.STANDSTILL)


def test_the_console_of_the_browser_stays_empty(scene):
    told = [entry for entry in scene.page.driver.get_log("browser") if "/enter" not in entry["message"]]
    assert told == []


def test_when_the_server_ends_the_machine_continues_and_its_motions_halt(scene, x):
    x.page.type("velocity", "50")
    x.page.press("move_velocity")
    until(lambda: x.speed() > FAST)
    scene.web.terminate()
    until(lambda: x.speed() < 0.1)
    assert scene.web.wait(10) == 143
    assert x.axis.state is AxisState.STANDSTILL
    x.page.press = lambda _: None  # no server receives it any more
