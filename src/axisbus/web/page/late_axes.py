"""The axes on the open pages: those present when a page is opened, and those that join the machine later."""

from __future__ import annotations

from dataclasses import dataclass, field
from urllib.parse import quote

from nicegui import Client

from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.web.page.axis_view import axis_view
from axisbus.web.page.scope_view import axis_choice
from axisbus.web.page.tags import Tag
from axisbus.web.scope.signals import signals_of


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
