"""An SDO transfer that a page waits for, and its result as sent to the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from axisbus.web.objects.key import ObjectKey
from axisbus.web.view.axes import Values


@dataclass(frozen=True, slots=True)
class TransferRequest:
    """A value to write, as typed, and the reasons for a question that the user has confirmed."""

    text: str
    agreed: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class ObjectJob:
    """One transfer: ``page`` has requested it (0: cyclic read); ``wish`` is None if it reads."""

    key: ObjectKey
    page: int = 0
    wish: TransferRequest | None = None


@dataclass(frozen=True, slots=True)
class WriteConfirmation:
    """A question to confirm before an object is written; ``reasons`` say why it is asked, and come back with the confirmation."""

    text: str
    reasons: frozenset[str]


@dataclass(frozen=True, slots=True)
class TransferResult:
    """The result of a transfer at ``stamp`` (s, monotonic).

    ``value`` is the value of the object, None if unknown; ``error`` are the three texts of an error, ``note`` is the result of a
    write in words. ``silent``: the node did not answer.
    """

    job: ObjectJob
    stamp: float
    value: str | None = None
    error: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    question: WriteConfirmation | None = None
    silent: bool = False

    def told(self, now: float) -> Values:
        """Return the result as plain values, with its age in seconds."""
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
