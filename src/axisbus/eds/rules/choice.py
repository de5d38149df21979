"""Which rules are wanted, by ids and by beginnings of ids."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Iterable

from axisbus.eds.rules.table import rules
from axisbus.errors import ArgumentError

_ALL = 0  # length of the empty prefix, which every id begins with
_NONE = -1


def chooser(select: str | Iterable[str] = (), ignore: str | Iterable[str] = ()) -> Callable[[str], bool]:
    """Return a test for ids: selected (all, where nothing is selected) and not ignored.

    ``V`` stands for every id that begins with it, a whole id (``V003``) for that rule alone; letters may be small. The longer of
    two counts: ignoring ``V`` and selecting ``V003`` leaves V003.

    Raises:
        ArgumentError: no rule's id begins so.
    """
    wanted, unwanted = _known(select, "select"), _known(ignore, "ignore")

    def test(rule: str) -> bool:
        chosen = _longest(rule, wanted) if wanted else _ALL
        return chosen > _longest(rule, unwanted)

    return test


def _known(given: str | Iterable[str], option: str) -> frozenset[str]:
    texts = (given,) if isinstance(given, str) else given
    return frozenset(_as_printed(text.strip(), option) for text in texts)


def _as_printed(text: str, option: str) -> str:
    """Return an id or a beginning as the table writes it."""
    found = starting(text)
    if not text or not found:
        near = difflib.get_close_matches(text.upper(), rules(), n=1, cutoff=0.5)
        raise ArgumentError(
            f"{option}: no rule's id begins with {text[:20]!r}",
            remedy=f"{f'did you mean {near[0]}? ' if near else ''}the list has all: axisbus eds check --list",
        )
    return found[0][: len(text)]


def starting(text: str) -> list[str]:
    """Return the ids that begin with this text, in small letters or capitals; the rule alone where it is a whole id."""
    exact = [rule for rule in rules() if rule.lower() == text.lower()]
    return exact or [rule for rule in rules() if rule.lower().startswith(text.lower())]


def _longest(rule: str, prefixes: Collection[str]) -> int:
    """Return the length of the longest prefix that means a rule."""
    meant = [len(prefix) for prefix in prefixes if rule == prefix or _begins(rule, prefix)]
    return max(meant, default=_NONE)


def _begins(rule: str, prefix: str) -> bool:
    return prefix not in rules() and rule.startswith(prefix)
