"""The view of configurations: the node, its backup, a file to compare it with, and the elements that the script fills."""

from __future__ import annotations

from axisbus.machine.machine import Machine
from axisbus.web.config.files import MOST
from axisbus.web.page.objects_view import named
from axisbus.web.page.tags import Tag, select

VIEW = "config"
_BACKUP = "Reads every object of the node once, into a DCF, which this browser saves. It writes nothing to the node."
_FILE = (
    "Your own DCF, or the backup: it is compared with the present values of the node. Only Restore writes, and only with "
    "the controls: the drive's own settings, such as gains and filters."
)


def config_view(machine: Machine) -> None:
    """Put the view into the page."""
    with Tag("section", data_view=VIEW, aria_label="Configuration", data_most=str(MOST)):
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
        Tag("h2", "Why this page does not restore the rest")
        Tag("pre", "", "error", id="config-refusal")
        Tag("p", "To restore the whole file, end the running machine, and type in the folder of the file:")
        Tag("pre", "", "typed", id="config-command")
