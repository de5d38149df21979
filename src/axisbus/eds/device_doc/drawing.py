"""A PDO drawn as SVG: a row of eight bytes, with a box over the bits of each mapped object."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from axisbus.eds.layout import PdoLayout, PdoSlot
from axisbus.eds.report.pdo_text import letter

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
    parts = [part for row in range(rows) for part in _row(layout, row)]
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


def _row(layout: PdoLayout, row: int) -> Iterator[str]:
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
