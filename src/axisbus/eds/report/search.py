"""Find objects of an EDS by number, by part of a name, or by the name of a PDO."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass

from axisbus.eds.model import Eds, Object
from axisbus.errors import EdsError

_ADDRESS = re.compile(r"(?:0x)?([0-9a-f]{4})h?(?:(?:[:./]|sub)(?:0x)?([0-9a-f]{1,2})h?)?", re.IGNORECASE)
_PDO = re.compile(r"([rt])pdo\s*([0-9]{1,3})", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class ObjectMatch:
    """A found object; ``subs`` are the found sub-indices, None for all of them."""

    entry: Object
    subs: tuple[int, ...] | None = None


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The result of a search: a PDO by its name (receive or not, number from 1), or objects."""

    matches: tuple[ObjectMatch, ...] = ()
    pdo: tuple[bool, int] | None = None

    @property
    def one(self) -> Object | None:
        """The only object, None if there are several or none."""
        return self.matches[0].entry if len(self.matches) == 1 else None


def find(eds: Eds, wanted: str) -> SearchResult:
    """Return the result for ``wanted``: ``6041``, ``0x1018:1``, ``1018sub1``, ``TPDO1``, or words in a name in any case.

    Hexadecimal digits that are an index of the file mean the index; otherwise they are a part of a name, such as ``feed``.

    Raises:
        EdsError: nothing matches; the remedy names similar objects.
    """
    text = wanted.strip()
    pdo = _PDO.fullmatch(text)
    if pdo is not None:
        return SearchResult(pdo=(pdo[1].lower() == "r", int(pdo[2])))
    matches = _by_address(eds, text) or _by_name(eds, text)
    if not matches:
        raise _nothing(eds, text)
    return SearchResult(matches)


def _by_address(eds: Eds, text: str) -> tuple[ObjectMatch, ...]:
    found = _ADDRESS.fullmatch(text)
    entry = eds.objects.get(int(found[1], 16)) if found is not None else None
    if found is None or entry is None:
        return ()
    if found[2] is None:
        return (ObjectMatch(entry),)
    subindex = int(found[2], 16)
    return (ObjectMatch(entry, (subindex,)),) if subindex in entry.subs else ()


def _by_name(eds: Eds, text: str) -> tuple[ObjectMatch, ...]:
    words = text.lower().split()
    if not words:
        return ()
    return tuple(match for entry in eds if (match := _match(entry, words)) is not None)


def _match(entry: Object, words: list[str]) -> ObjectMatch | None:
    if all(word in entry.name.lower() for word in words):
        return ObjectMatch(entry)
    whole = entry.name.lower()
    subs = tuple(
        subindex
        for subindex, sub in entry.subs.items()
        if _holds(sub.name.lower(), whole, words) or _holds(sub.denotation.lower(), whole, words)
    )
    return ObjectMatch(entry, subs) if subs else None


def _holds(name: str, owner: str, words: list[str]) -> bool:
    """Whether a sub-index's name contains the words; some of the words may be in its object's name."""
    return any(word in name for word in words) and all(word in name or word in owner for word in words)


def _nothing(eds: Eds, text: str) -> EdsError:
    names = {entry.name.lower(): entry for entry in eds}
    near = difflib.get_close_matches(text.lower(), names, n=3, cutoff=0.6)
    hint = ", ".join(f"{names[name].index:04X}h {names[name].name}" for name in near)
    return EdsError(
        f"there is no object {text!r}",
        file=eds.source,
        remedy=(f"there is: {hint}; " if hint else "")
        + "give an index (6041 or 1018:1), a part of a name, or a PDO (TPDO1)",
    )
