"""A Chromium without a screen, and the page of ``axisbus web`` in it."""

from __future__ import annotations

import os
import resource
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement

from axisbus.machine.axis import Axis
from axisbus.motion.states import AxisState
from kit.served_page import ServedDrives, served, until

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
PICTURES = Path(__file__).parents[2] / "demo-output" / "web"
# Of a module of tests that need a browser.
MARKS = [
    pytest.mark.skipif(
        "AXISBUS_BROWSER" not in os.environ, reason="a browser needs the computer for itself: make test-web"
    ),
    pytest.mark.skipif(
        not CHROMIUM or not DRIVER, reason="there is no chromium with its chromedriver on this computer"
    ),
    pytest.mark.timeout(120),
]
_OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--window-size=1280,1000",
)
# The sockets of the page are kept where a test can cut them.
_KEPT = """\
const Known = WebSocket;
window.sockets = [];
window.WebSocket = class extends Known { constructor(...given) { super(...given); sockets.push(this); } };
"""


def chromium(*more: str) -> webdriver.Chrome:
    """Start a browser; ``more`` are options for it."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for option in (*_OPTIONS, *more):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with _all_addresses():
        driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": _KEPT})
    return driver


@contextmanager
def _all_addresses() -> Iterator[None]:
    """Let the started process have more addresses than a test: a browser reserves far more than it uses."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (hard, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


# The innermost elements whose content is wider than they are.
_BEYOND = """return [...document.querySelectorAll("body *")].filter(one => one.clientWidth && one.scrollWidth > one.clientWidth + 1)
  .map(one => `${one.tagName} ${one.id} ${one.className} ${one.scrollWidth}`).slice(-6).join("; ")"""


class Page:
    """The page in a browser."""

    def __init__(self, driver: webdriver.Chrome, link: str) -> None:
        """Open it by its link, and wait until it has values."""
        self.driver = driver
        driver.get(link)
        until(lambda: driver.find_elements(By.CSS_SELECTOR, "[data-view=cell]") and not self.gone, 20.0)

    @property
    def gone(self) -> bool:
        """Whether the page marks its values as outdated."""
        return bool(self.run("return document.body === null || document.body.classList.contains('gone')"))

    def run(self, script: str, *arguments: object) -> Any:
        """Run a script in the page."""
        return self.driver.execute_script(script, *arguments)

    def view(self, name: str) -> None:
        """Show a view by its link."""
        self.driver.find_element(By.CSS_SELECTOR, f"nav a[href='#{name}']").click()
        until(lambda: self.one(f"[data-view='{name}']").is_displayed())

    def one(self, selector: str) -> WebElement:
        """Return the element of a selector, in the displayed view, else in the page."""
        found = self.driver.find_elements(By.CSS_SELECTOR, f"main > section:not([hidden]) {selector}")
        return found[0] if found else self.driver.find_element(By.CSS_SELECTOR, selector)

    def text(self, selector: str) -> str:
        """Return the text of the element of a selector."""
        return str(self.run("return arguments[0].textContent", self.one(selector)))

    def press(self, do: str) -> None:
        """Press a button by its request; confirms a question of the page."""
        button = self.one(f"[data-do={do}]")
        button.click()
        if button.get_attribute("data-question"):
            self.driver.find_element(By.ID, "yes").click()

    def type(self, value: str, text: str) -> None:
        """Type into the field of a value."""
        field = self.one(f"fieldset:not([data-values]) [data-value={value}]")
        field.clear()
        field.send_keys(text)

    def hold(self, selector: str) -> None:
        """Press a button, and hold it."""
        ActionChains(self.driver).click_and_hold(self.one(selector)).perform()

    def release(self) -> None:
        """Let the button of the mouse go."""
        ActionChains(self.driver).release().perform()

    def key(self, key: str) -> None:
        """Press a key, wherever the focus is."""
        ActionChains(self.driver).send_keys(key).perform()

    def told(self) -> str:
        """Return the messages of the page, and remove them."""
        text = self.text("#told")
        self.run("document.querySelectorAll('#told button').forEach((button) => button.click())")
        return text

    def drawn(self, path: str, width: int, scheme: str) -> None:
        """Keep a picture of the view at a width, in ``light`` or ``dark``."""
        self.as_seen(width, scheme)
        self.driver.save_screenshot(path)

    def as_seen(self, width: int, scheme: str) -> None:
        """Be so wide, as high as the view, and ``light`` or ``dark``."""
        media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
        for height in (800, min(2500, int(self.run("return document.documentElement.scrollHeight")))):
            metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
            self._settled(height)

    def _settled(self, height: int) -> None:
        """Wait until the view has been drawn again in its new height."""
        until(lambda: self.run("return innerHeight") == height, 2.0)
        drawn = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()))"
        self.driver.execute_async_script(drawn)

    def take_controls(self) -> None:
        """Take the controls, from any other page; harmless if this page has them."""
        for do in ("take", "take_over"):
            if self.one(f"[data-do={do}]").is_displayed():
                self.press(do)

    def operate(self, axis: Axis) -> None:
        """Show the view of an axis, with the controls and the axis enabled."""
        self.view(f"axis-{axis.name}")
        self.take_controls()
        until(lambda: self.one("[data-do=give_back]").is_displayed())
        if axis.state is AxisState.DISABLED:
            self.press("enable")
        until(lambda: axis.state is AxisState.STANDSTILL)
        self.told()

    def pictures(self, view: str) -> None:
        """Save the view in all four forms; nothing is wider than the screen, and the stop buttons are on it."""
        PICTURES.mkdir(parents=True, exist_ok=True)
        for width in (1280, 390):
            for scheme in ("light", "dark"):
                self.drawn(str(PICTURES / f"{view}-{width}-{scheme}.png"), width, scheme)
                assert self.run("return document.documentElement.scrollWidth") <= width, self.run(_BEYOND)
                assert all(
                    self.one(f"header [data-do={do}]").is_displayed() for do in ("quick_stop_all", "halt_all")
                )
        self.usual()

    def usual(self) -> None:
        """Be as wide and as light as at the beginning."""
        self.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@contextmanager
def opened_page(folder: Path, axis: str = "") -> Iterator[tuple[ServedDrives, Page]]:
    """Serve a machine and its page as ``served``, and open the page in a browser."""
    with served(folder, axis) as at:
        driver = chromium()
        try:
            yield at, Page(driver, at.link)
        finally:
            driver.quit()


ESCAPE, SPACE, ENTER, TAB = Keys.ESCAPE, " ", Keys.ENTER, Keys.TAB
