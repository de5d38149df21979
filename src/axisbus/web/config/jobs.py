"""The configuration jobs: as ``axisbus config``, but for a node of a running machine.

The library restores a whole configuration only to a node that is pre-operational and not controlled by another program. The nodes
of a running machine are neither. So a restore here writes only the drive's own settings (``boot.dcf``), and only while no
drive of the node is energised. For all other objects the page shows the difference, why it is not written here, and the command to
type.
"""

from __future__ import annotations

import shlex
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from axisbus.boot.dcf import settings
from axisbus.bus.link.listen import link_bitrate
from axisbus.bus.node.node import read_identity
from axisbus.configuration import compare as device_side
from axisbus.configuration import dcf_backup, dcf_values, guarded_write, preconditions, report_text
from axisbus.configuration.dcf_values import Item, Selection
from axisbus.configuration.restore import Restore, Result, ValueEnd
from axisbus.drives import registry
from axisbus.eds import builtin, dcf, writer
from axisbus.eds.io import reader
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, BusError, StateError, Stopped
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode
from axisbus.machine.node_access import NodeAccess
from axisbus.web.access.lease import Refusal
from axisbus.web.config.files import BROUGHT, MADE, MOST, Dcf, PageFiles
from axisbus.web.config.report import ConfigJob, ConfigJobKind, ConfigProgress, ConfigReport
from axisbus.web.objects.verifying import PacedNode, PacedSdo, WritingSdo
from axisbus.web.view.axes import explained
from axisbus.wording import counted

Tell = Callable[[int, int], None]
_OBJECT, _NAME = "Object", "Name"
_YES, _NO = "yes", "no: the machine has set it, or uses it"
_IN_RAM = "; the written values are lost at the next power-off, unless the drive stores them: axisbus save"


def carry_out(machine: Machine, node: PacedNode, wanted: ConfigJob, tell: Tell) -> ConfigReport:
    """Carry out a job; blocks for one transfer per object. ``tell(done, all)`` is called after each transfer.

    Raises:
        AxisbusError: any error of the library about the file or the node.
    """
    if wanted.kind is ConfigJobKind.BACKUP:
        return backup(machine, node, tell)
    assert wanted.file is not None
    if wanted.kind is ConfigJobKind.COMPARE:
        return compare(node, wanted.file, tell)
    how = restore if wanted.kind is ConfigJobKind.RESTORE else would_restore
    return how(machine, node, wanted.file, tell)


def backup(machine: Machine, node: PacedNode, tell: Tell) -> ConfigReport:
    """Read every object of a node into a DCF."""
    file = machine.cell.nodes[node.node_id].file
    assert file is not None  # only a node without objects needs no file
    path = builtin.resolve(file, machine.cell.folder)
    reading = reader.read(reader.file_bytes(path), str(path))
    who = read_identity(node.sdo)
    bus = machine.cell.bus
    settings = dcf.Settings(
        node.node_id,
        dcf_backup.known_rate(reading, bus.bitrate or link_bitrate(bus.interface, bus.channel)),
        file_name=dcf_backup.file_name(node.node_id, who.serial),
        last_eds=path.name,
    )
    made = dcf_backup.backup(node.sdo, reading, settings, tell)
    data = writer.dumps(made.reading)
    if len(data) > MOST:
        raise StateError(
            f"the backup of node {node.node_id} has {counted(len(data), 'octet')}, more than a page can store",
            remedy="make it by axisbus config backup",
        )
    name = str(settings.file_name)
    lines = (*report_text.device(who, path.name, node.node_id), f"{name}: {counted(len(data), 'octet')}")
    rows = tuple((f"{each.index:04X}h:{each.subindex:02X}", each.name, each.reason) for each in made.left_out)
    return ConfigReport(
        report_text.read(made), lines, (_OBJECT, _NAME, "Left out, because"), rows, dcf=Dcf(name, data)
    )


def compare(node: PacedNode, file: Dcf, tell: Tell) -> ConfigReport:
    """Compare a file with the present values of a node."""
    found = device_side.against(node, file.reading().eds, tell)
    rows = tuple(
        (
            f"{each.variable.index:04X}h:{each.variable.subindex:02X}",
            each.variable.name,
            *(("", each.note) if each.note else report_text.sides(each)),
        )
        for each in found.differences
    )
    titles = (_OBJECT, _NAME, report_text.short(file.name), f"node {node.node_id}")
    return ConfigReport(report_text.compared(found), (), titles, rows)


