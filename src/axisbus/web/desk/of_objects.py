"""What pages ask for about the objects of nodes: who waits for which transfer, and the one verification that there may be."""

from __future__ import annotations

from axisbus.web.desk.ask import Ask
from axisbus.web.desk.verbs import Verb
from axisbus.web.gate.lease import Refusal
from axisbus.web.objects.jobs import Job, Wish
from axisbus.web.objects.turns import WAITING, Turns
from axisbus.web.objects.verifying import Progressed, Verifying
from axisbus.web.view.axes import Values

VERBS = frozenset({Verb.READ_OBJECTS, Verb.KEEP_READING, Verb.WRITE_OBJECT, Verb.VERIFY, Verb.VERIFY_END})
_FULL = Refusal(f"this page waits for {WAITING} objects already", "wait until they have come")


class OfObjects:
    """Holds the queue of transfers and the verification; used by one thread, and carried out by ``web.objects.worker``."""

    def __init__(self) -> None:
        self.turns = Turns()
        self.verifying = Verifying()

    def do(self, page: int, ask: Ask) -> Refusal | None:
        """Take what a page asks for, which may ask for it; return why not, where that cannot be now."""
        if ask.verb is Verb.KEEP_READING:
            self.turns.keep(page, ask.objects)
        elif ask.verb is Verb.VERIFY:
            return self.verifying.begin(page, ask.node)
        elif ask.verb is Verb.VERIFY_END:
            self.verifying.end()
        elif not self.turns.ask(page, _jobs(page, ask)):
            return _FULL
        return None

    def without_controls(self, page: int, now: float) -> None:
        """A page has the controls no longer: nothing is written for it any more, and what it verifies ends."""
        self.turns.drop_writes(page, now)
        self.verifying.end(page)

    def leave(self, page: int) -> None:
        """A page is gone."""
        self.turns.leave(page)
        self.verifying.end(page)

    def news(self, page: int, now: float) -> list[Values]:
        """Return what has come of a page's transfers, and what it keeps reading, since it was told last."""
        return [seen.told(now) for seen in self.turns.news(page)]

    @property
    def verified(self) -> Progressed | None:
        """How far the verification is; another value whenever that has changed."""
        return self.verifying.now


def _jobs(page: int, ask: Ask) -> list[Job]:
    wish = None
    if ask.verb is Verb.WRITE_OBJECT:
        wish = Wish(ask.text, frozenset(ask.values.get("agreed", "").split()))
    return [Job(each, page, wish) for each in ask.objects]
