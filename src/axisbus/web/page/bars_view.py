"""The limits of an axis as bars; the page's own script draws their values."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.web.page.tags import Tag
from axisbus.web.view.bars import Bar, Span


def bars_view(bars: Iterable[Bar]) -> None:
    """Put the bars of an axis into its view; if no limit is known, a text says so instead of the bar."""
    with Tag("div", classes="bars"):
        Tag("h2", "Limits")
        for bar in bars:
            if bar.span is None:
                Tag("p", f"{bar.title}: no limit is known", "none")
            else:
                _bar(bar, bar.span)


def _bar(bar: Bar, span: Span) -> None:
    low, high = (f"{each:g}" for each in span)
    with Tag("div", classes="bar live", data_bar=bar.name):
        with Tag("div", classes="said"):
            Tag("span", bar.title)
            Tag("output")
            Tag("span", bar.unit)
        meter = {"aria_label": bar.title, "aria_valuemin": low, "aria_valuemax": high}
        with Tag("div", classes="track", role="meter", data_unit=bar.unit, **meter):
            Tag("i", classes="fill")
            Tag("i", classes="mark")
        with Tag("div", classes="ends"):
            Tag("span", low)
            Tag("em")
            Tag("span", high)