def would_restore(machine: Machine, node: PacedNode, file: Dcf, tell: Tell) -> ConfigReport:
    """Report the values that a restore would write, which of them this page would write, and how to restore the others."""
    chosen = _chosen(machine, node, file)
    restore = Restore(node.sdo, chosen.whole, lambda _, done, whole: tell(done, whole))
    differing = restore.look()
    dcf_values.require_within_limits(differing, chosen.eds, node.node_id)
    held = {each.item.key: each.before for each in restore.report().results}
    here = {item.key for item in chosen.settings.items}
    rows = tuple(
        (
            *_object(each),
            _shown(each, held[each.key]),
            _shown(each, each.data),
            _YES if each.key in here else _NO,
        )
        for each in differing
    )
    all_here = here.issuperset(each.key for each in differing) and not guarded_write.energised(node)
    return ConfigReport(
        report_text.would(differing, chosen.whole),
        tuple(f"a restore would skip {line}" for line in report_text.skipped(chosen.whole.skipped)),
        (_OBJECT, _NAME, "Present value", "Value in the file", "Restored here"),
        rows,
        {} if all_here else explained(refusal(machine.node(node.node_id), node)),
        _command(machine, node, file),
    )


def restore(machine: Machine, node: PacedNode, file: Dcf, tell: Tell) -> ConfigReport:
    """Write a node's own settings from the file, and read them back; other objects are not changed."""
    chosen = _chosen(machine, node, file)
    preconditions.require_not_energised(node)
    run = Restore(node.sdo, chosen.settings, lambda _, done, whole: tell(done, whole))
    dcf_values.require_within_limits(run.look(), chosen.eds, node.node_id)
    try:
        found, broken = run.run(), {}
    except (BusError, StateError, Stopped) as error:  # report the written values in any case
        found, broken = run.report(), explained(error)
    rows = tuple(
        (*_object(each.item), _shown(each.item, each.before), _shown(each.item, each.after), _came(each))
        for each in found.results
        if each.outcome is not ValueEnd.SAME
    )
    return ConfigReport(
        report_text.restored(found) + (_IN_RAM if found.writes else ""),
        tuple(f"skipped {line}" for line in report_text.skipped(found.skipped)),
        (_OBJECT, _NAME, "Previous value", "Present value", "Result"),
        rows,
        explained(refusal(machine.node(node.node_id), node)),
        _command(machine, node, file),
        broken=broken,
    )


class _Chosen(NamedTuple):
    """The values of a file for a node: ``whole``, and the ``settings`` among them, which may be written while the machine runs."""

    eds: Eds
    whole: Selection
    settings: Selection


def _chosen(machine: Machine, node: PacedNode, file: Dcf) -> _Chosen:
    reading = file.reading()
    dcf_values.require_values(reading)
    who = read_identity(node.sdo)
    preconditions.require_same_device(reading.eds, who, node.node_id, replacement=False)
    make = registry.find(who.vendor_id, who.product_code)
    whole = dcf_values.select(reading.eds, node.node_id, make)
    cyclic = frozenset(machine.node(node.node_id).sdo.cyclic)
    return _Chosen(reading.eds, whole, settings(machine.cell, node.node_id, reading.eds, make, cyclic, whole))


def _object(item: Item) -> tuple[str, str]:
    return f"{item.variable.index:04X}h:{item.variable.subindex:02X}", item.variable.name


def _shown(item: Item, data: bytes | None) -> str:
    return report_text.data_shown(item.variable, data)


def _came(result: Result) -> str:
    return f"{result.outcome.value}: {result.reason}" if result.reason else result.outcome.value


def _command(machine: Machine, node: PacedNode, file: Dcf) -> str:
    cell = shlex.quote(Path(machine.cell.file).name)
    return f"axisbus config restore {shlex.quote(file.name)} {node.node_id} --cell {cell}"


def refusal(access: NodeAccess, node: PacedNode) -> StateError:
    """Return why a node of a running machine is not restored completely: the library's own conditions, else the running machine."""
    try:
        preconditions.require_not_energised(node)
        preconditions.require_pre_operational(node.node_id, access.nmt)
    except StateError as error:
        return error
    return StateError(
        f"node {node.node_id} belongs to a running machine: it is not configured; nothing was written",
        observed="its core boots it again, and sends to it in every cycle",
        remedy="end the program that runs the machine",
    )


# -- The one configuration job that may run at a time: started by a page, shown on all, paced, and cancellable ---------


_NO_FILE = Refusal("this page has sent no file", "choose a DCF or make a backup first")


