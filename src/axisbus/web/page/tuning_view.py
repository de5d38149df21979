"""The view of tuning: a step of an axis, the observed gains, the diagram that its script draws, and the figures."""

from __future__ import annotations

from axisbus.machine.machine import Machine
from axisbus.step_response import BAND
from axisbus.web.page.tags import Tag, scrolled, select
from axisbus.web.tuning.outcome import FIGURES

VIEW = "tuning"
_GAINS, _ROWS = 6, 20  # the most observed objects, and the most trials that the browser stores
_KINDS = (("position", "position"), ("velocity", "velocity"))
_FIELDS = ("distance", "velocity", "acceleration", "seconds")
_HINT = (
    "The axis must already be enabled. A halt ends the trial when this page is hidden or closed, when it no longer has the "
    "controls, or when anything else moves or stops the axis: the trial then has no figures."
)
_RAM = (
    "Values written here are in the drive's RAM only. To store them, end the programs that run the machine, then type: "
    "axisbus save NODE --cell CELL."
)
_LINES = f"Time counts from the first observed motion. The axis has settled when it stays within {BAND * 100:g} % of the step."


def tuning_view(machine: Machine, cell: str) -> None:
    """Put the view into the page; ``cell`` is the name under which a browser stores the selected gains."""
    with Tag(
        "section",
        data_view=VIEW,
        aria_label="Tuning",
        data_cell=cell,
        data_gains=str(_GAINS),
        data_rows=str(_ROWS),
    ):
        Tag("h1", "Tuning")
        with Tag("div", classes="columns"):
            with Tag("div"):
                _step(machine)
            with Tag("div"):
                _gains()
        Tag("canvas", "", id="response", role="img", aria_label="No trial yet")
        with Tag("p", classes="hint legend-of-lines"):
            for kind, text in (
                ("actual", "actual"),
                ("target", "target"),
                ("demand", "demand"),
                ("pinned", "pinned trial"),
            ):
                Tag("span", text, kind)
        Tag("p", _LINES, "hint")
        _table()


def _step(machine: Machine) -> None:
    with Tag("fieldset", data_values="step"):
        Tag("legend", "Step")
        with Tag("div", classes="row"):
            _axes(machine)
            select("tune-kind", "Step of", _KINDS, _KINDS[0][0])
        with Tag("div", classes="row"):
            for name in _FIELDS:
                with Tag("label", data_step=name):
                    Tag("span", name.capitalize())
                    Tag("input", type="text", inputmode="decimal", autocomplete="off", data_value=name)
        with Tag("div", classes="row"):
            Tag("button", "Try", "go", type="button", id="tune-try")
            Tag("button", "End the trial", "halt", type="button", id="tune-end", disabled="disabled")
        Tag("p", "", id="tune-state", role="status")
        Tag("p", _HINT, "hint")


def _axes(machine: Machine) -> None:
    with Tag("label"):
        Tag("span", "Axis")
        with Tag("select", id="tune-axis"):
            for name, config in machine.cell.axes.items():
                Tag("option", name, value=name, data_unit=config.unit, data_node=str(config.node))


def _gains() -> None:
    with Tag("fieldset"):
        Tag("legend", "Gains")
        Tag("p", f"Up to {_GAINS} objects, which are read before and after each trial.", "hint")
        with Tag("label"):
            Tag("span", "Search: 60FB, or words of a name")
            Tag("input", type="text", id="gain-search", autocomplete="off", spellcheck="false")
        Tag("p", "", "hint", id="gain-state", role="status")
        Tag("ul", id="gains-found", classes="plain")
        Tag("ul", id="gains", classes="plain")
        Tag("p", _RAM, "hint")


def _table() -> None:
    with Tag("div", classes="row"):
        Tag("button", "Pin the last trial", type="button", id="tune-pin", disabled="disabled")
        Tag("button", "Unpin", type="button", id="tune-unpin", disabled="disabled")
    with scrolled("The trials, newest first"), Tag("table", classes="stacks"):
        with Tag("thead"), Tag("tr"):
            for title in ("Trial", *(title for _, title in FIGURES), "Gains before", "Gains after"):
                Tag("th", title, scope="col")
        Tag("tbody", id="trials", data_figures=" ".join(name for name, _ in FIGURES))
