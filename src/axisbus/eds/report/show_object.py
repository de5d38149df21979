"""One object of an EDS with all available information: the file, the standard, its PDOs, its bits and values."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cia402 import value_texts
from axisbus.eds import layout
from axisbus.eds.layout import PdoLayout
from axisbus.eds.model import Eds, Object, Variable
from axisbus.eds.report import pdo_text, show, wording
from axisbus.eds.report.search import ObjectMatch
from axisbus.eds.report.show import Screen
from axisbus.eds.rules import standard
from axisbus.wording import counted

# Bits of ObjFlags (DS 306 4.6.3.2).
_FLAGS = {0: "left out when a DCF is downloaded", 1: "left out when the device is scanned"}

# The PDOs into which an entry may be mapped (``wording.pdo_direction``), in words.
DIRECTIONS = {"RPDO": "an RPDO", "TPDO": "a TPDO", "TPDO/RPDO": "a TPDO or an RPDO"}


def object_lines(eds: Eds, match: ObjectMatch, node_id: int | None, screen: Screen) -> Iterator[str]:
    """Yield all information about one object, or about the sub-indices found by a search, as lines."""
    entry = match.entry
    pdos = layout.layouts(eds, node_id)
    where = f"{eds.source}:{entry.line}" if entry.line else f"{eds.source}, by CompactPDO"
    yield f"{wording.place(entry.index)}  {entry.name}  ({where})"
    subs = [sub for sub in entry.subs.values() if match.subs is None or sub.subindex in match.subs]
    if entry.is_record:
        yield f"  {entry.object_type.name} with {counted(len(entry.subs), 'sub-index', 'sub-indices')}"
        yield from show.matches(
            eds,
            [ObjectMatch(entry, tuple(sub.subindex for sub in subs))],
            node_id,
            screen._replace(fold=False),
        )
    for sub in subs:
        yield from _entry(entry, sub, node_id, pdos)
    yield from _drawn(entry, pdos, screen)


def pdo_lines(eds: Eds, receive: bool, number: int, node_id: int | None, screen: Screen) -> Iterator[str]:
    """Yield one PDO drawn, with its parameters; nothing if the file has none of this number."""
    for each in layout.layouts(eds, node_id):
        if (each.receive, each.number) == (receive, number):
            yield from pdo_text.lines(each, screen.drawing, screen.style)
            yield f"  parameters in {wording.place(each.communication)} and {wording.place(each.mapping)}"


def _entry(entry: Object, sub: Variable, node_id: int | None, pdos: tuple[PdoLayout, ...]) -> Iterator[str]:
    """Yield the information about one entry; a sub-index without information beside its row is left out."""
    facts = list(_facts(entry, sub, node_id, pdos))
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


def _facts(
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
    carried = ", ".join(carriers(sub, pdos))
    if carried:
        yield "in", carried
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


def _drawn(entry: Object, pdos: tuple[PdoLayout, ...], screen: Screen) -> Iterator[str]:
    for each in pdos:
        if entry.index in (each.communication, each.mapping):
            yield from pdo_text.lines(each, screen.drawing, screen.style)
