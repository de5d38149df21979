"""The view of the scope: the signals, start and stop, the diagram that its script draws, and the values as text."""

from __future__ import annotations

from collections.abc import Sequence

from axisbus.web.page.tags import Tag, scrolled, select
from axisbus.web.scope.saving import can_save
from axisbus.web.scope.signals import MOST, ScopeSignal

VIEW = "scope"
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
    with Tag("section", data_view=VIEW, aria_label="Scope", data_cell=cell, data_most=str(MOST)):
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
