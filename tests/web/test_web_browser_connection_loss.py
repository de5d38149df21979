"""A killed core, a network that stalls or is slow, a missing server: the page reports it, and its stop gets through."""

from __future__ import annotations

import os
import signal
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

from axisbus.errors import ScanError
from axisbus.motion.states import AxisState
from kit.browser import MARKS, SPACE, Page, chromium
from kit.scenarios.core_process import turns
from kit.served_page import ServedDrives, served, until
from kit.stalling_network import Stalling

pytestmark = MARKS


def test_a_core_that_is_killed_is_reported_and_no_value_is_shown_as_fresh(tmp_path: Path) -> None:
    driver = chromium()
    try:
        with pytest.raises(ScanError), served(tmp_path) as at:  # the machine cannot be closed as it should
            _look(Page(driver, at.link), at)
    finally:
        driver.quit()


def _look(page: Page, at: ServedDrives) -> None:
    page.view("axis-x")
    assert not page.one("#dead").is_displayed()
    os.kill(at.machine._core.process, signal.SIGKILL)
    until(lambda: page.one("#dead").is_displayed())
    said = page.text("#dead")
    assert "has ended" in said or "failed" in said
    assert "look at the machine" in said
    assert not page.one("#gone").is_displayed()  # the connection is not
    until(lambda: page.text('[data-view="axis-x"] [data-value=position]') in ("unknown", ""))
    page.pictures("dead")
    assert at.web.poll() is None


# -- the network ---------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """A page with a network between that stalls and delays."""
    with served(tmp_path_factory.mktemp("net")) as at:
        port = int(at.link.partition("/enter")[0].rpartition(":")[2])
        net = Stalling(port)
        driver = chromium(f"--host-resolver-rules=MAP localhost:{port} 127.0.0.1:{net.port}")
        try:
            page = Page(driver, at.link.replace("127.0.0.1", "localhost"))
            yield SimpleNamespace(page=page, net=net, machine=at.machine, web=at.web)
        finally:
            driver.quit()
            net.close()


@pytest.fixture
def x(scene: SimpleNamespace) -> SimpleNamespace:
    """The view of axis x, enabled, with the controls."""
    page, axis = scene.page, scene.machine["x"]
    scene.net.stalled, scene.net.delay = False, 0.0
    until(lambda: not page.gone, 20.0)
    page.operate(axis)
    return SimpleNamespace(page=page, net=scene.net, axis=axis, speed=lambda: abs(turns(scene.machine)))


def test_a_stop_that_a_stalled_network_swallows_is_reported_and_done_when_there_is_one_again(x):
    x.page.type("velocity", "50")
    x.page.press("move_velocity")
    until(lambda: x.speed() > 40.0)
    x.net.stalled = True
    until(lambda: x.page.gone, 2.0)
    x.page.key(SPACE)
    assert until(lambda: x.page.one("#unstopped").is_displayed()) < 1.5
    assert "use the emergency stop" in x.page.text("#unstopped")
    x.page.press("halt_all")
    until(lambda: "not known whether this has arrived" in x.page.text("#told"))
    time.sleep(4.5)  # the server has dropped the socket, with its content
    assert x.speed() > 40.0
    x.net.stalled = False
    until(lambda: x.speed() < 0.1)
    until(lambda: not x.page.one("#unstopped").is_displayed())
    until(lambda: not x.page.gone, 10.0)


def test_on_a_permanently_slow_network_no_value_is_shown_as_fresh_and_nothing_jogs(x):
    x.net.delay = 0.6
    until(lambda: "The connection is slow" in x.page.text("#gone") and x.page.gone, 10.0)
    x.page.run("arguments[0].scrollIntoView({block: 'center'})", x.page.one("[data-jog='1']"))
    x.page.hold("[data-jog='1']")
    time.sleep(1.5)
    x.page.release()
    assert x.speed() < 0.1
    assert x.axis.state is AxisState.STANDSTILL
    x.page.press("enable")
    until(lambda: "no connection" in x.page.text("#told"))


def test_a_server_that_ended_is_reported_and_its_stop_is_not_confirmed(x, scene):
    scene.web.terminate()
    until(lambda: x.page.gone and "The connection is lost" in x.page.text("#gone"), 15.0)
    x.page.key(SPACE)
    until(lambda: x.page.one("#unstopped").is_displayed())
    x.page.pictures("gone")
