"""The jobs that take a DCF: a comparison, a dry run of a restore, and a restore; in the server or in a process of their own."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, Protocol

from axisbus.boot.dcf import settings
from axisbus.bus.node.node import read_identity
from axisbus.bus.sdo.access import ByObjects
from axisbus.cell.model import CellConfig
from axisbus.configuration import compare as device_side
from axisbus.configuration import dcf_values, preconditions, report_text
from axisbus.configuration.dcf_values import Item, Key, Selection
from axisbus.configuration.restore import Restore, Result, ValueEnd
from axisbus.drives import registry
from axisbus.eds.model import Eds
from axisbus.errors import BusError, StateError, Stopped
from axisbus.web.config.files import Dcf
from axisbus.web.config.report import ConfigJobKind, ConfigReport
from axisbus.web.view import explained

OnProgress = Callable[[int, int], None]
OBJECT, NAME = "Object", "Name"
_YES, _NO = "yes", "no: the machine has set it, or uses it"
_IN_RAM = "; the written values are lost at the next power-off, unless the drive stores them: axisbus save"


class JobNode(ByObjects, Protocol):
    """A node of a running machine, for a job; its calls block for transfers."""

    @property
    def cell(self) -> CellConfig:
        """The cell of the machine."""

    @property
    def cyclic(self) -> frozenset[Key]:
        """The objects that the machine sends by PDO."""

    def require_not_energised(self) -> None:
        """Raise StateError if a drive of the node is energised."""

    def refusal(self) -> StateError:
        """Return why the node is not restored completely."""


def carry_out(kind: ConfigJobKind, node: JobNode, file: Dcf, on_progress: OnProgress) -> ConfigReport:
    """Carry out a job that takes a file; blocks for one transfer per object. ``on_progress(done, all)`` is called after each.

    Raises:
        AxisbusError: any error of the library about the file or the node.
    """
    jobs = {
        ConfigJobKind.COMPARE: _compare,
        ConfigJobKind.WOULD_RESTORE: _would_restore,
        ConfigJobKind.RESTORE: _restore,
    }
    return jobs[kind](node, file, on_progress)


def _compare(node: JobNode, file: Dcf, on_progress: OnProgress) -> ConfigReport:
    found = device_side.against(node, file.reading().eds, on_progress)
    rows = tuple(
        (
            f"{each.variable.index:04X}h:{each.variable.subindex:02X}",
            each.variable.name,
            *(("", each.note) if each.note else report_text.sides(each)),
        )
        for each in found.differences
    )
    titles = (OBJECT, NAME, report_text.short(file.name), f"node {node.node_id}")
    return ConfigReport(report_text.compared(found), (), titles, rows)


def _would_restore(node: JobNode, file: Dcf, on_progress: OnProgress) -> ConfigReport:
    """Report the values that a restore would write, which of them this page would write, and how to restore the others."""
    chosen = _chosen(node, file)
    restore = Restore(node.sdo, chosen.whole, lambda _, done, whole: on_progress(done, whole))
    differing = restore.read_present()
    dcf_values.require_within_limits(differing, chosen.eds, node.node_id)
    present = {each.item.key: each.before for each in restore.report().results}
    restorable = {item.key for item in chosen.settings.items}
    rows = tuple(
        (
            *_object(each),
            _shown(each, present[each.key]),
            _shown(each, each.data),
            _YES if each.key in restorable else _NO,
        )
        for each in differing
    )
    return ConfigReport(
        report_text.would(differing, chosen.whole),
        tuple(f"a restore would skip {line}" for line in report_text.skipped(chosen.whole.skipped)),
        (OBJECT, NAME, "Present value", "Value in the file", "Restored here"),
        rows,
        _refusal(node, all_restorable=restorable.issuperset(each.key for each in differing)),
        _command(node, file),
    )


def _restore(node: JobNode, file: Dcf, on_progress: OnProgress) -> ConfigReport:
    """Write a node's own settings from the file, and read them back; other objects are not changed."""
    chosen = _chosen(node, file)
    node.require_not_energised()
    run = Restore(node.sdo, chosen.settings, lambda _, done, whole: on_progress(done, whole))
    dcf_values.require_within_limits(run.read_present(), chosen.eds, node.node_id)
    try:
        found, broken = run.run(), {}
    except (BusError, StateError, Stopped) as error:  # report the written values in any case
        found, broken = run.report(), explained(error)
    rows = tuple(
        (
            *_object(each.item),
            _shown(each.item, each.before),
            _shown(each.item, each.after),
            _outcome_text(each),
        )
        for each in found.results
        if each.outcome is not ValueEnd.SAME
    )
    return ConfigReport(
        report_text.restored(found) + (_IN_RAM if found.writes else ""),
        tuple(f"skipped {line}" for line in report_text.skipped(found.skipped)),
        (OBJECT, NAME, "Previous value", "Present value", "Result"),
        rows,
        explained(node.refusal()),
        _command(node, file),
        broken=broken,
    )


class _Chosen(NamedTuple):
    """The values of a file for a node: ``whole``, and the ``settings`` among them, which may be written while the machine runs."""

    eds: Eds
    whole: Selection
    settings: Selection


def _chosen(node: JobNode, file: Dcf) -> _Chosen:
    reading = file.reading()
    dcf_values.require_values(reading)
    identity = read_identity(node.sdo)
    preconditions.require_same_device(reading.eds, identity, node.node_id, replacement=False)
    make = registry.of_identity(identity)
    whole = dcf_values.select(reading.eds, node.node_id, make)
    return _Chosen(
        reading.eds, whole, settings(node.cell, node.node_id, reading.eds, make, node.cyclic, whole)
    )


def _refusal(node: JobNode, *, all_restorable: bool) -> Mapping[str, str]:
    if all_restorable:
        try:
            node.require_not_energised()
        except StateError:
            pass
        else:
            return {}
    return explained(node.refusal())


def _object(item: Item) -> tuple[str, str]:
    return f"{item.variable.index:04X}h:{item.variable.subindex:02X}", item.variable.name


def _shown(item: Item, data: bytes | None) -> str:
    return report_text.data_shown(item.variable, data)


def _outcome_text(result: Result) -> str:
    return f"{result.outcome.value}: {result.reason}" if result.reason else result.outcome.value


def _command(node: JobNode, file: Dcf) -> str:
    cell = shlex.quote(Path(node.cell.file).name)
    return f"axisbus config restore {shlex.quote(file.name)} {node.node_id} --cell {cell}"
