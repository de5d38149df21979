"""The lease of a cell: one client at a time has control, for 1 s from each renewal. No clock, no network.

Theory of operation
-------------------
``FREE`` -> ``TAKING`` (control of the machine is being taken, which may take long: moving axes halt first) -> ``HELD`` ->
``ENDING`` (the axes that the client has moved are being halted) -> ``FREE``. A thread that the network cannot block calls
``CellLease.over`` periodically. Each command calls ``holds`` with its own time, so that no command of an expired lease is executed,
even if the expiry has not been noticed yet. The token is different each time that the lease is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from axisbus.errors import AxisbusError, OwnershipError

SECONDS = 1.0  # from each renewal to the end of a lease
_RENEW = "take the lease, and renew it at least three times a second"


class LeasePhase(Enum):
    """The phase of a lease."""

    FREE = "nobody has the lease"
    TAKING = "it is being taken: what moves is being halted"
    HELD = "it is held"
    ENDING = "it is ending: what was moved under it is being halted"


@dataclass(frozen=True, slots=True)
class CellLease:
    """The lease of a cell; ``client`` holds it, called ``who`` for people, until ``until`` (s, monotonic), with ``token``."""

    phase: LeasePhase = LeasePhase.FREE
    client: str = ""
    who: str = ""
    token: str = ""
    until: float = 0.0

    @property
    def holder(self) -> str | None:
        """The client that has it or is getting it, for people; None if there is none."""
        return self.who if self.phase in (LeasePhase.TAKING, LeasePhase.HELD) else None

    def seconds(self, now: float) -> float:
        """Return the seconds until it expires."""
        return max(0.0, self.until - now) if self.phase is LeasePhase.HELD else 0.0

    def over(self, now: float) -> bool:
        """Whether it has expired."""
        return self.phase is LeasePhase.HELD and now >= self.until

    def holds(self, client: str, token: str, now: float) -> bool:
        """Whether a client holds it now, with this token."""
        held = self.phase is LeasePhase.HELD and now < self.until
        return held and client == self.client and token == self.token

    def renewed(self, now: float) -> CellLease:
        """Return the lease after a renewal by its holder."""
        return replace(self, until=now + SECONDS)

    def taking(self, client: str, who: str) -> CellLease:
        """Return the lease while control is being taken for a client."""
        return CellLease(LeasePhase.TAKING, client, who or client)

    def taken(self, token: str, now: float) -> CellLease:
        """Return the lease when that client has it."""
        return replace(self, phase=LeasePhase.HELD, token=token, until=now + SECONDS)

    def ending(self) -> CellLease:
        """Return the lease while the axes moved under it are being halted."""
        return replace(self, phase=LeasePhase.ENDING, token="", until=0.0)

    def refusal(self, client: str, *, over: bool) -> OwnershipError | None:
        """Return why a client may not take it; None if it may, at once or after its end."""
        if self.phase in (LeasePhase.FREE, LeasePhase.ENDING) or (self.phase is LeasePhase.HELD and over):
            return None
        if self.phase is LeasePhase.TAKING:
            return OwnershipError(
                "the lease changes hands", observed=self.phase.value, remedy="try again in a moment"
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
