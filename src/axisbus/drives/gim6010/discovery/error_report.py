"""The errors of a module in full: each category with its word, each bit with its meaning and remedy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.discovery.results import DiscoveredModule, ProtocolsFound
from axisbus.errors import ArgumentError

CATEGORIES = tuple(dict.fromkeys(each.category for each in faults.FAULTS))
# Paths over USB of the words that a module may not report over CAN.
_OVER_USB = {
    "system": "odrv0.error",
    "axis": "odrv0.axis0.error",
    "motor": "odrv0.axis0.motor.error",
    "controller": "odrv0.axis0.controller.error",
    "encoder": "odrv0.axis0.encoder.error",
}
_LONGEST = {"motor": 64}  # bits; the others have 32


def lines(finding: DiscoveredModule) -> Iterator[str]:
    """Yield the errors of one module, as lines of text."""
    where = " or ".join(map(str, finding.addresses))
    yield f"node {where}: {finding.protocol.value}"
    if finding.protocol is ProtocolsFound.CAN_SIMPLE:
        yield from _categories(finding)
    else:
        yield from (f"  {name}: {word:08X}h" for name, word in finding.words)
        yield from (f"    {each}" for each in finding.errors)
        if not finding.errors:
            yield "  no error" if finding.words else "  its errors were not reported"
    yield from (f"  note: {each}" for each in finding.notes)


def _categories(finding: DiscoveredModule) -> Iterator[str]:
    told = dict(finding.words)
    for category in CATEGORIES:
        if category in told:
            yield from of_words([(category, told[category])])
        else:
            yield f"  {category}: not available over CAN; over USB it is {_OVER_USB[category]}"
    explained = {text for category, word in told.items() for text in faults.words(category, word)}
    yield from (f"  {each}" for each in finding.errors if each not in explained)


def of_words(words: Iterable[tuple[str, int]]) -> Iterator[str]:
    """Yield each error word, then the meaning of each of its bits."""
    for category, word in words:
        yield f"  {category}: {word:08X}h" + ("" if word else ", no error")
        yield from (f"    {each}" for each in faults.words(category, word))


def parse(text: str) -> tuple[str, int]:
    """Return the category and the word from a text such as ``axis=0x40``.

    Raises:
        ArgumentError: the format is wrong, the category does not exist, or the word is too long.
    """
    category, _, number = text.partition("=")
    try:
        word = int(number, 0)
    except ValueError:
        word = -1
    if category not in CATEGORIES:
        raise ArgumentError(
            f"{category!r} is not a category of errors", remedy=f"there are {', '.join(CATEGORIES)}"
        )
    if not 0 <= word < 1 << _LONGEST.get(category, 32):
        raise ArgumentError(f"{text}: no error word", remedy=f"write it as {category}=0x40")
    return category, word
