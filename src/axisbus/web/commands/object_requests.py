"""What pages ask for about the objects of nodes: who waits for which transfer, and the one long job that there may be."""

from __future__ import annotations

from axisbus.web.access.lease import Refusal
from axisbus.web.commands.request import PageRequest
from axisbus.web.commands.verbs import PageVerb
from axisbus.web.config import report as config
from axisbus.web.config.job_runner import Configuring
from axisbus.web.config.report import ConfigJobKind
from axisbus.web.objects.jobs import ObjectJob, TransferRequest
from axisbus.web.objects.transfer_queue import WAITING, TransferQueue
from axisbus.web.objects.verifying import Verifying, VerifyProgress
from axisbus.web.view.axes import Values

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
_FULL = Refusal(f"this page waits for {WAITING} objects already", "wait until they have come")


class ObjectRequests:
    """Holds the queue of transfers and the long jobs; used by one thread, and carried out by ``web.objects.worker``."""

    def __init__(self) -> None:
        self.turns = TransferQueue()
        self.verifying = Verifying()
        self.configuring = Configuring()

    def do(self, page: int, ask: PageRequest, *, controls: bool = False) -> Refusal | None:
        """Take what a page asks for, which may ask for it; return why not, where that cannot be now.

        ``controls``: whether it has them, and so may end what another page has begun; a job of its own does so.
        """
        if controls and (ask.verb is PageVerb.VERIFY or ask.verb in _JOBS):
            self.configuring.give_way(page)
        if ask.verb is PageVerb.KEEP_READING:
            self.turns.keep(page, ask.objects)
        elif ask.verb is PageVerb.VERIFY:
            return self.configuring.busy or self.verifying.begin(page, ask.node)
        elif ask.verb is PageVerb.VERIFY_END:
            self.verifying.end()
        elif ask.verb in _JOBS:
            return self.verifying.busy or self.configuring.begin(page, _JOBS[ask.verb], ask.node)
        elif ask.verb is PageVerb.JOB_END:
            self.configuring.end(None if controls else page)
        elif not self.turns.ask(page, _jobs(page, ask)):
            return _FULL
        return None

    def without_controls(self, page: int, now: float) -> None:
        """A page has the controls no longer: nothing is written for it any more, and what it verifies or restores ends."""
        self.turns.drop_writes(page, now)
        self.configuring.end_writing(page)
        self.verifying.end(page)

    def leave(self, page: int) -> None:
        """A page is gone."""
        self.turns.leave(page)
        self.verifying.end(page)
        self.configuring.leave(page)

    def news(self, page: int, now: float) -> list[Values]:
        """Return what has come of a page's transfers, and what it keeps reading, since it was told last."""
        return [seen.told(now) for seen in self.turns.news(page)]

    @property
    def verified(self) -> VerifyProgress | None:
        """How far the verification is; another value whenever that has changed."""
        return self.verifying.now

    @property
    def configured(self) -> config.ConfigProgress | None:
        """How far the job about a configuration is; another value whenever that has changed."""
        return self.configuring.now


def _jobs(page: int, ask: PageRequest) -> list[ObjectJob]:
    wish = None
    if ask.verb is PageVerb.WRITE_OBJECT:
        wish = TransferRequest(ask.text, frozenset(ask.values.get("agreed", "").split()))
    return [ObjectJob(each, page, wish) for each in ask.objects]