@dataclass(slots=True)
class _Job:
    """A started job; ``gives_way``: it was cancelled for a page that has the controls."""

    wanted: ConfigJob
    cancelled: threading.Event = field(default_factory=threading.Event)
    gives_way: bool = False


class Configuring:
    """Hold the running or last job, and the files of the pages; another thread carries the job out."""

    def __init__(self) -> None:
        self.now: ConfigProgress | None = None
        self.files = PageFiles()
        self._waiting: _Job | None = None
        self._running: _Job | None = None

    @property
    def busy(self) -> Refusal | None:
        """Why no other job may begin now; None while no job runs, or the running one was cancelled for another page."""
        job = self._waiting or self._running
        if job is None or job.gives_way:
            return None
        wanted = job.wanted
        return Refusal(
            f"{wanted.kind.text} of node {wanted.node} is already running, for page {wanted.page}",
            "wait until it is done; that page may cancel it, and so may the page with the controls",
        )

    def begin(self, page: int, kind: ConfigJobKind, node: int) -> Refusal | None:
        """Start a job of a page, with the file that it has uploaded if the job needs one; return why not, if that is impossible."""
        file = None if kind is ConfigJobKind.BACKUP else self.files.of(page, BROUGHT)
        if kind is not ConfigJobKind.BACKUP and file is None:
            return _NO_FILE
        if (busy := self.busy) is not None:
            return busy
        self._waiting = _Job(ConfigJob(kind, page, node, file))
        if self._running is None:
            self.now = ConfigProgress(self._waiting.wanted)
        return None

    def give_way(self, page: int) -> None:
        """Cancel the job of another page, so that ``page``, which has the controls, can start one without waiting."""
        for job in (self._waiting, self._running):
            if job is not None and job.wanted.page != page:
                job.cancelled.set()
                job.gives_way = True
        if self._waiting is not None and self._waiting.gives_way:
            self.now = self.failed(self._waiting.wanted, _gave_way(self._waiting.wanted, page))
            self._waiting = None

    def end(self, page: int | None = None) -> None:
        """Cancel the job; if ``page`` is given, only if that page has started it."""
        for job in (self._waiting, self._running):
            if job is not None and page in (None, job.wanted.page):
                job.cancelled.set()

    def end_writing(self, page: int) -> None:
        """Cancel the job of a page if it writes to a node."""
        for job in (self._waiting, self._running):
            if job is not None and job.wanted.kind is ConfigJobKind.RESTORE and job.wanted.page == page:
                job.cancelled.set()

    def leave(self, page: int) -> None:
        """Remove a closed page: cancel its job, and remove its files."""
        self.end(page)
        self.files.leave(page)

    def take(self) -> ConfigJob | None:
        """Return the job to carry out now, once; None if there is none."""
        found, self._waiting = self._waiting, None
        if found is None:
            return None
        self._running, self.now = found, ConfigProgress(found.wanted)
        return found.wanted

    def carry_out(self, machine: Machine, node: MachineNode, wanted: ConfigJob) -> ConfigProgress:
        """Carry the job out and return its end; blocks until it has finished, failed, or was cancelled. Runs in its own thread.

        Raises:
            AxisbusError: the job failed, or was cancelled.
        """
        cancelled = self._running.cancelled if self._running is not None else threading.Event()
        how = WritingSdo if wanted.kind is ConfigJobKind.RESTORE else PacedSdo
        paced = PacedNode(node, how(node, cancelled, wanted.kind.text))

        def tell(done: int, whole: int) -> None:
            self.now = ConfigProgress(wanted, done, whole)

        report = carry_out(machine, paced, wanted, tell)
        return replace(self.now or ConfigProgress(wanted), over=True, report=report)

    def failed(self, wanted: ConfigJob, error: AxisbusError) -> ConfigProgress:
        """Return the end of a job that failed with an error."""
        return replace(self.now or ConfigProgress(wanted), over=True, error=explained(error))

    def done(self, ended: ConfigProgress) -> None:
        """Note the end of the job; a backup is stored for its page, unless the job was cancelled."""
        made = None if ended.report is None else ended.report.dcf
        if made is not None and self._running is not None and not self._running.cancelled.is_set():
            self.files.keep(ended.wanted.page, MADE, made)
        self._running, self.now = None, ended


def _gave_way(wanted: ConfigJob, page: int) -> StateError:
    return StateError(
        f"{wanted.kind.text} of node {wanted.node} was cancelled",
        observed=f"page {page}, which has the controls, has started another job",
        remedy="start it again when that job is done",
    )
