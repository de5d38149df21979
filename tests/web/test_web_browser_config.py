"""The view of configurations and the scope's MCAP files in a real Chromium, compared with the values of the simulated drive."""

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

from selenium.webdriver.support.select import Select

from axisbus.cia301 import abort
from axisbus.eds import load as load_eds
from axisbus.motion.states import AxisState
from axisbus.record.load import load
from kit.browser import ENTER, MARKS, SPACE, Page, opened_page
from kit.served_page import until

pytestmark = MARKS
ACCELERATION = (0x6083, 0)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    folder = tmp_path_factory.mktemp("saved")
    with opened_page(tmp_path_factory.mktemp("web")) as (at, page):
        page.driver.execute_cdp_cmd(
            "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(folder)}
        )
        yield SimpleNamespace(
            machine=at.machine, page=page, folder=folder, own=tmp_path_factory.mktemp("own")
        )


@pytest.fixture
def at(scene: SimpleNamespace) -> SimpleNamespace:
    """The view, of node 1, with the controls; no job is running."""
    page, dials = scene.page, scene.machine.simulated_node(1).device.dials
    page.usual()
    dials.sdo_aborts, dials.sdo_silent = {}, False
    page.take_controls()
    page.view("config")
    until(lambda: not page.one("#config-end").is_enabled(), 20.0)
    Select(page.one("#config-node")).select_by_value("1")
    page.told()
    return scene


def press(page: Page, selector: str) -> None:
    node = page.one(selector)
    page.run("arguments[0].scrollIntoView({block: 'center'})", node)
    until(node.is_enabled)
    node.click()


def saved(scene: SimpleNamespace, ending: str) -> Path:
    """The newest file of a kind that the browser has saved; it may begin with an empty one, and with one of its own."""

    def files() -> list[Path]:
        return [path for path in scene.folder.glob(f"*.{ending}") if path.stat().st_size]

    until(lambda: files() and not list(scene.folder.glob("*.crdownload")), 10.0)
    return max(files(), key=lambda path: path.stat().st_mtime)


def backed_up(scene: SimpleNamespace) -> None:
    press(scene.page, "#backup")
    until(lambda: "objects read" in scene.page.text("#config-state"), 30.0)
    until(lambda: scene.page.one("#backup-save").is_enabled())


def chosen(scene: SimpleNamespace, data: bytes, name: str = "x.dcf") -> None:
    path = scene.own / name
    path.write_bytes(data)
    scene.page.run("document.querySelector('#file-state').textContent = ''")
    scene.page.one("#config-file").send_keys(str(path))
    until(lambda: scene.page.text("#file-state") and "Reading" not in scene.page.text("#file-state"), 10.0)


def done(page: Page, button: str) -> str:
    """Press the button of a job, and return its result."""
    page.run("document.querySelector('#config-rows').textContent = ''")
    press(page, button)
    until(lambda: page.one("#config-end").is_enabled())
    until(lambda: not page.one("#config-end").is_enabled(), 30.0)
    return page.text("#config-state")


def test_a_backup_shows_how_far_it_is_and_is_saved_as_a_dcf(at):
    page = at.page
    at.machine.simulated_node(1).device.write(*ACCELERATION, 4711)
    press(page, "#backup")
    until(lambda: float(page.run("return document.querySelector('#config-bar').value")) > 5)
    assert not page.one("#backup").is_enabled()
    until(lambda: "objects read" in page.text("#config-state"), 30.0)
    assert page.text("#config-lines").startswith("node 1: axisbus generic CiA 402 drive")
    assert page.run("const bar = document.querySelector('#config-bar'); return bar.position") == 1
    press(page, "#backup-save")
    assert load_eds(saved(at, "dcf")).get(*ACCELERATION).initial(1) == 4711
    page.pictures("config-backup")


def test_a_backup_is_cancelled(at):
    page = at.page
    press(page, "#backup")
    until(lambda: float(page.run("return document.querySelector('#config-bar').value")) > 5)
    press(page, "#config-end")
    until(lambda: "was cancelled" in page.text("#config-error"))
    assert "nothing was written" in page.text("#config-state")


def test_a_file_is_compared_with_the_node(at):
    page, device = at.page, at.machine.simulated_node(1).device
    backed_up(at)
    press(page, "#file-backup")
    until(lambda: "of node 1" in page.text("#file-state"))
    assert done(page, "#compare").endswith(" 0 differ")
    device.write(*ACCELERATION, 8888)
    assert done(page, "#compare").endswith(" 1 differ")
    assert "8888" in page.text("#config-rows")
    device.dials.sdo_aborts = {(0x6081, 0): abort.OBJECT_MISSING}
    assert done(page, "#compare").endswith(" 2 differ")
    assert "the device refuses it" in page.text("#config-rows")


