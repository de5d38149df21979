"""The one configuration job that may run at a time: started by a page, shown on all, paced, and cancellable."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace

from axisbus.errors import AxisbusError, StateError
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode
from axisbus.web.access.lease import Refusal
from axisbus.web.config.files import BROUGHT, MADE, PageFiles
from axisbus.web.config.jobs import carry_out
from axisbus.web.config.report import ConfigJob, ConfigJobKind, ConfigProgress
from axisbus.web.objects.throttled_node import PacedNode, PacedSdo, WritingSdo
from axisbus.web.view.axes import explained

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
