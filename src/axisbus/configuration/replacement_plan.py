"""Plan the replacement of a drive: which drive is the new one, whether it fits, and the steps; pure.

Theory of operation
-------------------
The state of a replacement is in the device: node-ID, identity and values. So an interrupted replacement is planned again from what
is found, and each step does what is still missing. Only one fact cannot be read from the device: whether it has stored the node-ID
that it got by LSS. For this case a note beside the cell file says that its node-ID is set.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from axisbus.configuration.nameplate import TITLES, Nameplate, value_text
from axisbus.configuration.replacement_order import FoundDrive, ReplacementOrder, ReplacementStep
from axisbus.errors import StateError
from axisbus.json_document import read_document

_KIND, _FORMAT = "axisbus replacement", 1
_SHOWN = ("device_name", "vendor", "product", "revision", "serial", "hardware_version", "software_version")
_NOTHING = "nothing was written"


@dataclass(frozen=True, slots=True)
class UnfinishedReplacement:
    """The note of a replacement that has begun: the serial number of the new drive, and whether its node-ID is set."""

    node: int
    serial: int | None
    sets_node_id: bool

    def as_json(self) -> str:
        """Return the contents of the note."""
        return json.dumps({"kind": _KIND, "format": _FORMAT, **asdict(self)}, indent=1) + "\n"


def note_file(cell: str | Path, node_id: int) -> Path:
    """Return the file of the note about a node of a cell file."""
    path = Path(cell)
    return path.with_name(f"{path.stem}.replacement-{node_id}.json")


def parse_note(text: str, source: str) -> UnfinishedReplacement:
    """Read the contents of a note; messages name ``source``.

    Raises:
        ArgumentError: it is no such note.
    """
    remedy = "delete it, and run axisbus replace again"
    what = "the note of a replacement of a drive"
    found = read_document(text, source, kind=_KIND, version=_FORMAT, what=what, remedy=remedy)
    node, serial = found.get("node"), found.get("serial")
    return UnfinishedReplacement(
        node if isinstance(node, int) else 0,
        serial if isinstance(serial, int) else None,
        found.get("sets_node_id") is True,
    )


@dataclass(frozen=True, slots=True)
class NodeToReplace:
    """A node of a cell file and what is known about it; None: unknown, or not given.

    ``vendor``, ``product`` and ``eds_revision`` are those of its EDS or DCF, ``revision`` and ``serial`` those of its table.
    ``was``: its stored nameplate. ``configuration``: the DCF to restore. ``running``: whether a machine of the cell runs.
    """

    node_id: int
    cell: str
    vendor: int | None = None
    product: int | None = None
    eds_revision: int | None = None
    revision: int | None = None
    serial: int | None = None
    was: Nameplate | None = None
    unfinished: UnfinishedReplacement | None = None
    configuration: str | None = None
    running: bool = False


@dataclass(frozen=True, slots=True)
class IdentityMismatch:
    """A number of a drive's identity that does not fit: the text, and the remedy."""

    text: str
    remedy: str


@dataclass(frozen=True, slots=True)
class ReplacementPlan:
    """The new drive of a node, and the steps that make it the drive of this node."""

    node: NodeToReplace
    drive: FoundDrive
    steps: tuple[ReplacementStep, ...]

    @property
    def order(self) -> ReplacementOrder:
        """The order with which ``DriveReplacement`` does the steps at the device."""
        was, now = None if self.node.was is None else self.node.was.serial, self.drive.serial
        # The core finishes a replacement whose command was killed: the drive then runs, and the record may have its number.
        was_begun = self.node.unfinished is not None and self.node.unfinished.serial == now
        swapped = bool(now and (was_begun or (was and was != now)))
        return ReplacementOrder(self.node.node_id, self.drive, self.steps, self.node.configuration, swapped)

    @property
    def note(self) -> UnfinishedReplacement:
        """The note while the replacement is unfinished."""
        return UnfinishedReplacement(
            self.node.node_id, self.drive.serial, ReplacementStep.NODE_ID in self.steps
        )

    def rows(self) -> list[tuple[str, str, str]]:
        """Return the numbers of the old and of the new drive: title, old value, new value; unknown values are empty."""
        now, was = asdict(self.drive), self.node.was
        before = {} if was is None else asdict(was)
        texts = [
            (TITLES[name], value_text(name, before.get(name)), value_text(name, now[name])) for name in _SHOWN
        ]
        return [row for row in texts if row[1] or row[2]]


