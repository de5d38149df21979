"""The one job about a configuration that there may be: begun by a page, told to all, slow enough, and cancelled."""

from __future__ import annotations

import threading
from dataclasses import replace

from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode
from axisbus.web.config.files import BROUGHT, MADE, Files
from axisbus.web.config.jobs import carry_out
from axisbus.web.config.report import Kind, Progressed, Wanted
from axisbus.web.gate.lease import Refusal
from axisbus.web.objects.paced import PacedNode, PacedSdo, WritingSdo
from axisbus.web.view.axes import explained

_NO_FILE = Refusal("this page has given no file", "choose a DCF, or make a backup first")


class Configuring:
    """Holds the job that is under way, or the last one, and the files of the pages; carried out by another thread."""

    def __init__(self) -> None:
        self.now: Progressed | None = None
        self.files = Files()
        self._wanted: Wanted | None = None
        self._cancelled = threading.Event()

    @property
    def busy(self) -> Refusal | None:
        """Why nothing else may begin now; None while no job is under way."""
        if self.now is None or self.now.over:
            return None
        wanted = self.now.wanted
        return Refusal(
            f"{wanted.kind.text} of node {wanted.node} is under way, for page {wanted.page}",
            "wait until it is done; that page may cancel it, and who has the controls",
        )

    def begin(self, page: int, kind: Kind, node: int) -> Refusal | None:
        """Begin a job of a page, with the file that it has brought where it needs one; return why not, where that cannot be."""
        file = None if kind is Kind.BACKUP else self.files.of(page, BROUGHT)
        if kind is not Kind.BACKUP and file is None:
            return _NO_FILE
        if (busy := self.busy) is not None:
            return busy
        self._cancelled = threading.Event()
        self._wanted = Wanted(kind, page, node, file)
        self.now = Progressed(self._wanted)
        return None

    def end(self, page: int | None = None) -> None:
        """Cancel it: whoever has begun it, or only where ``page`` has."""
        if self.now is not None and page in (None, self.now.wanted.page):
            self._cancelled.set()

    def end_writing(self, page: int) -> None:
        """Cancel what a page has begun, where that writes to a node."""
        if self.now is not None and self.now.wanted.kind is Kind.RESTORE:
            self.end(page)

    def leave(self, page: int) -> None:
        """A page is gone."""
        self.end(page)
        self.files.leave(page)

    def take(self) -> Wanted | None:
        """Return the job that is to be done now, once; None where none is."""
        found, self._wanted = self._wanted, None
        return found

    def carry_out(self, machine: Machine, node: MachineNode, wanted: Wanted) -> Progressed:
        """Do it, and return how it ended; blocks until it is done, broken off or cancelled. Runs in a thread of its own.

        Raises:
            AxisbusError: it broke off, or was cancelled.
        """
        how = WritingSdo if wanted.kind is Kind.RESTORE else PacedSdo
        paced = PacedNode(node, how(node, self._cancelled, wanted.kind.text))

        def tell(done: int, whole: int) -> None:
            self.now = Progressed(wanted, done, whole)

        report = carry_out(machine, paced, wanted, tell)
        return replace(self.now or Progressed(wanted), over=True, report=report)

    def failed(self, wanted: Wanted, error: AxisbusError) -> Progressed:
        """Return how it ended by an error."""
        return replace(self.now or Progressed(wanted), over=True, error=explained(error))

    def done(self, ended: Progressed) -> None:
        """It is over; what was made is kept for its page, unless that is gone."""
        made = None if ended.report is None else ended.report.dcf
        if made is not None and not self._cancelled.is_set():
            self.files.keep(ended.wanted.page, MADE, made)
        self.now = ended
