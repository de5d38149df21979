"""What is not done for its age: it has been under way for long, or was asked for by a page that showed what had long been.

Theory of operation
-------------------
How much later than the promptest ones a message comes shows a network that has become slow. One that is slow all the
time shows by the age of what the page shows: each message says of when that is, by our own clock. Whoever looks at what is old, and
whose hand is seen as late, must not move anything.
"""

from __future__ import annotations

from axisbus.client_support.dead_man import DeadMan
from axisbus.web.access.lease import Refusal
from axisbus.web.commands.request import PageRequest
from axisbus.web.commands.verbs import VERBS, PageVerb

_LATE = 1.0  # seconds that a message may be under way longer than the promptest ones
_OLD = 1.5  # seconds that what a page shows may have been told before what it asks for is heard
_OLD_HELD = 0.6  # that of what goes on only while it is held
AHEAD = 1.0  # seconds by which what is told to a page may be ahead of what it shows: no more is to wait on its way


def too_late(deadman: DeadMan, ask: PageRequest, now: float) -> Refusal | None:
    """Return why something is not done that was asked a while ago, or by what was seen a while ago; ``now`` as of ``DeadMan``."""
    if not VERBS[ask.verb].controls:
        return None
    late = deadman.lateness(ask.sent, now)
    if late > _LATE:
        return Refusal(
            f"{ask.verb.value} came {late:.1f} s late: it is not done",
            "look how the axes stand, and ask again",
        )
    old = 0.0 if ask.seen is None else now - ask.seen
    if old > (_OLD_HELD if ask.verb is PageVerb.JOG else _OLD):
        return Refusal(
            f"the connection is slow, {old:.1f} s there and back: {ask.verb.value} is not done",
            "use a faster one, or command from the terminal",
        )
    return None


def is_ahead(told: float, seen: float | None) -> bool:
    """Whether a page that shows what was told it at ``seen`` is to get nothing new after what was told it at ``told``."""
    return seen is not None and told - seen > AHEAD
