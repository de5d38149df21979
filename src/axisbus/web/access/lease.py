"""The lease of the controls: which page has them, and how they change hands."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.web.access.tokens import Role


@dataclass(frozen=True, slots=True)
class PageIdentity:
    """An open page: ``number`` counts the pages from 1, ``page_name`` names it for people."""

    number: int
    page_name: str
    role: Role


@dataclass(frozen=True, slots=True)
class Refusal:
    """The reason of a refusal, and the remedy."""

    text: str
    remedy: str


@dataclass(frozen=True, slots=True)
class PageLease:
    """The controls of the page; ``holder`` is None while no page has them."""

    holder: PageIdentity | None = None

    def held_by(self, identity: PageIdentity) -> bool:
        """Return whether this page has the controls."""
        return self.holder is not None and self.holder.number == identity.number

    def granted_to(self, identity: PageIdentity, *, over: bool) -> PageLease | Refusal:
        """Return the lease of ``identity``; ``over``: take the controls from the page that has them, by an explicit request."""
        if identity.role is not Role.OPERATOR:
            return Refusal(
                "this is an observer page: it cannot take the controls",
                "ask an operator for a link; halt and stop are permitted",
            )
        if self.holder is not None and not self.held_by(identity) and not over:
            return Refusal(
                f"{self.holder.page_name} has the controls", "take them over, and inform that user"
            )
        return PageLease(identity)

    def after_release_by(self, identity: PageIdentity) -> PageLease:
        """Return the lease after ``identity`` has released the controls, or was closed."""
        return PageLease() if self.held_by(identity) else self
