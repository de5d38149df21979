"""The view of the objects: the node, the search, and the four parts that the script fills."""

from __future__ import annotations

from axisbus.machine.machine import Machine
from axisbus.web.commands.verbs import MAX_CYCLIC, MAX_OBJECTS
from axisbus.web.config.files import MAX_SIZE
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
    with Tag(
        "section",
        data_view=VIEW,
        aria_label="Objects",
        data_kept=str(MAX_CYCLIC),
        data_asked=str(MAX_OBJECTS),
    ):
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
        Tag("h2", "Repeated reading")
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


# ----------------------------------------------------------------------------------------------------------------------
# The view of configurations: the node, its backup, a file to compare it with, and the elements that the script fills.


CONFIG_VIEW = "config"
_BACKUP = "Reads every object of the node once, into a DCF, which this browser saves. It writes nothing to the node."
_FILE = (
    "Your own DCF, or the backup: it is compared with the present values of the node. Only Restore writes, and only with "
    "the controls: the drive's own settings, such as gains and filters."
)


def config_view(machine: Machine) -> None:
    """Put the view into the page."""
    with Tag("section", data_view=CONFIG_VIEW, aria_label="Configuration", data_most=str(MAX_SIZE)):
        Tag("h1", "Configuration")
        with Tag("div", classes="row looked-for"):
            nodes = [(str(node), named(machine, node)) for node in machine.cell.nodes]
            select("config-node", "Node", nodes, "")
        with Tag("div", classes="columns"):
            _backup()
            _file()
        _job()


def _backup() -> None:
    with Tag("fieldset"):
        Tag("legend", "Backup")
        Tag("p", _BACKUP, "hint")
        with Tag("div", classes="row"):
            Tag("button", "Back up", "go", type="button", id="backup")
            Tag("button", "Save the DCF", type="button", id="backup-save", disabled="disabled")
        Tag("p", "This page has not made a backup yet.", "lines", id="backup-state", role="status")


def _file() -> None:
    with Tag("fieldset"):
        Tag("legend", "Compare and restore")
        Tag("p", _FILE, "hint")
        with Tag("label"):
            Tag("span", "A DCF, at most 2 MB")
            Tag("input", type="file", id="config-file", accept=".dcf,.eds")
        Tag("p", "No file is chosen.", "lines", id="file-state", role="status")
        with Tag("div", classes="row"):
            Tag("button", "Take the backup", type="button", id="file-backup", disabled="disabled")
            Tag("button", "Compare", "go", type="button", id="compare", disabled="disabled")
            Tag(
                "button",
                "Values that a restore would write",
                type="button",
                id="would-restore",
                disabled="disabled",
            )
            Tag("button", "Restore the settings", type="button", id="restore", disabled="disabled")


def _job() -> None:
    Tag("progress", "", id="config-bar", aria_label="Progress of the job")
    with Tag("div", classes="row"):
        Tag("p", "", id="config-state", role="status")
        Tag("button", "Cancel", type="button", id="config-end", disabled="disabled")
    Tag("pre", "", "error", id="config-error")
    Tag("pre", "", "report", id="config-lines")
    Tag("div", id="config-rows")
    with Tag("div", id="config-refused", hidden="hidden"):
        Tag("h2", "Why this page does not restore the other values")
        Tag("pre", "", "error", id="config-refusal")
        Tag("p", "To restore the whole file, end the running machine, and type in the folder of the file:")
        Tag("pre", "", "typed", id="config-command")
