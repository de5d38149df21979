"""The lease of a cell: one client at a time has control, for 1 s from each renewal. No clock, no network.

Theory of operation
-------------------
``FREE`` -> ``TAKING`` (control of the machine is being taken, which may take long: moving axes halt first) -> ``HELD`` ->
``ENDING`` (the axes that the client has moved are being halted) -> ``FREE``. A thread that the network cannot block calls
``CellLease.expired`` periodically. Each command calls ``holds`` with its own time, so that no command of an expired lease is
executed, even if the expiry has not been noticed yet. The token is different each time that the lease is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from axisbus.errors import AxisbusError, OwnershipError

SECONDS = 1.0  # from each renewal to the end of a lease
_RENEW = "take the lease, and renew it at least three times a second"


class LeasePhase(Enum):
    """The phase of a lease."""

    FREE = "no client has the lease"
    TAKING = "it is being taken: moving axes are being halted"
    HELD = "it is held"
    ENDING = "it is ending: the axes that were moved under it are being halted"


@dataclass(frozen=True, slots=True)
class CellLease:
    """The lease of a cell; ``client`` holds it, ``client_name`` for people, until ``until`` (s, monotonic), with ``token``."""

    phase: LeasePhase = LeasePhase.FREE
    client: str = ""
    client_name: str = ""
    token: str = ""
    until: float = 0.0

    @property
    def holder(self) -> str | None:
        """The client that has it or is getting it, for people; None if there is none."""
        return self.client_name if self.phase in (LeasePhase.TAKING, LeasePhase.HELD) else None

    def seconds(self, now: float) -> float:
        """Return the seconds until it expires."""
        return max(0.0, self.until - now) if self.phase is LeasePhase.HELD else 0.0

    def expired(self, now: float) -> bool:
        """Whether it has expired."""
        return self.phase is LeasePhase.HELD and now >= self.until

    def holds(self, client: str, token: str, now: float) -> bool:
        """Whether a client holds it now, with this token."""
        held = self.phase is LeasePhase.HELD and now < self.until
        return held and client == self.client and token == self.token

    def renewed(self, now: float) -> CellLease:
        """Return the lease after a renewal by its holder."""
        return replace(self, until=now + SECONDS)

    def taking(self, client: str, client_name: str) -> CellLease:
        """Return the lease while control is being taken for a client."""
        return CellLease(LeasePhase.TAKING, client, client_name or client)

    def taken(self, token: str, now: float) -> CellLease:
        """Return the lease when that client has it."""
        return replace(self, phase=LeasePhase.HELD, token=token, until=now + SECONDS)

    def ending(self) -> CellLease:
        """Return the lease while the axes moved under it are being halted."""
        return replace(self, phase=LeasePhase.ENDING, token="", until=0.0)

    def refusal(self, client: str, *, force: bool) -> OwnershipError | None:
        """Return why a client may not take it; None if it may, at once or after its end."""
        if self.phase in (LeasePhase.FREE, LeasePhase.ENDING) or (self.phase is LeasePhase.HELD and force):
            return None
        if self.phase is LeasePhase.TAKING:
            return OwnershipError(
                "the lease is changing its holder",
                observed=self.phase.value,
                remedy="try again in a moment",
            )
        same_name = client == self.client
        return OwnershipError(
            f"{'another program of this name' if same_name else self.client_name} has the lease",
            observed=f"the name is {client}, and this name already holds the lease" if same_name else "",
            remedy="wait until it is released or no longer renewed, or take it over, which halts all moving axes",
        )

    def why_not(self, client: str, token: str, now: float) -> AxisbusError:
        """Return why a client may not command."""
        if self.phase is not LeasePhase.HELD or now >= self.until:
            return OwnershipError(
                "no command is executed without a lease", observed=self._why(now), remedy=_RENEW
            )
        if client != self.client:
            return OwnershipError(
                f"{self.client_name} has the lease; no other client may command", remedy=_RENEW
            )
        reason = "it names no lease" if not token else "its token belongs to an earlier lease"
        return OwnershipError(
            "the command does not belong to the present lease", observed=reason, remedy=_RENEW
        )

    def _why(self, now: float) -> str:
        return "it was not renewed in time" if self.expired(now) else self.phase.value
