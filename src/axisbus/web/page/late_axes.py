"""The axes on the pages that are open: those that are there when a page is opened, and those that join the machine later."""

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
    """A page in a browser: where links, signals of the scope, and views go to; holds which axes it has."""

    client: Client
    nav: Tag
    signals: Tag
    main: Tag
    shown: set[str] = field(default_factory=set)

    def take_in(self, axis: Axis, machine: Machine) -> None:
        """Put an axis onto it, or try to, once."""
        number, parameters = len(self.shown), machine.session.axes[axis.name].parameters
        self.shown.add(axis.name)
        with self.nav:
            Tag("a", axis.name, href=f"#axis-{quote(axis.name)}")
        with self.signals:
            axis_choice(axis.name, signals_of(axis.name, parameters))
        with self.main:
            axis_view(number, axis, machine.cell.axes[axis.name], parameters)


class Pages:
    """Holds the pages that are open; for the event loop of the server alone."""

    def __init__(self, machine: Machine) -> None:
        """None is open."""
        self._machine = machine
        self._open: list[OpenPage] = []

    def opened(self, page: OpenPage) -> None:
        """Take in a page, and put the axes onto it."""
        self._open.append(page)
        self.look()

    def look(self) -> None:
        """Put the axes that have joined onto the pages that are open, and forget those that are gone."""
        self._open = [page for page in self._open if not page.client.is_deleted]
        for page in self._open:
            for axis in self._machine:
                if axis.name not in page.shown:
                    page.take_in(axis, self._machine)
