"""HTML elements of the page by name; their texts are always escaped."""

from __future__ import annotations

from collections.abc import Iterable

from nicegui.elements.mixins.text_element import TextElement


class Tag(TextElement):
    """An element with a text and attributes; an underscore in the name of an attribute is a hyphen."""

    def __init__(self, name: str, text: str = "", classes: str = "", **attributes: str) -> None:
        """Put the element into the open one (``with``)."""
        super().__init__(tag=name, text=text)
        if classes:
            self.classes(classes)
        for attribute, value in attributes.items():
            self.props[attribute.rstrip("_").replace("_", "-")] = value


def button(text: str, do: str, classes: str = "", **attributes: str) -> Tag:
    """Return a button that sends a request; the page's own script sends it."""
    return Tag("button", text, classes, type="button", data_do=do, **attributes)


def live(name: str, classes: str = "") -> Tag:
    """Return an element for a value that the page's own script fills in."""
    return Tag("output", "", f"live {classes}", data_live=name)


def scrolled(label: str) -> Tag:
    """Return a container for contents that may be wider than the screen; it is focusable, so that arrow keys scroll it."""
    return Tag("div", classes="scroll", tabindex="0", role="region", aria_label=label)


def select(name: str, label: str, options: Iterable[tuple[str, str]], chosen: str) -> None:
    """Put in a choice of one value, each with its text, under a label; ``name`` is its id."""
    with Tag("label"):
        Tag("span", label)
        with Tag("select", id=name):
            for value, text in options:
                Tag("option", text, value=value, **({"selected": "selected"} if value == chosen else {}))
