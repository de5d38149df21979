"""The one job about a configuration that there may be: begun by a page, told to all, slow enough, and cancelled."""

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

_NO_FILE = Refusal("this page has given no file", "choose a DCF, or make a backup first")


@dataclass(slots=True)
class _Job:
    """A job that was begun; ``gives_way``: it has been cancelled for a page that has the controls."""

    wanted: ConfigJob
    cancelled: threading.Event = field(default_factory=threading.Event)
    gives_way: bool = False


class Configuring:
    """Holds the job that is under way, or the last one, and the files of the pages; carried out by another thread."""

    def __init__(self) -> None:
        self.now: ConfigProgress | None = None
        self.files = PageFiles()
        self._waiting: _Job | None = None
        self._running: _Job | None = None

    @property
    def busy(self) -> Refusal | None:
        """Why nothing else may begin now; None while no job runs, or one that has been cancelled for another page."""
        job = self._waiting or self._running
        if job is None or job.gives_way:
            return None
        wanted = job.wanted
        return Refusal(
            f"{wanted.kind.text} of node {wanted.node} is under way, for page {wanted.page}",
            "wait until it is done; that page may cancel it, and who has the controls",
        )

    def begin(self, page: int, kind: ConfigJobKind, node: int) -> Refusal | None:
        """Begin a job of a page, with the file that it has brought where it needs one; return why not, where that cannot be."""
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
        """Cancel the job of another page, so that ``page``, which has the controls, begins one without waiting."""
        for job in (self._waiting, self._running):
            if job is not None and job.wanted.page != page:
                job.cancelled.set()
                job.gives_way = True
        if self._waiting is not None and self._waiting.gives_way:
            self.now = self.failed(self._waiting.wanted, _gave_way(self._waiting.wanted, page))
            self._waiting = None

    def end(self, page: int | None = None) -> None:
        """Cancel it: whoever has begun it, or only where ``page`` has."""
        for job in (self._waiting, self._running):
            if job is not None and page in (None, job.wanted.page):
                job.cancelled.set()

    def end_writing(self, page: int) -> None:
        """Cancel what a page has begun, where that writes to a node."""
        for job in (self._waiting, self._running):
            if job is not None and job.wanted.kind is ConfigJobKind.RESTORE and job.wanted.page == page:
                job.cancelled.set()

    def leave(self, page: int) -> None:
        """A page is gone."""
        self.end(page)
        self.files.leave(page)

    def take(self) -> ConfigJob | None:
        """Return the job that is to be done now, once; None where none is."""
        found, self._waiting = self._waiting, None
        if found is None:
            return None
        self._running, self.now = found, ConfigProgress(found.wanted)
        return found.wanted

    def carry_out(self, machine: Machine, node: MachineNode, wanted: ConfigJob) -> ConfigProgress:
        """Do it, and return how it ended; blocks until it is done, broken off or cancelled. Runs in a thread of its own.

        Raises:
            AxisbusError: it broke off, or was cancelled.
        """
        cancelled = self._running.cancelled if self._running is not None else threading.Event()
        how = WritingSdo if wanted.kind is ConfigJobKind.RESTORE else PacedSdo
        paced = PacedNode(node, how(node, cancelled, wanted.kind.text))

        def tell(done: int, whole: int) -> None:
            self.now = ConfigProgress(wanted, done, whole)

        report = carry_out(machine, paced, wanted, tell)
        return replace(self.now or ConfigProgress(wanted), over=True, report=report)

    def failed(self, wanted: ConfigJob, error: AxisbusError) -> ConfigProgress:
        """Return how it ended by an error."""
        return replace(self.now or ConfigProgress(wanted), over=True, error=explained(error))

    def done(self, ended: ConfigProgress) -> None:
        """It is over; what was made is kept for its page, unless that is gone."""
        made = None if ended.report is None else ended.report.dcf
        if made is not None and self._running is not None and not self._running.cancelled.is_set():
            self.files.keep(ended.wanted.page, MADE, made)
        self._running, self.now = None, ended


def _gave_way(wanted: ConfigJob, page: int) -> StateError:
    return StateError(
        f"{wanted.kind.text} of node {wanted.node} was cancelled",
        observed=f"page {page}, which has the controls, has begun another job",
        remedy="begin it again when that is done",
    )
