"""Accessibility of the page: axe-core checks each view, in light and dark, wide and on a phone."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

if sys.platform != "linux":
    pytest.skip("a core in a process of its own is for Linux", allow_module_level=True)
pytest.importorskip("nicegui", reason="the page needs nicegui")
pytest.importorskip("selenium", reason="the browser is driven by selenium")

from kit.accessibility import violations
from kit.browser import MARKS, opened_page
from kit.served_page import until

pytestmark = MARKS
LIMITED = "max_torque = 5.0\nposition_limits = [-1000.0, 1000.0]"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """The page with axis x in fault, so that every view has a message."""
    with opened_page(tmp_path_factory.mktemp("web"), LIMITED) as (at, page):
        page.view("axis-x")
        page.press("take")
        until(lambda: page.one("[data-do=give_back]").is_displayed())
        page.press("enable")
        until(lambda: page.text(".state") == "Standstill")
        at.machine.simulated_node(1).fault(0x4310)
        until(lambda: page.text(".state") == "ErrorStop")
        page.press("move_velocity")
        until(lambda: page.text("#told"))
        yield SimpleNamespace(page=page, web=at.web)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_meets_the_accessibility_rules(scene, width, scheme):
    links = scene.page.driver.find_elements("css selector", "nav a")
    views = [link.get_attribute("href").rpartition("#")[2] for link in links]
    assert {"cell", "scope", "axis-x", "axis-y"} <= set(views)
    for view in views:
        scene.page.view(view)
        scene.page.as_seen(width, scheme)
        assert violations(scene.page) == [], view


def test_the_search_finds_violations_of_accessibility(scene):
    page = scene.page
    page.view("cell")
    page.as_seen(1280, "light")
    page.run("document.querySelector('#tiles').append(document.createElement('button'))")
    try:
        assert "button-name (critical)" in violations(page)[0]
    finally:
        page.run("document.querySelector('#tiles > button').remove()")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_question_meets_the_accessibility_rules(scene, scheme):
    scene.page.view("axis-y")
    scene.page.as_seen(390, scheme)
    scene.page.one("[data-do=torque_control]").click()
    assert violations(scene.page) == []
    scene.page.one("#no").click()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_loss_is_reported_in_one_line_on_a_phone_and_covers_nothing_else(scene, scheme):
    """Grey alone marks old values; the words and the stops are for every user."""
    page = scene.page
    page.view("axis-y")
    page.as_seen(390, scheme)
    os.kill(scene.web.pid, signal.SIGSTOP)
    try:
        until(lambda: page.gone, 2.0)
        until(lambda: page.one("#gone").is_displayed())
        assert page.run("return document.querySelector('#gone').getBoundingClientRect().height") < 60
        assert violations(page, without=".live") == []
        page.pictures("gone")
    finally:
        os.kill(scene.web.pid, signal.SIGCONT)
    until(lambda: not page.gone)