def test_a_dry_run_of_a_restore_is_shown_and_nothing_is_written(at):
    page, device = at.page, at.machine.simulated_node(1).device
    device.write(*ACCELERATION, 4711)
    backed_up(at)
    press(page, "#file-backup")
    until(lambda: "of node 1" in page.text("#file-state"))
    device.write(*ACCELERATION, 99)
    device.write(0x6081, 0, 98)
    device.write(0x6067, 0, 97)  # an object that the machine uses
    assert "3 have another value; nothing was written" in done(page, "#would-restore")
    assert page.text("#config-refusal").startswith("node 1 is operational")
    assert page.text("#config-command").startswith("axisbus config restore node-1")
    assert device.read(*ACCELERATION) == 99
    page.pictures("config")


def test_the_settings_are_restored_after_a_yes_and_others_are_left_unchanged(at):
    page, device = at.page, at.machine.simulated_node(1).device
    device.write(*ACCELERATION, 4711)
    backed_up(at)
    press(page, "#file-backup")
    until(lambda: "of node 1" in page.text("#file-state"))
    device.write(*ACCELERATION, 99)
    press(page, "#restore")
    until(lambda: page.one("#question").is_displayed())
    assert "Restore the settings of node 1 from node-1.dcf?" in page.text("#asked")
    page.one("#no").click()
    time.sleep(0.3)
    assert device.read(*ACCELERATION) == 99
    press(page, "#restore")
    page.one("#yes").click()
    until(lambda: "1 restored" in page.text("#config-state"), 30.0)
    assert device.read(*ACCELERATION) == 4711
    assert "99" in page.text("#config-rows")
    page.pictures("config-restored")


def test_a_file_that_does_not_fit_this_node_is_refused_with_a_message(at):
    page = at.page
    for data, words in (
        (b"junk <img src=x onerror=alert(1)>", "this is not an EDS or DCF"),
        (b"", "the file is empty"),
        (bytes(10_000_000), "at most 2097152"),
    ):
        chosen(at, data, "junk.dcf")
        assert words in page.text("#file-state")
        assert not page.one("#compare").is_enabled()
    Select(page.one("#config-node")).select_by_value("2")
    backed_up(at)
    press(page, "#file-backup")
    until(lambda: "of node 2" in page.text("#file-state"))
    Select(page.one("#config-node")).select_by_value("1")
    done(page, "#would-restore")
    assert "was not taken from node 1" in page.text("#config-error")


def test_a_file_is_sent_again_after_a_short_loss_of_the_connection(at):
    page = at.page
    chosen(at, saved(at, "dcf").read_bytes(), "mine.dcf")
    page.run("sockets.filter((each) => each.url.endsWith('/live')).forEach((each) => each.close())")
    until(lambda: not page.one("[data-do=give_back]").is_displayed(), 10.0)
    until(lambda: page.one("#compare").is_enabled(), 10.0)
    assert "objects compared" in done(page, "#compare")  # without the controls


def test_a_node_lost_during_a_backup_is_reported(at):
    page = at.page
    press(page, "#backup")
    until(lambda: float(page.run("return document.querySelector('#config-bar').value")) > 5)
    at.machine.simulated_node(1).device.dials.sdo_silent = True
    until(lambda: "no answer" in page.text("#config-error"), 20.0)
    assert "was not completed" in page.text("#config-state")


def test_by_the_keyboard_alone_and_the_space_bar_stops(at):
    page, x = at.page, at.machine["x"]
    page.view("axis-x")
    page.press("enable")
    until(lambda: x.state is AxisState.STANDSTILL)
    page.view("config")
    page.run("document.querySelector('#backup').focus()")
    page.key(ENTER)
    until(lambda: page.one("#config-end").is_enabled())
    page.run("document.querySelector('#config-end').focus()")
    page.key(ENTER)
    until(lambda: "was cancelled" in page.text("#config-error"))
    page.run("document.querySelector('#config-file').focus()")
    page.key(SPACE)
    until(lambda: x.state is not AxisState.STANDSTILL)


def test_the_scope_is_saved_as_a_recording(at):
    page = at.page
    page.view("scope")
    for box in page.driver.find_elements("css selector", "[data-signal]"):
        if box.is_selected() != (
            box.get_attribute("data-signal") in ("x.position", "x.velocity", "y.torque")
        ):
            box.click()
    until(lambda: page.run("return axisbusScope.count()") > 200, 10.0)
    press(page, "#run")
    head, *rows = str(page.run("return axisbusScope.csv()")).splitlines()
    press(page, "#save-mcap")
    path = saved(at, "mcap")
    time.sleep(0.2)
    found = load(path)
    assert head.count(",") == 3
    assert len(found.tracks["x"].times) == len(rows) > 100
    columns = found.tracks["x"].columns["position"], found.tracks["y"].columns["torque"]
    for row, *values in zip(rows, *columns, strict=True):
        _, position, _, torque = (float(each or "nan") for each in row.split(","))
        assert values == pytest.approx([position, torque], nan_ok=True)
    press(page, "#run")


def test_the_console_of_the_browser_stays_empty(scene):
    told = [entry for entry in scene.page.driver.get_log("browser") if "/enter" not in entry["message"]]
    assert told == []
