"""The reference of a device as Markdown, with tables and PDOs drawn in characters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from axisbus.eds.device_doc.content import AreaPage, DeviceReference, Explained, ObjectPage, ReferenceRow
from axisbus.eds.layout import PdoLayout
from axisbus.eds.report import pdo_text, wording
from axisbus.wording import counted

_WIDTH = 100  # characters of a drawing
_SPECIAL = re.compile(r"([\\`*_\[\]<>|#])")
_COLUMNS = ("", "Name", "Type", "Access", "PDO", "Value", "Limits")


def markdown(page: DeviceReference) -> str:
    """Return the whole text, in the Markdown of GitHub (tables, and anchors as HTML)."""
    return "\n".join(
        (
            f"# {_text(page.title)}",
            "",
            f"Object dictionary, from `{page.source.replace('`', '')}`.",
            "",
            *_table(("", ""), page.facts),
            *_contents(page),
            *_modes(page),
            *_pdos(page),
            *(line for area in page.areas for line in _area(area)),
            *_findings(page),
        )
    )


def _contents(page: DeviceReference) -> Iterator[str]:
    yield "## Contents"
    yield ""
    if page.axes:
        yield "- [Modes of operation](#modes)"
    if page.pdos:
        yield "- [PDOs](#pdos)"
    yield from (
        f"- [{_text(area.title)}](#{area.anchor}): {counted(len(area.objects), 'object')}"
        for area in page.areas
    )
    yield "- [Findings](#findings)"
    yield ""


def _modes(page: DeviceReference) -> Iterator[str]:
    if not page.axes:
        return
    yield from _heading("Modes of operation", "modes")
    rows = [
        (str(mode.axis), mode.short, mode.name, mode.claimed, mode.missing or "none") for mode in page.modes
    ]
    yield from _table(("Axis", "Mode", "", "Claimed by 6502h", "Mandatory objects that are not there"), rows)


def _pdos(page: DeviceReference) -> Iterator[str]:
    if not page.pdos:
        return
    yield from _heading("PDOs", "pdos")
    yield "Bit 0 of each byte is on the left."
    yield ""
    for each in page.pdos:
        yield from _pdo(each)


def _pdo(each: PdoLayout) -> Iterator[str]:
    yield f"### {each.name}"
    yield ""
    yield _text(pdo_text.heading(each))
    yield ""
    drawn = pdo_text.draw(each, _WIDTH)
    if drawn:
        yield from ("```text", *drawn, "```", "")
    rows = pdo_text.legend(each, _WIDTH)
    if rows:
        yield from _table(("", "Where", "Object", "Name", "Type"), rows)
    for note in each.notes:
        yield f"- {_text(note)}"
    if each.notes:
        yield ""


def _area(area: AreaPage) -> Iterator[str]:
    yield from _heading(area.title, area.anchor)
    for each in area.objects:
        yield from _object(each)


def _object(each: ObjectPage) -> Iterator[str]:
    kind = f" ({each.kind})" if each.kind else ""
    yield from _heading(f"{each.address_text} {each.name}{kind}", each.anchor, "###")
    yield from _table(_COLUMNS, (_cells(row) for row in each.rows))
    remarks = list(_remarks(each))
    yield from remarks
    if remarks:
        yield ""
    for explained in each.explained:
        yield from _explained(explained)


def _cells(row: ReferenceRow) -> tuple[str, ...]:
    address = f":{row.address}" if row.address else ""
    return (address, row.name, row.data_type, row.access, row.pdo, row.value, row.limits)


def _remarks(each: ObjectPage) -> Iterator[str]:
    for row in each.rows:
        address_text = f":{row.address} " if row.address else ""
        yield from (f"- {address_text}{title}: {_text(text)}" for title, text in row.remarks)


def _explained(each: Explained) -> Iterator[str]:
    name = f"{each.name}: " if each.name else ""
    if each.described_at is not None:
        yield f"{_text(name)}bits and values: see [{wording.address_text(each.described_at)}](#o{each.described_at:04X})"
        yield ""
    for table in each.tables:
        yield f"{_text(name + table.title)}:"
        yield ""
        yield from _table((table.key.capitalize(), "Meaning"), table.rows)


def _findings(page: DeviceReference) -> Iterator[str]:
    yield from _heading("Findings", "findings")
    yield f"{page.verdict[0].upper()}{page.verdict[1:]}."
    yield ""
    if page.findings:
        rows = [
            (each.severity.value, each.rule, str(each.line or ""), each.message, each.remedy)
            for each in page.findings
        ]
        yield from _table(("", "Rule", "Line", "What is wrong", "Remedy"), rows)


def _heading(title: str, anchor: str, level: str = "##") -> Iterator[str]:
    yield f'<a id="{anchor}"></a>'
    yield ""
    yield f"{level} {_text(title)}"
    yield ""


def _table(column_titles: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    titles = tuple(column_titles)
    yield f"| {' | '.join(titles)} |"
    yield f"|{' --- |' * len(titles)}"
    for row in rows:
        yield f"| {' | '.join(_text(cell) for cell in row)} |"
    yield ""


def _text(text: str) -> str:
    """Return a text escaped for Markdown, on one line."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))
