"""The configuration jobs: as ``axisbus config``, but for a node of a running machine.

The library restores a whole configuration only to a node that is pre-operational and not controlled by another program. The nodes
of a running machine are neither. So a restore here writes only the drive's own settings (``boot.dcf``), and only while no
drive of the node is energised. For all other objects the page shows the difference, why it is not written here, and the command to
type.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace

from axisbus.bus.link.listen import link_bitrate
from axisbus.bus.node.node import read_identity
from axisbus.configuration import dcf_backup, preconditions, report_text
from axisbus.eds import builtin, dcf, writer
from axisbus.eds.io import reader
from axisbus.errors import AxisbusError, StateError
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode
from axisbus.machine.node_access import NodeAccess
from axisbus.web.access.lease import Refusal
from axisbus.web.config import file_jobs, file_process
from axisbus.web.config.file_jobs import NAME, OBJECT, OnProgress
from axisbus.web.config.files import BACKED_UP, MAX_SIZE, UPLOADED, Dcf, PageFiles
from axisbus.web.config.report import ConfigJob, ConfigJobKind, ConfigProgress, ConfigReport, bounded_texts
from axisbus.web.objects.verifying import PacedNode, PacedSdo, WritingSdo
from axisbus.web.view import explained
from axisbus.wording import counted


def carry_out(
    machine: Machine, node: PacedNode, config_job: ConfigJob, on_progress: OnProgress
) -> ConfigReport:
    """Carry out a job; blocks for one transfer per object. ``on_progress(done, all)`` is called after each transfer.

    A job with a file that takes long to parse runs in a process of its own.

    Raises:
        AxisbusError: any error of the library about the file or the node.
    """
    if config_job.kind is ConfigJobKind.BACKUP:
        return backup(machine, node, on_progress)
    assert config_job.file is not None
    target = MachineJobNode(machine, node)
    if config_job.file.is_short:
        return file_jobs.carry_out(config_job.kind, target, config_job.file, on_progress)
    return file_process.carry_out(
        config_job.kind, target, config_job.file, on_progress, node.sdo.require_not_cancelled
    )


def backup(machine: Machine, node: PacedNode, on_progress: OnProgress) -> ConfigReport:
    """Read every object of a node into a DCF."""
    file = machine.cell.nodes[node.node_id].file
    assert file is not None  # only a node without objects needs no file
    path = builtin.resolve(file, machine.cell.folder)
    reading = reader.read(reader.file_bytes(path), str(path))
    identity = read_identity(node.sdo)
    bus = machine.cell.bus
    settings = dcf.Settings(
        node.node_id,
        dcf_backup.known_rate(reading, bus.bitrate or link_bitrate(bus.interface, bus.channel)),
        file_name=dcf_backup.file_name(node.node_id, identity.serial),
        last_eds=path.name,
    )
    node_of_machine = MachineNode(machine.node(node.node_id))
    saved = dcf_backup.backup(node.sdo, reading, settings, on_progress, lambda: node_of_machine.last_restart)
    data = writer.dumps(saved.reading)
    if len(data) > MAX_SIZE:
        raise StateError(
            f"the backup of node {node.node_id} has {counted(len(data), 'octet')}, more than a page can store",
            remedy="create it with axisbus config backup",
        )
    name = str(settings.file_name)
    lines = (*report_text.device(identity, path.name, node.node_id), f"{name}: {counted(len(data), 'octet')}")
    rows = tuple(
        (f"{each.index:04X}h:{each.subindex:02X}", each.name, each.reason) for each in saved.left_out
    )
    return ConfigReport(
        report_text.read(saved), lines, (OBJECT, NAME, "Left out, because"), rows, dcf=Dcf(name, data)
    )


class MachineJobNode:
    """A node of a machine of this process, for a job that takes a file."""

    def __init__(self, machine: Machine, node: PacedNode) -> None:
        self.node_id, self.eds, self.sdo, self.cell = node.node_id, node.eds, node.sdo, machine.cell
        self._access, self._node = machine.node(node.node_id), node
        self.cyclic = frozenset(self._access.sdo.cyclic)

    def require_not_energised(self) -> None:
        """Raise StateError if a drive of the node is energised; blocks for a transfer for each axis."""
        preconditions.require_not_energised(self._node)

    def refusal(self) -> StateError:
        """Return why the node is not restored completely; blocks as ``require_not_energised``."""
        return refusal(self._access, self._node)


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

    config_job: ConfigJob
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
        config_job = job.config_job
        return Refusal(
            f"{config_job.kind.text} of node {config_job.node} is already running, for page {config_job.page}",
            "wait until it is done; that page may cancel it, and so may the page with the controls",
        )

    def begin(self, page: int, kind: ConfigJobKind, node: int) -> Refusal | None:
        """Start a job of a page, with the file that it has uploaded if the job needs one; return why not, if that is impossible."""
        file = None if kind is ConfigJobKind.BACKUP else self.files.of(page, UPLOADED)
        if kind is not ConfigJobKind.BACKUP and file is None:
            return _NO_FILE
        if (busy := self.busy) is not None:
            return busy
        self._waiting = _Job(ConfigJob(kind, page, node, file))
        if self._running is None:
            self.now = ConfigProgress(self._waiting.config_job)
        return None

    def give_way(self, page: int) -> None:
        """Cancel the job of another page, so that ``page``, which has the controls, can start one without waiting."""
        for job in (self._waiting, self._running):
            if job is not None and job.config_job.page != page:
                job.cancelled.set()
                job.gives_way = True
        if self._waiting is not None and self._waiting.gives_way:
            self.now = self.failed(self._waiting.config_job, _gave_way(self._waiting.config_job, page))
            self._waiting = None

    def end(self, page: int | None = None) -> None:
        """Cancel the job; if ``page`` is given, only if that page has started it."""
        for job in (self._waiting, self._running):
            if job is not None and page in (None, job.config_job.page):
                job.cancelled.set()

    def end_writing(self, page: int) -> None:
        """Cancel the job of a page if it writes to a node."""
        for job in (self._waiting, self._running):
            if (
                job is not None
                and job.config_job.kind is ConfigJobKind.RESTORE
                and job.config_job.page == page
            ):
                job.cancelled.set()

    def remove_page(self, page: int) -> None:
        """Remove a closed page: cancel its job, and remove its files."""
        self.end(page)
        self.files.remove_page(page)

    def take(self) -> ConfigJob | None:
        """Return the job to carry out now, once; None if there is none."""
        found, self._waiting = self._waiting, None
        if found is None:
            return None
        self._running, self.now = found, ConfigProgress(found.config_job)
        return found.config_job

    def carry_out(self, machine: Machine, node: MachineNode, config_job: ConfigJob) -> ConfigProgress:
        """Carry the job out and return its end; blocks until it has finished, failed, or was cancelled. Runs in its own thread.

        Raises:
            AxisbusError: the job failed, or was cancelled.
        """
        cancelled = self._running.cancelled if self._running is not None else threading.Event()
        how = WritingSdo if config_job.kind is ConfigJobKind.RESTORE else PacedSdo
        paced = PacedNode(node, how(node, cancelled, config_job.kind.text))

        def on_progress(done: int, whole: int) -> None:
            self.now = ConfigProgress(config_job, done, whole)

        report = carry_out(machine, paced, config_job, on_progress).bounded()
        return replace(self.now or ConfigProgress(config_job), over=True, report=report)

    def failed(self, config_job: ConfigJob, error: AxisbusError) -> ConfigProgress:
        """Return the end of a job that failed with an error."""
        return replace(
            self.now or ConfigProgress(config_job), over=True, error=bounded_texts(explained(error))
        )

    def done(self, ended: ConfigProgress) -> None:
        """Note the end of the job; a backup is stored for its page, unless the job was cancelled."""
        saved = None if ended.report is None else ended.report.dcf
        if saved is not None and self._running is not None and not self._running.cancelled.is_set():
            self.files.store(ended.config_job.page, BACKED_UP, saved)
        self._running, self.now = None, ended


def _gave_way(config_job: ConfigJob, page: int) -> StateError:
    return StateError(
        f"{config_job.kind.text} of node {config_job.node} was cancelled",
        observed=f"page {page}, which has the controls, has started another job",
        remedy="start it again when that job is done",
    )
