"""Reject requests that are too old: those that arrive late, and those from a page that showed old values.

Theory of operation
-------------------
If a message takes longer than the promptest ones, the network has become slow. If the network is always slow, the age of the values
that the page shows reveals it: each message says when the server sent those values, by the server's own clock. A user who sees old
values, and whose input arrives late, must not move anything.
"""

from __future__ import annotations

from axisbus.client_support.dead_man import DeadMan
from axisbus.web.access.lease import Refusal
from axisbus.web.commands.request import PageRequest
from axisbus.web.commands.verbs import VERBS, PageVerb

_LATE = 1.0  # seconds by which a message may take longer than the promptest ones
_OLD = 1.5  # seconds, the highest age of the values that a page showed when a request of it arrives
_OLD_HELD = 0.6  # the same for a jog, which continues only while it is held
AHEAD = 1.0  # seconds by which the values sent to a page may be newer than those it shows, so that they do not queue up


def too_late(deadman: DeadMan, ask: PageRequest, now: float) -> Refusal | None:
    """Return why a request is rejected as too old, None if it is not; ``now`` as of ``DeadMan``."""
    if not VERBS[ask.verb].controls:
        return None
    late = deadman.lateness(ask.sent, now)
    if late > _LATE:
        return Refusal(
            f"{ask.verb.value} came {late:.1f} s late, and was not executed",
            "check the state of the axes, and try again",
        )
    old = 0.0 if ask.seen is None else now - ask.seen
    if old > (_OLD_HELD if ask.verb is PageVerb.JOG else _OLD):
        return Refusal(
            f"the connection is slow, {old:.1f} s there and back: {ask.verb.value} was not executed",
            "use a faster connection, or command from the terminal",
        )
    return None


def is_ahead(told: float, seen: float | None) -> bool:
    """Return whether a page lags too far: it shows the values sent at ``seen``, and the newest were sent at ``told``."""
    return seen is not None and told - seen > AHEAD
