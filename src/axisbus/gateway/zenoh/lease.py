"""Who may command a cell: one client at a time, for a second from each time that it says so. No clock, no network.

Theory of operation
-------------------
``FREE`` -> ``TAKING`` (the machine's command is being had, which may take its time: what moves halts first) -> ``HELD`` ->
``ENDING`` (what the client has set going is being halted) -> ``FREE``. Whoever holds it here asks ``CellLease.over`` again and
again, in a thread that no network can hold up; each command asks ``holds`` as of the time at which it is given, so that nothing of
a lease that has run out is done, even where nobody has noticed yet. A token is another at each taking.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from axisbus.errors import AxisbusError, OwnershipError

SECONDS = 1.0  # that a lease lasts from each renewal
_RENEW = "take the lease, and renew it at least three times a second"


class LeasePhase(Enum):
    """How far a lease is."""

    FREE = "nobody has the lease"
    TAKING = "it is being taken: what moves is being halted"
    HELD = "it is held"
    ENDING = "it is ending: what was moved under it is being halted"


@dataclass(frozen=True, slots=True)
class CellLease:
    """The lease of a cell; ``client`` has it, called ``who`` for people, until ``until`` (s, monotonic) and by ``token``."""

    phase: LeasePhase = LeasePhase.FREE
    client: str = ""
    who: str = ""
    token: str = ""
    until: float = 0.0

    @property
    def holder(self) -> str | None:
        """Who has it or is getting it, for people; None where nobody has."""
        return self.who if self.phase in (LeasePhase.TAKING, LeasePhase.HELD) else None

    def seconds(self, now: float) -> float:
        """Return for how long it lasts from now."""
        return max(0.0, self.until - now) if self.phase is LeasePhase.HELD else 0.0

    def over(self, now: float) -> bool:
        """Whether it has run out."""
        return self.phase is LeasePhase.HELD and now >= self.until

    def holds(self, client: str, token: str, now: float) -> bool:
        """Whether a client has it now, by this token."""
        held = self.phase is LeasePhase.HELD and now < self.until
        return held and client == self.client and token == self.token

    def renewed(self, now: float) -> CellLease:
        """Return it as it is once its holder has said that it is there."""
        return replace(self, until=now + SECONDS)

    def taking(self, client: str, who: str) -> CellLease:
        """Return it while the command is being had for a client."""
        return CellLease(LeasePhase.TAKING, client, who or client)

    def taken(self, token: str, now: float) -> CellLease:
        """Return it once that client has it."""
        return replace(self, phase=LeasePhase.HELD, token=token, until=now + SECONDS)

    def ending(self) -> CellLease:
        """Return it while what was moved under it is being halted."""
        return replace(self, phase=LeasePhase.ENDING, token="", until=0.0)

    def refusal(self, client: str, *, over: bool) -> OwnershipError | None:
        """Return why a client may not take it, None where it may, at once or when it has ended."""
        if self.phase in (LeasePhase.FREE, LeasePhase.ENDING) or (self.phase is LeasePhase.HELD and over):
            return None
        if self.phase is LeasePhase.TAKING:
            return OwnershipError(
                "the lease changes hands", observed=self.phase.value, remedy="ask again in a moment"
            )
        own = client == self.client
        return OwnershipError(
            f"{'another program of this name' if own else self.who} has the lease",
            observed=f"the name is {client}, and the lease was taken by it before" if own else "",
            remedy="wait until it is released or not renewed any more, or take it over, which halts what moves",
        )

    def why_not(self, client: str, token: str, now: float) -> AxisbusError:
        """Return why a client may not command."""
        if self.phase is not LeasePhase.HELD or now >= self.until:
            return OwnershipError("nothing is done without a lease", observed=self._why(now), remedy=_RENEW)
        if client != self.client:
            return OwnershipError(f"{self.who} has the lease, nobody else commands", remedy=_RENEW)
        seen = "it names none" if not token else "its token is of an earlier one"
        return OwnershipError("the command is of no lease of now", observed=seen, remedy=_RENEW)

    def _why(self, now: float) -> str:
        return "it was not renewed in time" if self.over(now) else self.phase.value
