"""Identifiers for Python, C and DBC from the names in an EDS, which are free text and not unique."""

from __future__ import annotations

import keyword
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from typing import TypeVar

MAX_LENGTH = 80  # a ParameterName has up to 241 characters (DS 306 4.6.3.2)

_Key = TypeVar("_Key")

_SEPARATORS = re.compile(r"[^0-9A-Za-z]+")
_SYMBOL_NAMES = {"+": " plus ", "°": " deg ", "µ": "u", "μ": "u", "Ω": " ohm ", "%": " percent ", "ß": "ss"}


def snake(text: str) -> str:
    """Return words joined by ``_`` in their own case, ASCII only; empty if nothing of the text remains."""
    for sign, word in _SYMBOL_NAMES.items():
        text = text.replace(sign, word)
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return _SEPARATORS.sub("_", plain).strip("_")[:MAX_LENGTH].rstrip("_")


def constant(text: str, otherwise: str) -> str:
    """Return a name such as ``TARGET_POSITION``; ``otherwise`` replaces an empty name, or precedes a leading digit."""
    name = snake(text).upper()
    if not name:
        return otherwise
    return f"{otherwise}_{name}"[:MAX_LENGTH].rstrip("_") if name[0].isdigit() else name


def camel(text: str, otherwise: str) -> str:
    """Return a class name such as ``QuickStopOption``."""
    name = "".join(word[0].upper() + word[1:].lower() for word in snake(text).split("_") if word)
    return name if name and not name[0].isdigit() else f"{otherwise}{name}"


def unique(
    preferred: Mapping[_Key, str], suffix: Callable[[_Key], str], reserved: Collection[str] = ()
) -> dict[_Key, str]:
    """Return a unique name for each key: the wanted one, with ``suffix`` if it is not unique or is taken.

    All keys that share a name get the suffix, so that no name depends on the order of the file. Keywords of Python count as taken.
    """
    counts = Counter(preferred.values())
    unambiguous = {key for key, name in preferred.items() if counts[name] == 1 and _free(name, reserved)}
    used = {preferred[key] for key in unambiguous} | set(reserved)
    names: dict[_Key, str] = {}
    for key, name in preferred.items():
        if key not in unambiguous:
            name = f"{name}_{suffix(key)}"
            while name in used:
                name += "_"
            used.add(name)
        names[key] = name
    return names


def _free(name: str, reserved: Collection[str]) -> bool:
    return name not in reserved and not keyword.iskeyword(name) and not keyword.issoftkeyword(name)
