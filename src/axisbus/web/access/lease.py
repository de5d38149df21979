"""The lease of the controls: which page has them, and how they change hands."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.web.access.tokens import Role


@dataclass(frozen=True, slots=True)
class Seat:
    """An open page: ``number`` counts the pages from 1, ``who`` names it for people."""

    number: int
    who: str
    role: Role


@dataclass(frozen=True, slots=True)
class Refusal:
    """The reason of a refusal, and the remedy."""

    text: str
    remedy: str


@dataclass(frozen=True, slots=True)
class PageLease:
    """The controls of the page; ``holder`` is None while no page has them."""

    holder: Seat | None = None

    def held_by(self, seat: Seat) -> bool:
        """Return whether this page has the controls."""
        return self.holder is not None and self.holder.number == seat.number

    def taken(self, seat: Seat, *, over: bool) -> PageLease | Refusal:
        """Return the lease of ``seat``; ``over``: take the controls from the page that has them, by an explicit request."""
        if seat.role is not Role.OPERATOR:
            return Refusal(
                "this is an observer page: it cannot take the controls",
                "ask an operator for a link; halt and stop are permitted",
            )
        if self.holder is not None and not self.held_by(seat) and not over:
            return Refusal(f"{self.holder.who} has the controls", "take them over, and inform that user")
        return PageLease(seat)

    def without(self, seat: Seat) -> PageLease:
        """Return the lease after ``seat`` has released the controls, or was closed."""
        return PageLease() if self.held_by(seat) else self
