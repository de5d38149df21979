"""Requests of pages for the objects of nodes: queue their transfers, and start and end the one long job."""

from __future__ import annotations

from axisbus.web.access.lease import Refusal
from axisbus.web.commands.request import PageRequest
from axisbus.web.commands.verbs import PageVerb
from axisbus.web.config import report as config
from axisbus.web.config.jobs import Configuring
from axisbus.web.config.report import ConfigJobKind
from axisbus.web.objects.transfer_queue import WAITING, ObjectJob, TransferQueue, TransferRequest
from axisbus.web.objects.verifying import Verifying, VerifyProgress
from axisbus.web.view import Values

_JOBS = {
    PageVerb.BACKUP: ConfigJobKind.BACKUP,
    PageVerb.COMPARE: ConfigJobKind.COMPARE,
    PageVerb.WOULD_RESTORE: ConfigJobKind.WOULD_RESTORE,
    PageVerb.RESTORE: ConfigJobKind.RESTORE,
}
VERBS = frozenset(
    {
        PageVerb.READ_OBJECTS,
        PageVerb.KEEP_READING,
        PageVerb.WRITE_OBJECT,
        PageVerb.VERIFY,
        PageVerb.VERIFY_END,
        *_JOBS,
        PageVerb.JOB_END,
    }
)
_FULL = Refusal(f"this page is already waiting for {WAITING} objects", "wait until they have arrived")


class ObjectRequests:
    """Hold the queue of transfers and the long jobs; used by one thread, and carried out by ``web.objects.worker``."""

    def __init__(self) -> None:
        self.queue = TransferQueue()
        self.verifying = Verifying()
        self.configuring = Configuring()

    def do(self, page: int, request: PageRequest, *, controls: bool = False) -> Refusal | None:
        """Accept a request of a page that is authorised for it; return why not, if that is impossible now.

        ``controls``: whether the page has the controls, and so may end the job of another page; starting a job of its own does so.
        """
        if controls and (request.verb is PageVerb.VERIFY or request.verb in _JOBS):
            self.configuring.give_way(page)
        if request.verb is PageVerb.KEEP_READING:
            self.queue.set_cyclic(page, request.objects)
        elif request.verb is PageVerb.VERIFY:
            return self.configuring.busy or self.verifying.begin(page, request.node)
        elif request.verb is PageVerb.VERIFY_END:
            self.verifying.end()
        elif request.verb in _JOBS:
            return self.verifying.busy or self.configuring.begin(page, _JOBS[request.verb], request.node)
        elif request.verb is PageVerb.JOB_END:
            self.configuring.end(None if controls else page)
        elif not self.queue.request(page, _jobs(page, request)):
            return _FULL
        return None

    def without_controls(self, page: int, now: float) -> None:
        """Note that a page has lost the controls: drop its pending writes, and end its verification or restore."""
        self.queue.drop_writes(page, now)
        self.configuring.end_writing(page)
        self.verifying.end(page)

    def remove_page(self, page: int) -> None:
        """Remove a closed page."""
        self.queue.remove_page(page)
        self.verifying.end(page)
        self.configuring.remove_page(page)

    def unread(self, page: int, now: float) -> list[Values]:
        """Return the results of a page's transfers and the objects that it keeps reading, as far as they are new."""
        return [result.as_values(now) for result in self.queue.unread(page)]

    @property
    def verified(self) -> VerifyProgress | None:
        """The progress of the verification; another value whenever it has changed."""
        return self.verifying.now

    @property
    def configured(self) -> config.ConfigProgress | None:
        """The progress of the configuration job; another value whenever it has changed."""
        return self.configuring.now


def _jobs(page: int, request: PageRequest) -> list[ObjectJob]:
    write_request = None
    if request.verb is PageVerb.WRITE_OBJECT:
        write_request = TransferRequest(request.text, frozenset(request.values.get("agreed", "").split()))
    return [ObjectJob(each, page, write_request) for each in request.objects]
