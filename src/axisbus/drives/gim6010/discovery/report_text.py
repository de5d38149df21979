"""The discovery's results as lines of text, and the commands to type next."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.discovery.finder import Finder, ProbeScope
from axisbus.drives.gim6010.discovery.results import DiscoveredModule, ProtocolsFound
from axisbus.drives.gim6010.factory_protocols import REMEDIES, Protocol
from axisbus.errors import ArgumentError
from axisbus.wording import counted

_SHOWN = 12  # foreign identifiers in the list


def lines(finding: DiscoveredModule) -> Iterator[str]:
    where = " or ".join(map(str, finding.addresses))
    many = ", several modules" if finding.several else ""
    yield f"node {where}: {finding.protocol.value}{many}" + (f", {finding.device}" if finding.device else "")
    for title, text in _facts(finding):
        yield f"  {title + ':':<11}{text}"
    for error in finding.errors:
        yield f"  error:     {error}"
    for note in finding.notes:
        yield f"  note:      {note}"


def _facts(finding: DiscoveredModule) -> Iterator[tuple[str, str]]:
    """Yield titles and texts; unknown values are named as such, and never guessed."""
    if finding.heartbeat:
        yield "heartbeat", finding.heartbeat
    yield "firmware", finding.firmware or "not told"
    if finding.serial is not None:
        low = " (its lowest 32 bits)" if finding.protocol is ProtocolsFound.CAN_SIMPLE else ""
        yield "serial", f"{finding.serial:08X}h{low}"
    if finding.protocol is ProtocolsFound.EXTENDED:
        return
    yield "state", finding.state or "not told"
    yield "supply", "not told" if finding.voltage is None else f"{finding.voltage:.1f} V"
    if not finding.errors:
        yield "errors", "none" if finding.words else "not told"


def following(found: Sequence[DiscoveredModule], bus: str) -> list[str]:
    """Return the commands to type next, most urgent first; ``bus`` are the bus options of the command line."""
    steps = [
        f"axisbus gim6010 errors {bus} --node {each.node}"
        for each in found
        if each.errors and each.node is not None and each.ours
    ]
    steps += [
        f"axisbus gim6010 params dump {bus} --node {each.node} --list endpoints_{each.firmware}.json"
        for each in found
        if each.endpoints and not each.several
    ]
    if any(each.protocol is ProtocolsFound.CANOPEN for each in found):
        steps.append(f"axisbus init {bus} -o cell.toml")
    steps += [
        text
        for each in found
        if each.protocol is ProtocolsFound.CAN_SIMPLE
        for text in _to_canopen(each, bus)
    ]
    if any(each.protocol is ProtocolsFound.CAN_SIMPLE and not each.endpoints for each in found):
        steps.append(f"to bring it to CANopen: {_remedy(Protocol.CAN_SIMPLE)}")
    if any(each.protocol is ProtocolsFound.EXTENDED for each in found):
        steps.append(_remedy(Protocol.EXTENDED))
    return steps


def _to_canopen(finding: DiscoveredModule, bus: str) -> Iterator[str]:
    """Yield the commands that switch a module to CANopen, if that is possible over CAN."""
    if finding.several or not finding.endpoints:
        return
    if finding.node == 0:
        yield f"axisbus gim6010 set-id 1 {bus} --node 0"
        return
    yield f"axisbus gim6010 to-canopen {bus} --node {finding.node} --list endpoints_{finding.firmware}.json"


def _remedy(protocol: Protocol) -> str:
    return REMEDIES[protocol].partition("like this (500 kbit/s, node ID 0 or 1): ")[2] or REMEDIES[protocol]


def about_the_bus(finder: Finder) -> Iterator[str]:
    """Yield remarks on the bus as a whole: which nodes got requests and which did not, and foreign identifiers."""
    foreign = finder.picture.foreign()
    if foreign:
        which = counted(len(foreign), "identifier belongs", "identifiers belong")
        yield f"foreign: {which} to no known device; nothing was sent on them"
        yield from (f"  {each.words}" for each in foreign[:_SHOWN])
        if len(foreign) > _SHOWN:
            yield f"  and {len(foreign) - _SHOWN} more"
    for node, count in finder.picture.doubtful.items():
        yield (
            f"node {node} of CAN Simple may be there ({counted(count, 'frame')} like its heartbeats), on an identifier that "
            "CANopen may use too: the frames prove neither; connect it alone, and give it a node ID that fits the CANopen nodes"
        )
    for why, nodes in finder.left_out.items():
        yield f"not asked, because {why}: {_ranges(nodes)}"
    if finder.unacknowledged:
        yield f"the requests were ended at the first sign that no node acknowledges: {finder.unacknowledged}"
    elif finder.begun and finder.asked is ProbeScope.HEARD and finder.ask is None:
        yield "silent node IDs were not asked, because of the foreign traffic; --ask all asks them, but on no identifier in use"


def _ranges(numbers: Sequence[int]) -> str:
    """Return numbers in order, consecutive ones as a range: ``1 to 3, 7``."""
    parts: list[list[int]] = []
    for number in sorted(numbers):
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    return ", ".join(f"{part[0]} to {part[-1]}" if len(part) > 1 else str(part[0]) for part in parts)


# -- The errors of a module in full: each category with its word, each bit with its meaning and remedy -----------------


CATEGORIES = tuple(dict.fromkeys(each.category for each in faults.FAULTS))
_LONGEST = {"motor": 64}  # bits; the others have 32


def error_lines(finding: DiscoveredModule) -> Iterator[str]:
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
            yield f"  {category}: not available over CAN; over USB it is odrv0.{faults.WORD_PATHS[category]}"
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
        raise ArgumentError(f"{text} is not an error word", remedy=f"write it as {category}=0x40")
    return category, word
