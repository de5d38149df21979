"""The page: its head with the stops, and views of the cell, the scope, objects, configurations, tuning, and each axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

from fastapi import FastAPI
from nicegui import Client, ui

from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.step_response import BAND
from axisbus.version import __version__
from axisbus.web.page import node_views
from axisbus.web.page.axis_view import axis_view
from axisbus.web.page.tags import Tag, button, scrolled, select
from axisbus.web.scope.saving import can_save
from axisbus.web.scope.signals import MAX_SIGNALS, ScopeSignal, signals_of
from axisbus.web.tuning.outcome import FIGURES

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
                _cell_view(machine)
                signals = scope_view(name)
                node_views.objects_view(machine)
                node_views.config_view(machine)
                tuning_view(machine, name)
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
            Tag("a", "Scope", href=f"#{SCOPE_VIEW}")
            Tag("a", "Objects", href=f"#{node_views.VIEW}")
            Tag("a", "Configuration", href=f"#{node_views.CONFIG_VIEW}")
            Tag("a", "Tuning", href=f"#{TUNING_VIEW}")
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


def _cell_view(machine: Machine) -> None:
    with Tag("section", data_view="cell", aria_label="Cell"):
        Tag("h1", "Cell")
        with scrolled("Nodes"), Tag("table"):
            with Tag("thead"), Tag("tr"):
                for title in ("Node", "Device", "NMT state", "Boot-up", "Axes", "Faults"):
                    Tag("th", title, scope="col")
            Tag("tbody", id="nodes", classes="live")
        with Tag("div", classes="row", id="boots"):
            for node in machine.cell.nodes:
                if machine.node(node).parts.has_objects:
                    title = f"Boot {node_views.named(machine, node)}"
                    button(title, "boot", data_node=str(node), hidden="hidden")
        Tag("p", "", "hint", id="boot-state", role="status")
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
    """A page in a browser: the containers of its links, scope signals and views; holds its axes."""

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


# -- The view of the scope: the signals, start and stop, the diagram that its script draws, and the values as text ---------

SCOPE_VIEW = "scope"
_NEEDS = 'On the computer of the server: pip install "axisbus[record]"'
_SPANS = (0.2, 0.5, 1, 2, 5, 10, 30, 60)  # s
_USUAL = 5
_TRIGGERS = (("", "none: continuous"), ("normal", "each time"), ("single", "once, then stop"))
_EDGES = (("rising", "rises above"), ("falling", "falls below"))
_KEYS = (
    "In the picture: a click sets cursor A, with Shift cursor B. While stopped, dragging moves the picture and the wheel "
    "zooms. With the focus in the picture, arrows move the cursor that was set last, + and - zoom."
)


def scope_view(cell: str) -> Tag:
    """Put the view into the page; return the container of the signals. ``cell`` is the name for a browser's stored selection."""
    with Tag("section", data_view=SCOPE_VIEW, aria_label="Scope", data_cell=cell, data_most=str(MAX_SIGNALS)):
        Tag("h1", "Scope")
        signals = Tag("div", classes="signals")
        _controls()
        Tag(
            "canvas",
            "",
            "live",
            id="picture",
            tabindex="0",
            role="img",
            aria_label="The signals over time; the table below has their values",
        )
        Tag("p", "", "hint", id="scope-state", role="status")
        with scrolled("The values of the signals"), Tag("table", classes="live"):
            with Tag("thead"), Tag("tr"):
                for title in ("Signal", "Now", "At A", "At B", "B − A", "Lowest", "Highest", "Unit"):
                    Tag("th", title, scope="col")
            Tag("tbody", id="traces")
        Tag("p", _KEYS, "hint")
    return signals


def axis_choice(axis: str, signals: Sequence[ScopeSignal]) -> None:
    """Put the signals of an axis into the page."""
    with Tag("fieldset"):
        Tag("legend", axis)
        for signal in signals:
            with Tag("label", classes="check", title=signal.text):
                Tag("input", type="checkbox", data_signal=signal.name, data_unit=signal.unit)
                Tag("span", signal.name.rpartition(".")[2].replace("_", " "))


def _controls() -> None:
    with Tag("div", classes="row scope-controls"):
        Tag("button", "Stop", type="button", id="run")
        select("span", "Seconds", [(f"{span:g}", f"{span:g}") for span in _SPANS], f"{_USUAL:g}")
        select("trigger", "Trigger", _TRIGGERS, "")
        select("trigger-on", "on", (), "")
        select("edge", "when it", _EDGES, "rising")
        with Tag("label"):
            Tag("span", "Level")
            Tag("input", id="level", type="text", inputmode="decimal", autocomplete="off")
        Tag("button", "Save CSV", type="button", id="save-csv")
        Tag("button", "Save PNG", type="button", id="save-png")
        if can_save():
            Tag("button", "Save MCAP", type="button", id="save-mcap")
        else:
            Tag(
                "button", "Save MCAP: needs axisbus[record]", type="button", disabled="disabled", title=_NEEDS
            )


