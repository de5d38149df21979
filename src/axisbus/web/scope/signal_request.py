"""Parse a page's selection of signals for its scope."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from axisbus.web.access.limits import MESSAGE
from axisbus.web.access.messages import as_object

MOST = 10  # signals


@dataclass(frozen=True, slots=True)
class Choice:
    """The selected signals, and the number by which the page recognises the batches of this selection."""

    number: int
    signals: tuple[str, ...]


def read(text: str, there: Collection[str]) -> Choice | None:
    """Return the selection in a message, of the signals in ``there``; None if the message is invalid."""
    found = as_object(text) if len(text) <= MESSAGE else None
    if found is None:
        return None
    number, names = found.get("choice"), found.get("signals")
    if (
        type(number) is not int
        or not 0 <= number < 1 << 32
        or not isinstance(names, list)
        or len(names) > MOST
    ):
        return None
    if not all(isinstance(name, str) and name in there for name in names):
        return None
    return Choice(number, tuple(dict.fromkeys(names)))
