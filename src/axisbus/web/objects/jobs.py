"""A transfer that a page waits for, and what came of it, as the page is told it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from axisbus.web.objects.key import ObjectKey
from axisbus.web.view.axes import Values


@dataclass(frozen=True, slots=True)
class TransferRequest:
    """What is to be written: the value as it was typed, and the reasons for a question that were answered with yes."""

    text: str
    agreed: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class ObjectJob:
    """One transfer: ``page`` has asked for it (0: it is kept being read); ``wish`` is None where it reads."""

    key: ObjectKey
    page: int = 0
    wish: TransferRequest | None = None


@dataclass(frozen=True, slots=True)
class WriteConfirmation:
    """What has to be answered with yes before something is written; ``reasons`` say why it is asked, and go back with the yes."""

    text: str
    reasons: frozenset[str]


@dataclass(frozen=True, slots=True)
class TransferResult:
    """What a transfer came to at ``stamp`` (s, monotonic).

    ``value`` is what the object has, None where that was not learnt; ``error`` are the three texts of an error, ``note`` is what a
    write has come to. ``silent``: the node did not answer.
    """

    job: ObjectJob
    stamp: float
    value: str | None = None
    error: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    question: WriteConfirmation | None = None
    silent: bool = False

    def told(self, now: float) -> Values:
        """Return it as plain values, with its age in seconds."""
        asked = self.question
        return {
            "key": str(self.job.key),
            "wrote": self.job.wish is not None,
            "age": round(max(0.0, now - self.stamp), 3),
            "value": self.value,
            "error": dict(self.error) or None,
            "note": self.note,
            "question": None
            if asked is None
            else {"text": asked.text, "reasons": " ".join(sorted(asked.reasons))},
        }
