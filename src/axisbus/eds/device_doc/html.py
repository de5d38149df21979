"""The reference of a device as one self-contained HTML page: it loads no scripts, fonts or pictures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from html import escape
from pathlib import Path

from axisbus.cia402.value_texts import Table
from axisbus.eds.device_doc.content import AreaPage, DeviceReference, Explained, ObjectPage, ReferenceRow
from axisbus.eds.layout import PdoLayout, PdoSlot
from axisbus.eds.report import pdo_text, wording
from axisbus.eds.report.pdo_text import letter
from axisbus.wording import counted

_COLUMNS = ("", "Name", "Type", "Access", "PDO", "Value", "Limits")


def html(page: DeviceReference) -> str:
    """Return the whole page."""
    return "\n".join(
        (
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(page.title)}: object dictionary</title>",
            f"<style>\n{_style()}</style></head><body>",
            *_contents(page),
            "<main>",
            f"<h1>{escape(page.title)}</h1>",
            f'<p class="faint">Object dictionary, from {escape(page.source)}</p>',
            _facts(page),
            *_modes(page),
            *_pdos(page),
            *(line for area in page.areas for line in _area(area)),
            *_findings(page),
            "</main></body></html>",
            "",
        )
    )


@cache
def _style() -> str:
    return (Path(__file__).parent / "style.css").read_text(encoding="utf-8")


def _contents(page: DeviceReference) -> Iterator[str]:
    """Return the table of contents: beside the text on a screen, before the text on paper."""
    yield f'<nav aria-label="Contents"><h2><a href="#device">{escape(page.title)}</a></h2><ul>'
    if page.axes:
        yield '<li><a href="#modes">Modes of operation</a></li>'
    if page.pdos:
        yield '<li><a href="#pdos">PDOs</a></li>'
    yield '<li><a href="#findings">Findings</a></li></ul>'
    for area in page.areas:
        yield f'<h2><a href="#{area.anchor}">{escape(area.title)}</a></h2><ul class="objects">'
        yield from (
            f'<li><a href="#{each.anchor}"><span class="mono">{each.index:04X}</span> {escape(each.name)}</a></li>'
            for each in area.objects
        )
        yield "</ul>"
    yield "</nav>"


def _facts(page: DeviceReference) -> str:
    rows = "".join(f"<tr><th>{escape(title)}</th><td>{escape(text)}</td></tr>" for title, text in page.facts)
    return f'<table class="plain facts" id="device">{rows}</table>'


def _modes(page: DeviceReference) -> Iterator[str]:
    if not page.axes:
        return
    several = page.axes > 1
    column_titles = [
        *(["Axis"] if several else []),
        "Mode",
        "",
        "Claimed by 6502h",
        "Mandatory objects that are not there",
    ]
    yield '<h2 id="modes">Modes of operation</h2>'
    yield '<table class="plain">' + _head(column_titles) + "<tbody>"
    for mode in page.modes:
        cells = [escape(text) for text in ([str(mode.axis)] if several else []) + [mode.short, mode.name]]
        kind = _class(["warning"]) if mode.claimed == "yes" and mode.missing else ""
        row = "".join(f"<td>{cell}</td>" for cell in (*cells, escape(mode.claimed)))
        yield f"<tr>{row}<td{kind}>{escape(mode.missing or 'none')}</td></tr>"
    yield "</tbody></table>"


def _pdos(page: DeviceReference) -> Iterator[str]:
    if not page.pdos:
        return
    yield '<h2 id="pdos">PDOs</h2>'
    yield '<p class="faint intro">Each row is the data of one frame, bytes 0 to 7; bit 0 of each byte is on the left.</p>'
    for each in page.pdos:
        yield from _pdo(each)


def _pdo(each: PdoLayout) -> Iterator[str]:
    state = "" if each.valid else " off"
    yield f'<section class="pdo-section{state}" id="{each.name}">'
    yield f'<h3>{each.name} <span class="faint">{escape(pdo_text.heading(each))}</span></h3>'
    yield svg(each)
    if each.slots:
        lettered = any(has_letter(slot) for slot in each.slots)
        yield '<table class="plain"><tbody>'
        for number, slot in enumerate(each.slots):
            short = [pdo_text.letter(number) if has_letter(slot) else ""] if lettered else []
            cells = [escape(text) for text in (*short, slot.where)]
            address = (
                _link(slot.mapped.index, slot.address) if slot.variable is not None else escape(slot.address)
            )
            cells += [address, escape(slot.name or "(not described)"), escape(pdo_text.kind(slot))]
            yield f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"
        yield "</tbody></table>"
    elif each.valid:
        yield "<p>maps nothing</p>"
    yield from (f'<p class="warning">{escape(note)}</p>' for note in each.notes)
    yield "</section>"


def _area(area: AreaPage) -> Iterator[str]:
    yield f'<h2 id="{area.anchor}">{escape(area.title)} <span class="faint">({counted(len(area.objects), "object")})</span></h2>'
    widths = "".join(f'<col class="c{number}">' for number in range(len(_COLUMNS)))
    yield f'<table class="objects"><colgroup>{widths}</colgroup>{_head(_COLUMNS)}'
    for each in area.objects:
        yield "<tbody>"
        yield from _object(each)
        yield "</tbody>"
    yield "</table>"


def _object(each: ObjectPage) -> Iterator[str]:
    """Return the rows of one object; an object without sub-indices is a single row."""
    plain = len(each.rows) == 1 and not each.rows[0].address
    tail = list(_remarks([], each.explained))
    if not plain:
        yield (
            f'<tr class="object" id="{each.anchor}"><th class="mono">{each.address_text}</th>'
            f'<th colspan="6">{escape(each.name)} <span class="faint">{escape(each.kind)}</span></th></tr>'
        )
    for row in each.rows:
        explained = each.explained if plain else ()
        yield from _row(row, each if plain else None, list(_remarks(row.remarks, explained)))
    if not plain and tail:
        yield f'<tr class="remark"><td></td><td colspan="6">{"".join(tail)}</td></tr>'


def _row(row: ReferenceRow, owner: ObjectPage | None, remarks: list[str]) -> Iterator[str]:
    kinds = [*(["plain-object"] if owner else []), *(["has-remark"] if remarks else [])]
    opening = f"<tr{_class(kinds)}{f' id={owner.anchor!r}' if owner else ''}>".replace("'", '"')
    address = owner.address_text if owner else f":{row.address}"
    name = f"<strong>{escape(row.name)}</strong>" if owner else escape(row.name)
    if owner and owner.kind:
        name += f' <span class="faint">{escape(owner.kind)}</span>'
    cells = (escape(row.data_type), escape(row.access), escape(row.pdo), escape(row.value))
    yield (
        f'{opening}<td class="mono">{address}</td><td>{name}</td>'
        + "".join(f"<td>{cell}</td>" for cell in cells)
        + f'<td class="limits">{escape(row.limits)}</td></tr>'
    )
    if remarks:
        yield f'<tr class="remark"><td></td><td colspan="6">{"".join(remarks)}</td></tr>'


def _class(kinds: list[str]) -> str:
    return f' class="{" ".join(kinds)}"' if kinds else ""


def _remarks(remarks: Iterable[tuple[str, str]], explained: Iterable[Explained]) -> Iterator[str]:
    for title, text in remarks:
        yield f"<div>{escape(title)}: {escape(text)}</div>"
    for each in explained:
        name = f"{escape(each.name)}: " if each.name else ""
        if each.described_at is not None:
            yield f"<div>{name}bits and values: see {_link(each.described_at, wording.address_text(each.described_at))}</div>"
        else:
            yield f'<div class="tables">{"".join(_meaning(name, table) for table in each.tables)}</div>'


def _meaning(name: str, table: Table) -> str:
    prefix = "bit " if table.key == "bit" else ""
    rows = "".join(
        f'<tr><td class="mono">{prefix}{escape(key)}</td><td>{escape(text)}</td></tr>'
        for key, text in table.rows
    )
    return f"<table><caption>{name}{escape(table.title)}</caption><tbody>{rows}</tbody></table>"


def _findings(page: DeviceReference) -> Iterator[str]:
    yield f'<h2 id="findings">Findings <span class="faint">({page.verdict})</span></h2>'
    if not page.findings:
        return
    yield (
        '<table class="plain findings">' + _head(("", "Rule", "Line", "What is wrong", "Remedy")) + "<tbody>"
    )
    for each in page.findings:
        line = str(each.line) if each.line else ""
        yield _cells((each.severity.value, each.rule, line, each.message, each.remedy), each.severity.value)
    yield "</tbody></table>"


def _head(titles: Iterable[str]) -> str:
    return f"<thead><tr>{''.join(f'<th>{escape(title)}</th>' for title in titles)}</tr></thead>"


def _cells(texts: Iterable[str], first: str = "") -> str:
    """Return a row; ``first`` is the class of its first cell."""
    first_cell, *others = [escape(text) for text in texts]
    kind = _class([first]) if first else ""
    return f"<tr><td{kind}>{first_cell}</td>{''.join(f'<td>{text}</td>' for text in others)}</tr>"


def _link(index: int, text: str) -> str:
    return f'<a class="mono" href="#o{index:04X}">{escape(text)}</a>'


# -- A PDO drawn as SVG: a row of eight bytes, with a box over the bits of each mapped object --------------------------


_BYTE = 84  # width of one byte; all lengths are in pixels at normal size
_BIT = _BYTE / 8
_HEIGHT = 40
_RULER = 16
_CHARACTER = 6.4  # mean width of the small text
_ROWS = 8  # of eight bytes each; only a faulty file describes a longer frame
_NARROW = 40  # narrower boxes show a letter


def svg(layout: PdoLayout) -> str:
    """Return the drawing as an SVG element, empty for a PDO without mapped objects; bit 0 of each byte is on the left."""
    if not layout.bits:
        return ""
    rows = min(_ROWS, (layout.size + 7) // 8)
    height = rows * (_HEIGHT + _RULER) + 1
    parts = [part for row in range(rows) for part in _bar_row(layout, row)]
    label = escape(
        f"{layout.name}: {', '.join(f'{slot.where} {slot.address} {slot.name}' for slot in layout.slots)}"
    )
    return (
        f'<svg class="pdo" viewBox="0 0 {8 * _BYTE + 1} {height}" width="{8 * _BYTE + 1}" height="{height}" '
        f'role="img" aria-label="{label}">{"".join(parts)}</svg>'
    )


def has_letter(slot: PdoSlot) -> bool:
    """Whether the box of an object is too narrow for its address, and shows a letter."""
    return slot.bits * _BIT < _NARROW


def _bar_row(layout: PdoLayout, row: int) -> Iterator[str]:
    top = row * (_HEIGHT + _RULER)
    low, high = row * 64, row * 64 + 64
    for byte in range(8):
        yield _text(byte * _BYTE + _BYTE / 2, top + 11, str(row * 8 + byte), "ruler")
    yield f'<rect class="free" x="0.5" y="{top + _RULER}.5" width="{8 * _BYTE}" height="{_HEIGHT}"/>'
    for number, slot in enumerate(layout.slots):
        first, end = max(slot.first_bit, low), min(slot.end, high)
        if first < end:
            yield from _box(slot, letter(number), (first - low) * _BIT, (end - first) * _BIT, top + _RULER)
    for byte in range(1, 8):
        yield f'<path class="tick" d="M{byte * _BYTE + 0.5} {top + _RULER + _HEIGHT - 4}v4"/>'


def _box(slot: PdoSlot, short: str, left: float, width: float, top: int) -> Iterator[str]:
    kind = "space" if slot.mapped.is_dummy else "box"
    name = escape(f"{slot.address} {slot.name}, {slot.where}")
    yield f'<g><title>{name}</title><rect class="{kind}" x="{left + 0.5:g}" y="{top}.5" width="{width:g}" height="{_HEIGHT}"/>'
    middle = left + width / 2
    if has_letter(slot):
        yield _text(middle, top + 25, short, "letter")
    else:
        yield _text(middle, top + 17, _cut(slot.address, width), "address")
        yield _text(middle, top + 32, _cut(slot.name, width), "name")
    yield "</g>"


def _cut(text: str, width: float) -> str:
    room = int((width - 4) / _CHARACTER)
    return text if len(text) <= room else text[: max(1, room - 1)].rstrip() + "…"


def _text(x: float, y: float, text: str, kind: str) -> str:
    return f'<text class="{kind}" x="{x:g}" y="{y:g}">{escape(text)}</text>'
