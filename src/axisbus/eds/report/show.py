"""The dictionary of an EDS as a tree for a user, after drawings of the PDOs, or the objects that match a search."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.cia301.objects import is_pdo_mapping
from axisbus.cia402 import value_texts
from axisbus.eds import layout
from axisbus.eds.layout import PdoLayout
from axisbus.eds.model import Eds, Number, Object, Variable
from axisbus.eds.report import overview, pdo_text, wording
from axisbus.eds.report.pdo_text import BOXES, Style
from axisbus.eds.rules import standard
from axisbus.errors import EdsError
from axisbus.wording import counted

PAGE = 100  # characters of a drawing if the width is not limited
_NARROWEST_NAME = 16
_WIDEST_NAME = 60
_ROOM_FOR_VALUE = 24
_MIN_FOLDED = 3  # at least this many sub-indices that differ only in their number are shown as one line
_DIGITS = re.compile(r"\d+")


class TreeRow(NamedTuple):
    """One line of the tree, its columns as texts."""

    address: str
    name: str
    kind: str
    access: str
    pdo: str
    value: str


class Screen(NamedTuple):
    """The display: ``width`` in characters (None: not limited), the line characters, whether equal sub-indices are combined."""

    width: int | None = None
    style: Style = BOXES
    fold: bool = True

    @property
    def drawing(self) -> int:
        """The number of characters for a drawing."""
        return self.width or PAGE


def tree(eds: Eds, node_id: int | None = None, screen: Screen = Screen()) -> Iterator[str]:  # noqa: B008  frozen
    """Yield the whole dictionary as lines; defaults that depend on the node-ID are those for ``node_id`` (1 to 127)."""
    yield from head(eds, node_id)
    pdos = layout.layouts(eds, node_id)
    for each in pdos:
        yield ""
        yield from pdo_text.lines(each, screen.drawing, screen.style)
    areas = overview.areas(eds)
    rows = [[row for entry in area.objects for row in _object(eds, entry, node_id, screen)] for area in areas]
    columns = _columns([row for group in rows for row in group], screen.width)
    for area, group in zip(areas, rows, strict=True):
        yield ""
        yield f"{area.title}: {counted(len(area.objects), 'object')}"
        yield from _lines(group, columns, screen)


def matches(
    eds: Eds,
    found: Iterable[ObjectMatch],
    node_id: int | None = None,
    screen: Screen = Screen(),  # noqa: B008  frozen
) -> Iterator[str]:
    """Yield the objects of a search as lines of the same tree."""
    rows = [row for match in found for row in _object(eds, match.entry, node_id, screen, match.subs)]
    yield from _lines(rows, _columns(rows, screen.width), screen)


def head(eds: Eds, node_id: int | None) -> Iterator[str]:
    """Yield the head: maker, device, capabilities, and number of findings."""
    summary = overview.overview(eds, node_id)
    yield f"{summary.title} ({eds.source})"
    for title, text in (
        ("identity", identity_text(summary)),
        ("device", _device_text(summary)),
        ("modes", modes_text(summary)),
        ("bit rates", ", ".join(map(str, summary.bit_rates)) + " kbit/s" if summary.bit_rates else ""),
        ("contents", overview.contents(eds)),
        ("node", _node_text(eds, node_id)),
        ("reading", wording.findings(eds.findings) or "nothing odd"),
    ):
        if text:
            yield f"  {title:<10}  {text}"


def identity_text(summary: overview.EdsOverview) -> str:
    """Return the numbers of 1018h in one line."""
    identity = summary.identity
    numbers = (
        ("vendor", identity.vendor_id),
        ("product", identity.product_code),
        ("revision", identity.revision),
    )
    return ", ".join(f"{title} 0x{number:08X}" for title, number in numbers if number is not None)


def modes_text(summary: overview.EdsOverview) -> str:
    """Return the modes that the file lists for each axis; empty if the device is no drive."""
    texts = []
    for axis in range(1, summary.axes + 1):
        claims = [claim for claim in summary.claims if claim.axis == axis]
        claimed = [claim.short for claim in claims if claim.claimed]
        if all(claim.claimed is None for claim in claims):
            able = " ".join(claim.short for claim in claims if not claim.missing)
            text = f"not said (6502h has no value); objects are there for {able or 'none'}"
        else:
            text = " ".join(claimed) or "none"
        texts.append(f"axis {axis}: {text}" if summary.axes > 1 else text)
    return "; ".join(texts)


def _device_text(summary: overview.EdsOverview) -> str:
    if summary.device_type is None:
        return ""
    return f"{summary.kind}, device type 0x{summary.device_type:08X}"


def _node_text(eds: Eds, node_id: int | None) -> str:
    if node_id is None:
        return ""
    return f"{node_id}" + (" (the DCF's own)" if node_id == eds.node_id else "")


def _object(
    eds: Eds, entry: Object, node_id: int | None, screen: Screen, only: tuple[int, ...] | None = None
) -> Iterator[TreeRow]:
    """Yield the rows of one object; with ``only``, of these sub-indices."""
    address = f"{entry.index:04X}"
    if not entry.is_record:
        for sub in entry.subs.values():
            yield _row(eds, sub, node_id, address, wording.full_name(entry, sub))
        return
    yield TreeRow(address, entry.name, entry.object_type.name, "", "", "")
    subs = [sub for sub in entry.subs.values() if only is None or sub.subindex in only]
    groups = list(runs(subs)) if screen.fold and only is None else [[sub] for sub in subs]
    for number, run in enumerate(groups, 1):
        mark = screen.style.last if number == len(groups) else screen.style.branch
        yield _sub_row(eds, run, node_id, mark)


def _sub_row(eds: Eds, run: list[Variable], node_id: int | None, mark: str) -> TreeRow:
    first, last = run[0], run[-1]
    name = first.denotation or first.name
    address = f"{mark}:{first.subindex:02X}"
    if len(run) > 1:
        address, name = f"{address}-{last.subindex:02X}", f"{name} ({len(run)} alike)"
    return _row(eds, first, node_id, address, name)


def _row(eds: Eds, sub: Variable, node_id: int | None, address: str, name: str) -> TreeRow:
    limits = wording.limits(sub, node_id)
    text = value_text(eds, sub, node_id)
    value = f"{text}  [{limits}]" if limits and text else f"[{limits}]" if limits else text
    return TreeRow(address, name, wording.type_name(sub), sub.access, wording.pdo_direction(sub), value)


def value_text(eds: Eds, sub: Variable, node_id: int | None) -> str:
    """Return the value after power-up; for a mapping entry, the object that it maps."""
    given = sub.initial(node_id)
    if isinstance(given, int) and is_pdo_mapping(sub.index) and sub.subindex > 0:
        return layout.describe_mapped(eds, given) or "0"
    return wording.initial(sub, node_id)


def runs(subs: list[Variable]) -> Iterator[list[Variable]]:
    """Yield neighbours that differ only in their number as one run, if there are enough of them."""
    run: list[Variable] = []
    for sub in subs:
        if run and (_facts(sub) != _facts(run[0]) or sub.subindex != run[-1].subindex + 1):
            yield from _folded(run)
            run = []
        run.append(sub)
    yield from _folded(run)


def _folded(run: list[Variable]) -> Iterator[list[Variable]]:
    if len(run) >= _MIN_FOLDED:
        yield run
    else:
        yield from ([sub] for sub in run)


def _facts(sub: Variable) -> tuple[str | int | bool | float | bytes | Number | None, ...]:
    name = _DIGITS.sub("#", sub.name)
    return (
        *(name, sub.denotation, sub.data_type, sub.access, sub.pdo_mapping, sub.object_flags),
        *(sub.default, sub.parameter_value, sub.low, sub.high),
    )


def _columns(rows: list[TreeRow], width: int | None) -> tuple[int, ...]:
    """Return the widths of all columns but the last; if the width is limited, the name is shortened."""
    widths = [max((len(row[at]) for row in rows), default=0) for at in range(5)]
    widths[1] = min(widths[1], _WIDEST_NAME if width is None else _WIDEST_NAME // 2 + width // 8)
    if width is not None:
        values = min(_ROOM_FOR_VALUE, max((len(row.value) for row in rows), default=0))
        rest = width - 2 - sum(widths) + widths[1] - 2 * len(widths) - values
        widths[1] = max(_NARROWEST_NAME, min(widths[1], rest))
    return tuple(widths)


def _lines(rows: list[TreeRow], columns: tuple[int, ...], screen: Screen) -> Iterator[str]:
    for row in rows:
        cells = [cut(text, room, screen).ljust(room) for text, room in zip(row[:-1], columns, strict=True)]
        yield cut("  ".join(["", *cells, row.value]).rstrip(), screen.width, screen)


def cut(text: str, room: int | None, screen: Screen) -> str:
    """Return a text cut to ``room`` characters; unchanged if the width of the screen is not limited."""
    if screen.width is None or room is None or len(text) <= room:
        return text
    return text[: room - 1] + screen.style.dots


# -- One object of an EDS with all available information: the file, the standard, its PDOs, its bits and values --------


# Bits of ObjFlags (DS 306 4.6.3.2).
_FLAGS = {0: "left out when a DCF is downloaded", 1: "left out when the device is scanned"}


# The PDOs into which an entry may be mapped (``wording.pdo_direction``), in words.
DIRECTIONS = {"RPDO": "an RPDO", "TPDO": "a TPDO", "TPDO/RPDO": "a TPDO or an RPDO"}


def object_lines(eds: Eds, match: ObjectMatch, node_id: int | None, screen: Screen) -> Iterator[str]:
    """Yield all information about one object, or about the sub-indices found by a search, as lines."""
    entry = match.entry
    pdos = layout.layouts(eds, node_id)
    where = f"{eds.source}:{entry.line}" if entry.line else f"{eds.source}, by CompactPDO"
    yield f"{wording.address_text(entry.index)}  {entry.name}  ({where})"
    subs = [sub for sub in entry.subs.values() if match.subs is None or sub.subindex in match.subs]
    if entry.is_record:
        yield f"  {entry.object_type.name} with {counted(len(entry.subs), 'sub-index', 'sub-indices')}"
        yield from matches(
            eds,
            [ObjectMatch(entry, tuple(sub.subindex for sub in subs))],
            node_id,
            screen._replace(fold=False),
        )
    for sub in subs:
        yield from _entry(entry, sub, node_id, pdos)
    yield from _pdo_rows(entry, pdos, screen)


def pdo_lines(pdo: PdoLayout, screen: Screen) -> Iterator[str]:
    """Yield a PDO drawn, with its parameters."""
    yield from pdo_text.lines(pdo, screen.drawing, screen.style)
    yield f"  parameters in {wording.address_text(pdo.communication)} and {wording.address_text(pdo.mapping)}"


def _entry(entry: Object, sub: Variable, node_id: int | None, pdos: tuple[PdoLayout, ...]) -> Iterator[str]:
    """Yield the information about one entry; a sub-index without information beside its row is left out."""
    facts = list(_show_object_facts(entry, sub, node_id, pdos))
    tables = value_texts.tables(sub.index, sub.subindex)
    if entry.is_record and (facts or tables):
        yield f"  :{sub.subindex:02X} {sub.denotation or sub.name}"
    indent = "    " if entry.is_record else "  "
    for title, text in facts:
        yield f"{indent}{title:<9} {text}"
    for table in tables:
        yield f"{indent}{table.title}"
        width = max(len(key) for key, _ in table.rows)
        prefix = "bit " if table.key == "bit" else ""
        for key, text in table.rows:
            yield f"{indent}  {prefix}{key:<{width}}  {text}"


def _show_object_facts(
    entry: Object, sub: Variable, node_id: int | None, pdos: tuple[PdoLayout, ...]
) -> Iterator[tuple[str, str]]:
    if not entry.is_record:
        direction = wording.pdo_direction(sub)
        mapping = f"may be mapped in {DIRECTIONS[direction]}" if direction else "cannot be mapped"
        yield "type", f"{entry.object_type.name}, {wording.type_name(sub)}, {sub.access}, {mapping}"
        yield "value", wording.initial(sub, node_id) or "none given"
        yield "limits", wording.limits(sub, node_id, whole=True) or "none"
    yield from remarks(entry, sub, pdos)


def remarks(entry: Object, sub: Variable, pdos: tuple[PdoLayout, ...]) -> Iterator[tuple[str, str]]:
    """Yield additional information about an entry as (title, text); most sub-indices have none."""
    if sub.denotation and sub.denotation != sub.name:
        yield "name", sub.name
    mapped_in = ", ".join(carriers(sub, pdos))
    if mapped_in:
        yield "in", mapped_in
    flags = [text for bit, text in _FLAGS.items() if sub.object_flags >> bit & 1]
    if flags:
        yield "flags", "; ".join(flags)
    words = standard.words(sub.index, sub.subindex)
    if words and not (entry.is_record and standard.agrees(sub)):
        yield "standard", words


def carriers(sub: Variable, pdos: tuple[PdoLayout, ...]) -> list[str]:
    """Return the PDOs that carry an entry, with its position in each."""
    return [
        f"{each.name} {slot.where}" + ("" if each.valid else " (switched off)")
        for each in pdos
        for slot in each.slots
        if (slot.mapped.index, slot.mapped.subindex) == (sub.index, sub.subindex)
    ]


def _pdo_rows(entry: Object, pdos: tuple[PdoLayout, ...], screen: Screen) -> Iterator[str]:
    for each in pdos:
        if entry.index in (each.communication, each.mapping):
            yield from pdo_text.lines(each, screen.drawing, screen.style)


# -- Find objects of an EDS by number, by part of a name, or by the name of a PDO ------------------------------------------

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
        raise _not_found(eds, text)
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


def _not_found(eds: Eds, text: str) -> EdsError:
    names = {entry.name.lower(): entry for entry in eds}
    similar = difflib.get_close_matches(text.lower(), names, n=3, cutoff=0.6)
    hint = ", ".join(f"{names[name].index:04X}h {names[name].name}" for name in similar)
    return EdsError(
        f"there is no object {text!r}",
        file=eds.source,
        remedy=(f"there is: {hint}; " if hint else "")
        + "give an index (6041 or 1018:1), a part of a name, or a PDO (TPDO1)",
    )
