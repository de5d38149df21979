"""The view of the objects: the node, the search, and the four parts that the script fills."""

from __future__ import annotations

from axisbus.machine.machine import Machine
from axisbus.web.commands.verbs import ASKED, KEPT
from axisbus.web.page.tags import Tag, select

VIEW = "objects"
_PARTS = (
    ("dictionary", "Dictionary"),
    ("pdos", "PDOs"),
    ("findings", "Findings in the EDS"),
    ("verify", "Verify"),
)
_KEYS = "Keyboard: the arrows move through the objects and open them, Tab enters an open object, Enter presses a button."
_VERIFY = (
    "Reads every object of the drive once and compares it with the EDS: existence, access, size, identity, PDO maps, defaults. "
    "It writes nothing. Only the page with the controls may start and cancel it."
)


def objects_view(machine: Machine) -> None:
    """Put the view into the page."""
    with Tag("section", data_view=VIEW, aria_label="Objects", data_kept=str(KEPT), data_asked=str(ASKED)):
        Tag("h1", "Objects")
        with Tag("div", classes="row looked-for"):
            select(
                "object-node", "Node", [(str(node), named(machine, node)) for node in machine.cell.nodes], ""
            )
            with Tag("div", classes="row parts", role="group", aria_label="Parts"):
                for name, title in _PARTS:
                    Tag("button", title, type="button", data_part=name)
        Tag("p", "", "hint", id="objects-state", role="status")
        Tag("pre", "", "error", id="objects-error")
        with Tag("div", id="part-dictionary"):
            _dictionary()
        Tag("div", id="part-pdos")
        Tag("div", id="part-findings")
        with Tag("div", id="part-verify"):
            _verify()


def named(machine: Machine, node_id: int) -> str:
    """Return the name of a node for its selection: its ID, and its axes."""
    return ", ".join((f"node {node_id}", *(axis.name for axis in machine.cell.axes_of(node_id))))


def _dictionary() -> None:
    with Tag("div", classes="row looked-for"):
        with Tag("label"):
            Tag("span", "Search: 6064, 0x6064, 6064h, or words of a name")
            Tag("input", type="text", id="object-search", autocomplete="off", spellcheck="false")
        with Tag("label", classes="check"):
            Tag("input", type="checkbox", id="in-pdos")
            Tag("span", "only objects that a PDO may carry")
    with Tag("div", id="kept", classes="scroll"):
        Tag("h2", "Kept reading")
        with Tag("table"):
            Tag("tbody", id="kept-rows")
    Tag("ul", id="tree", classes="plain tree")
    Tag("p", _KEYS, "hint")


def _verify() -> None:
    Tag("p", _VERIFY, "hint")
    with Tag("div", classes="row"):
        Tag("button", "Verify", "go", type="button", id="verify")
        Tag("button", "Cancel", type="button", id="verify-end")
    Tag("progress", "", id="verify-bar", aria_label="Progress of the verification")
    Tag("p", "", id="verify-state", role="status")
    Tag("pre", "", "error", id="verify-error")
    Tag("div", id="differences")