def plan(node: NodeToReplace, found: Sequence[FoundDrive]) -> ReplacementPlan:
    """Return the plan for the one drive that fits among those that were found.

    Raises:
        StateError: there is nothing to replace, no drive or more than one that could be the new one, or it does not fit.
    """
    at = next((drive for drive in found if drive.node_id == node.node_id), None)
    drive = _one_of(node, found) if at is None else at
    if at is not None:
        _require_another(node, at)
    other = mismatches(node, drive)
    if other:
        raise StateError(
            f"the drive {drive.where} cannot replace that of node {node.node_id}; {_NOTHING}",
            observed="; ".join(each.text for each in other),
            remedy=other[0].remedy,
        )
    return ReplacementPlan(node, drive, _steps(node, drive))


def mismatches(node: NodeToReplace, drive: FoundDrive) -> list[IdentityMismatch]:
    """Return why a drive does not fit; a vendor-ID or product code that it does not report is not compared, as at boot-up."""
    was = node.was
    found = []
    for name, of_file, before, now in (
        ("vendor", node.vendor, None if was is None else was.vendor, drive.vendor),
        ("product", node.product, None if was is None else was.product, drive.product),
    ):
        expected = of_file or before
        if expected and now and expected != now:
            found.append(_mismatch(name, [expected], now, "use a drive of the same type"))
    if found:
        return found
    table = f"[nodes.{node.node_id}] of {node.cell}"
    revisions = _revisions(node)
    if revisions and drive.revision not in revisions:
        remedy = (
            f"use a drive with that revision; if the EDS of {table} is right for the new revision, write "
            f"revision = 0x{drive.revision or 0:X} there"
        )
        found.append(_mismatch("revision", revisions, drive.revision, remedy))
    if node.serial is not None and drive.serial != node.serial:
        remedy = f"write serial = {drive.serial} in {table}, and run the command again"
        found.append(_mismatch("serial", [node.serial], drive.serial, remedy))
    return found


def _mismatch(name: str, expected: Sequence[int], now: int | None, remedy: str) -> IdentityMismatch:
    wanted = " or ".join(value_text(name, each) for each in expected)
    return IdentityMismatch(
        f"{TITLES[name]} is {value_text(name, now) or 'unknown'}, expected is {wanted}", remedy
    )


def _revisions(node: NodeToReplace) -> list[int]:
    """Return the revisions that a new drive may have: that of the cell file, else those of EDS and record; empty: any."""
    if node.revision is not None:
        return [node.revision]
    known = (None if node.was is None else node.was.revision, node.eds_revision)
    return list(dict.fromkeys(each for each in known if each))


def _one_of(node: NodeToReplace, found: Sequence[FoundDrive]) -> FoundDrive:
    """Return the only drive that fits; if none fits, one that does not, for the reasons."""
    if not found:
        raise StateError(
            f"no drive was found that could replace that of node {node.node_id}; {_NOTHING}",
            observed=f"node {node.node_id} does not answer, no other node-ID answers than those of {node.cell}, and no drive "
            "without a node-ID answers LSS fast scan",
            remedy="check its supply, cable and bit rate: a drive with another bit rate does not answer (connect it alone, "
            "and use axisbus lss set-bitrate)",
        )
    candidates = [drive for drive in found if not mismatches(node, drive)] or list(found)
    if len(candidates) > 1:
        raise StateError(
            f"several drives were found, and it is not known which replaces that of node {node.node_id}; {_NOTHING}",
            observed="; ".join(
                f"{drive.where}: "
                + ", ".join([each.text for each in mismatches(node, drive)] or [_serial_text(drive)])
                for drive in candidates
            ),
            remedy="connect only the new drive of this node, and run the command again",
        )
    return candidates[0]


def _serial_text(drive: FoundDrive) -> str:
    return f"{TITLES['serial']} is {value_text('serial', drive.serial) or 'unknown'}"


def _require_another(node: NodeToReplace, at: FoundDrive) -> None:
    was, note = node.was, node.unfinished
    if was is None or not was.serial or was.serial != at.serial:
        return
    if note is not None and note.serial == at.serial:
        return
    raise StateError(
        f"node {node.node_id} has not been replaced; {_NOTHING}",
        observed=f"the drive that answers has the serial number of the record: {value_text('serial', at.serial)}",
        remedy=f"to restore its configuration: axisbus config restore; to boot it: axisbus boot {node.cell} --node "
        f"{node.node_id}",
    )


def _steps(node: NodeToReplace, drive: FoundDrive) -> tuple[ReplacementStep, ...]:
    note, restores = node.unfinished, node.configuration is not None
    resumed = note is not None and note.serial == drive.serial and note.sets_node_id
    wanted = {
        ReplacementStep.NODE_ID: drive.node_id != node.node_id or resumed,
        ReplacementStep.CONFIGURE: restores,
        ReplacementStep.STORE: restores,
        ReplacementStep.RESTART: restores,
        ReplacementStep.VERIFY: restores,
        ReplacementStep.BOOT: node.running,
        ReplacementStep.RECORD: node.was is not None,
    }
    return tuple(step for step, needed in wanted.items() if needed)
