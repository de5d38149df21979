"""The page: its head with the stops, and views of the cell, the scope, objects, configurations, tuning, and each axis."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

from fastapi import FastAPI
from nicegui import Client, ui

from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.version import __version__
from axisbus.web.page import node_views, scope_view, tuning_view
from axisbus.web.page.axis_view import axis_view
from axisbus.web.page.scope_view import axis_choice
from axisbus.web.page.tags import Tag, button, scrolled
from axisbus.web.scope.signals import signals_of

_HEAD = (
    '<link rel="stylesheet" href="/own/page.css"><script src="/own/stop.js" defer></script>'
    '<script src="/own/page.js" defer></script>'
    '<script src="/own/scope.js" defer></script><script src="/own/objects.js" defer></script>'
    '<script src="/own/config.js" defer></script>'
    '<link rel="stylesheet" href="/own/tuning.css"><script src="/own/response.js" defer></script>'
    '<script src="/own/tuning.js" defer></script>'
)
_ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><rect width="16" height="16" rx="3" fill="#0b5cad"/>'
    '<path d="M3 8h10M10 5l3 3l-3 3" fill="none" stroke="#fff" stroke-width="2"/></svg>'
)


_TAKE = "Take control of the machine? The program that has it loses control, and all moving axes halt first."


def add_page(application: FastAPI, machine: Machine, pages: Pages) -> None:
    """Add the page of a machine to an application; ``pages`` are the open ones."""
    name = Path(machine.cell.file).name

    @ui.page("/", title=f"{name} · axisbus")
    def page() -> None:
        ui.add_head_html(_HEAD)
        with Tag("div", classes="axisbus"):
            nav = _head(name)
            with Tag("main") as main:
                _cell_view()
                signals = scope_view.scope_view(name)
                node_views.objects_view(machine)
                node_views.config_view(machine)
                tuning_view.tuning_view(machine, name)
            pages.opened(OpenPage(ui.context.client, nav, signals, main))
            Tag(
                "footer",
                f"axisbus {__version__}. Not a safety function: an emergency stop belongs in hardware.",
            )
            _news()
            _question()

    ui.run_with(
        application,
        title="axisbus",
        favicon=_ICON,
        dark=None,
        language="en-US",
        tailwind=False,
        show_welcome_message=False,
        binding_refresh_interval=None,
    )


def _head(name: str) -> Tag:
    """Put the head into the page; return the container of the links to the axes."""
    with Tag("header"):
        with Tag("nav", aria_label="Views") as nav:
            Tag("strong", name)
            Tag("a", "Cell", href="#cell")
            Tag("a", "Scope", href=f"#{scope_view.VIEW}")
            Tag("a", "Objects", href=f"#{node_views.VIEW}")
            Tag("a", "Configuration", href=f"#{node_views.CONFIG_VIEW}")
            Tag("a", "Tuning", href=f"#{tuning_view.VIEW}")
        with Tag("div", classes="controls"):
            Tag("span", "connecting", id="controls")
            button("Take the controls", "take", data_shown="free")
            button("Take over", "take_over", data_shown="others")
            button("Give back", "give_back", data_shown="mine")
            button("Observer link", "link", data_shown="operator")
        with Tag("div", classes="command", id="command", hidden="hidden"):
            Tag("span", id="commanded")
            button("Take control", "take_command", data_question=_TAKE, data_shown="lost")
        with Tag("div", classes="stops"):
            button("Halt all", "halt_all", "halt")
            button("Quick stop (space)", "quick_stop_all", "stop")
    return nav


def _cell_view() -> None:
    with Tag("section", data_view="cell", aria_label="Cell"):
        Tag("h1", "Cell")
        with scrolled("Nodes"), Tag("table"):
            with Tag("thead"), Tag("tr"):
                for title in ("Node", "Device", "NMT state", "Boot-up", "Axes", "Faults"):
                    Tag("th", title, scope="col")
            Tag("tbody", id="nodes", classes="live")
        Tag("h2", "Axes")
        Tag("div", classes="tiles live", id="tiles")
        Tag("h2", "Bus and cycle")
        Tag("ul", id="beside", classes="live plain")
        Tag("h2", "Incidents, newest first")
        Tag("ol", id="incidents", classes="live plain incidents")


def _news() -> None:
    with Tag("div", classes="news"):
        Tag("div", classes="told", id="told", role="status", aria_live="polite")
        gone = "The connection is lost: all values on this page are outdated."
        Tag("div", gone, "banner", id="gone", role="alert")
        Tag("div", "", "banner", id="unstopped", role="alert")
        Tag("div", "", "banner", id="dead", role="alert")


def _question() -> None:
    with Tag("dialog", id="question", aria_labelledby="asked"):
        Tag("p", id="asked")
        with Tag("div", classes="row stops"):  # nothing behind a question can be clicked
            button("Halt all", "halt_all", "halt")
            button("Quick stop (space)", "quick_stop_all", "stop")
        with Tag("div", classes="row"):
            Tag("button", "No", type="button", id="no")
            Tag("button", "Yes", "go", type="button", id="yes")


# -- The axes on the open pages: those present when a page is opened, and those that join the machine later ------------


@dataclass(frozen=True, slots=True)
class OpenPage:
    """A page in a browser: the containers of its links, scope signals and views; holds the axes that it has."""

    client: Client
    nav: Tag
    signals: Tag
    main: Tag
    shown: set[str] = field(default_factory=set)

    def take_in(self, axis: Axis, machine: Machine) -> None:
        """Add an axis to the page; a failure is not retried."""
        number, parameters = len(self.shown), machine.session.axes[axis.name].parameters
        self.shown.add(axis.name)
        with self.nav:
            Tag("a", axis.name, href=f"#axis-{quote(axis.name)}")
        with self.signals:
            axis_choice(axis.name, signals_of(axis.name, parameters))
        with self.main:
            axis_view(number, axis, machine.cell.axes[axis.name], parameters)


class Pages:
    """Hold the open pages; only for the event loop of the server."""

    def __init__(self, machine: Machine) -> None:
        """Begin without open pages."""
        self._machine = machine
        self._open: list[OpenPage] = []

    def opened(self, page: OpenPage) -> None:
        """Register a page, and add the axes to it."""
        self._open.append(page)
        self.look()

    def look(self) -> None:
        """Add axes that have joined to the open pages, and forget closed pages."""
        self._open = [page for page in self._open if not page.client.is_deleted]
        for page in self._open:
            for axis in self._machine:
                if axis.name not in page.shown:
                    page.take_in(axis, self._machine)