# -- The view of tuning: a step of an axis, the observed gains, the diagram that its script draws, and the figures ---------

TUNING_VIEW = "tuning"
_GAINS, _ROWS = 6, 20  # the most observed objects, and the most trials that the browser stores
_TUNING_KINDS = (("position", "position"), ("velocity", "velocity"))
_TUNING_FIELDS = ("distance", "velocity", "acceleration", "seconds")
_TUNING_HINT = (
    "The axis must already be enabled. A halt ends the trial when this page is hidden or closed, when it no longer has the "
    "controls, or when anything else moves or stops the axis: the trial then has no figures."
)
_TUNING_RAM = (
    "Values written here are in the drive's RAM only. To store them, end the programs that run the machine, then type: "
    "axisbus save NODE --cell CELL."
)
_TUNING_LINES = (
    "Time counts from the first observed motion. "
    f"The axis has settled when it stays within {BAND * 100:g} % of the step."
)


def tuning_view(machine: Machine, cell: str) -> None:
    """Put the view into the page; ``cell`` is the name under which a browser stores the selected gains."""
    with Tag(
        "section",
        data_view=TUNING_VIEW,
        aria_label="Tuning",
        data_cell=cell,
        data_gains=str(_GAINS),
        data_rows=str(_ROWS),
    ):
        Tag("h1", "Tuning")
        with Tag("div", classes="columns"):
            with Tag("div"):
                _tuning_step(machine)
            with Tag("div"):
                _tuning_gains()
        Tag("canvas", "", id="response", role="img", aria_label="No trial yet")
        with Tag("p", classes="hint legend-of-lines"):
            for kind, text in (
                ("actual", "actual"),
                ("target", "target"),
                ("demand", "demand"),
                ("pinned", "pinned trial"),
            ):
                Tag("span", text, kind)
        Tag("p", _TUNING_LINES, "hint")
        _tuning_table()


def _tuning_step(machine: Machine) -> None:
    with Tag("fieldset", data_values="step"):
        Tag("legend", "Step")
        with Tag("div", classes="row"):
            _tuning_axes(machine)
            select("tune-kind", "Step of", _TUNING_KINDS, _TUNING_KINDS[0][0])
        with Tag("div", classes="row"):
            for name in _TUNING_FIELDS:
                with Tag("label", data_step=name):
                    Tag("span", name.capitalize())
                    Tag("input", type="text", inputmode="decimal", autocomplete="off", data_value=name)
        with Tag("div", classes="row"):
            Tag("button", "Try", "go", type="button", id="tune-try")
            Tag("button", "End the trial", "halt", type="button", id="tune-end", disabled="disabled")
        Tag("p", "", id="tune-state", role="status")
        Tag("p", _TUNING_HINT, "hint")


def _tuning_axes(machine: Machine) -> None:
    with Tag("label"):
        Tag("span", "Axis")
        with Tag("select", id="tune-axis"):
            for name, config in machine.cell.axes.items():
                Tag("option", name, value=name, data_unit=config.unit, data_node=str(config.node))


def _tuning_gains() -> None:
    with Tag("fieldset"):
        Tag("legend", "Gains")
        Tag("p", f"Up to {_GAINS} objects, which are read before and after each trial.", "hint")
        with Tag("label"):
            Tag("span", "Search: 60FB, or words of a name")
            Tag("input", type="text", id="gain-search", autocomplete="off", spellcheck="false")
        Tag("p", "", "hint", id="gain-state", role="status")
        Tag("ul", id="gains-found", classes="plain")
        Tag("ul", id="gains", classes="plain")
        Tag("p", _TUNING_RAM, "hint")


def _tuning_table() -> None:
    with Tag("div", classes="row"):
        Tag("button", "Pin the last trial", type="button", id="tune-pin", disabled="disabled")
        Tag("button", "Unpin", type="button", id="tune-unpin", disabled="disabled")
    with scrolled("The trials, newest first"), Tag("table", classes="stacks"):
        with Tag("thead"), Tag("tr"):
            for title in ("Trial", *(title for _, title in FIGURES), "Gains before", "Gains after"):
                Tag("th", title, scope="col")
        Tag("tbody", id="trials", data_figures=" ".join(name for name, _ in FIGURES))
