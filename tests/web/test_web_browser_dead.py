"""A core that is killed while a page looks on: the page says so, and shows nothing as if it were of now."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

if sys.platform != "linux":
    pytest.skip("a core in a process of its own is for Linux", allow_module_level=True)
pytest.importorskip("nicegui", reason="the page needs nicegui")
pytest.importorskip("selenium", reason="the browser is driven by selenium")

from axisbus.errors import ScanError
from kit.browser import MARKS, Page, chromium
from kit.served_page import Served, served, until

pytestmark = MARKS


def test_a_core_that_is_killed_is_told_and_nothing_is_shown_as_of_now(tmp_path: Path) -> None:
    driver = chromium()
    try:
        with pytest.raises(ScanError), served(tmp_path) as at:  # the machine cannot be closed as it should
            _look(Page(driver, at.link), at)
    finally:
        driver.quit()


def _look(page: Page, at: Served) -> None:
    page.view("axis-x")
    assert not page.one("#dead").is_displayed()
    os.kill(at.machine._core.process, signal.SIGKILL)
    until(lambda: page.one("#dead").is_displayed())
    said = page.text("#dead")
    assert "gone" in said or "failed" in said
    assert "look at the machine" in said
    assert not page.one("#gone").is_displayed()  # the connection is not
    until(lambda: page.text('[data-view="axis-x"] [data-value=position]') in ("unknown", ""))
    page.pictures("dead")
    assert at.web.poll() is None
