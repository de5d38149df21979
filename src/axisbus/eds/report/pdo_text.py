"""A PDO drawn in text: boxes over the bytes of its frame, and a line for each mapped object."""

from __future__ import annotations

import string
from collections.abc import Iterator
from dataclasses import dataclass

from axisbus.cia301.pdo import is_synchronous
from axisbus.eds.layout import PdoLayout, PdoSlot
from axisbus.eds.report import wording
from axisbus.wording import counted

_BYTES = 8
_ROWS = (8, 4, 2, 1)  # bytes that may share a row
_SCALES = (2, 1)  # characters for each bit, the wider first
_NARROWEST = 2  # a box has at least a border and one letter
_ROOM_FOR_ADDRESS = 4
_LETTERS = string.ascii_letters + string.digits + "@#"  # for 64 boxes of one bit


@dataclass(frozen=True, slots=True)
class Style:
    """The characters of boxes and trees."""

    line: str
    wall: str
    top: str  # left corner, tee, right corner
    bottom: str
    branch: str
    last: str
    dots: str


BOXES = Style("─", "│", "┌┬┐", "└┴┘", "├ ", "└ ", "…")
ASCII = Style("-", "|", "+++", "+++", "|-", "`-", "~")


def draw(layout: PdoLayout, width: int, style: Style = BOXES) -> list[str]:
    """Return the lines of the drawing, at most ``width`` characters wide; an empty PDO has none.

    Bit 0 of each byte is on the left. A box that is too narrow for its label shows the letter of its row in ``legend``.
    """
    if not layout.bits:
        return []
    scale, in_row = _scale(layout, width)
    row_lines: list[str] = []
    for first in range(0, max(_BYTES, layout.size), in_row):
        if first * 8 < layout.bits:
            row_lines += _row(layout, first, in_row, scale, style)
    return row_lines


def legend(layout: PdoLayout, width: int) -> list[tuple[str, str, str, str, str]]:
    """Return letter (empty if the box of ``draw`` shows the address), position, address, name and type of each mapped object."""
    scale = _scale(layout, width)[0] if layout.bits else 1
    return [
        (
            letter(number) if _narrow(slot, scale) else "",
            slot.where,
            slot.address,
            slot.name or "(not described)",
            kind(slot),
        )
        for number, slot in enumerate(layout.slots)
    ]


def heading(layout: PdoLayout) -> str:
    """Return COB-ID and transmission in one line: ``185h ($NODEID+0x180), on change (type 255), every 100 ms``."""
    parts = [identifier(layout), transmission(layout)]
    if layout.inhibit_time:
        parts.append(f"at most every {layout.inhibit_time / 10:g} ms")
    if layout.event_timer:
        parts.append(f"{'deadline' if layout.receive else 'at least every'} {layout.event_timer} ms")
    return ", ".join(part for part in parts if part)


def identifier(layout: PdoLayout) -> str:
    """Return the COB-ID for display, with its formula, and whether the PDO is disabled."""
    given = layout.formula
    if given is None:
        return "no COB-ID in the file"
    formula = f"$NODEID+0x{given.value & 0x1FFF_FFFF:X}" if given.plus_node_id else ""
    if layout.cob_id is None:
        text = formula
    elif layout.identifier == 0 and not layout.valid:
        text = "no identifier"
    else:
        text = f"{wording.cob_id(layout.cob_id)} ({formula})" if formula else wording.cob_id(layout.cob_id)
    return text if layout.valid else f"{text}, switched off"


def transmission(layout: PdoLayout) -> str:
    """Return the transmission type in words (CiA 301 tables 69 and 72)."""
    kind = layout.transmission_type
    if kind is None:
        return "no transmission type in the file"
    if kind == 0:
        timing = "with the next SYNC" if layout.receive else "with SYNC, on change"
    elif is_synchronous(kind):
        timing = "with every SYNC" if kind == 1 or layout.receive else f"with every {kind}. SYNC"
    elif kind in (252, 253):
        timing = "on remote request"
    else:
        timing = "on arrival" if layout.receive else "on change"
    return f"{timing} (type {kind})"


def kind(slot: PdoSlot) -> str:
    """Return the data type of a mapped object, with the number of mapped bits if that is not the whole object."""
    name = slot.data_type.name if slot.data_type else "type unknown"
    if slot.data_type is not None and slot.data_type.bits == slot.bits:
        return name
    return f"{name}, {counted(slot.bits, 'bit')} of it"


def lines(layout: PdoLayout, width: int, style: Style = BOXES) -> Iterator[str]:
    """Yield the whole picture of a PDO: heading, drawing, list, notes."""
    yield f"{layout.name}  {heading(layout)}"
    for line in draw(layout, width - 2, style):
        yield f"  {line}"
    rows = legend(layout, width - 2)
    columns = [max((len(row[at]) for row in rows), default=0) for at in range(4)]
    for row in rows:
        cells = [text.ljust(column) for text, column in zip(row, columns, strict=False) if column]
        yield "  ".join(["", *cells, row[-1]]).rstrip()
    if not rows and layout.valid:
        yield "  maps nothing"
    for note in layout.notes:
        yield f"  note: {note}"


def _scale(layout: PdoLayout, width: int) -> tuple[int, int]:
    """Return characters per bit and bytes per row: all bytes in one row if possible, with the widest possible boxes."""
    smallest = min(slot.bits for slot in layout.slots if slot.bits)
    for in_row in _ROWS:
        for scale in _SCALES:
            if 8 * in_row * scale + 1 <= width and smallest * scale >= _NARROWEST:
                return scale, in_row
    return max(1, _NARROWEST - smallest + 1), 1


def _narrow(slot: PdoSlot, scale: int) -> bool:
    return slot.bits * scale - 1 < _ROOM_FOR_ADDRESS


def letter(number: int) -> str:
    """Return the letter of the mapped object ``number`` (from 0), for boxes too narrow for an address."""
    return _LETTERS[number % len(_LETTERS)]


def _row(layout: PdoLayout, first: int, in_row: int, scale: int, style: Style) -> list[str]:
    low, high = first * 8, (first + in_row) * 8
    boxes = [
        _Box(slot, letter(number), low, high, scale)
        for number, slot in enumerate(layout.slots)
        if slot.bits and slot.first_bit < high and slot.end > low
    ]
    return [
        "".join(f" {number}".ljust(8 * scale) for number in range(first, first + in_row)).rstrip(),
        _border(boxes, style.top, style.line),
        *("".join(style.wall + box.text(line, style) for box in boxes) + style.wall for line in (0, 1)),
        _border(boxes, style.bottom, style.line),
    ]


class _Box:
    """The part of a slot in one row."""

    def __init__(self, slot: PdoSlot, short: str, low: int, high: int, scale: int) -> None:
        self._labels = (short, "") if _narrow(slot, scale) else (slot.address, slot.name)
        self._continued = slot.first_bit < low
        self.room = (min(slot.end, high) - max(slot.first_bit, low)) * scale - 1

    def text(self, line: int, style: Style) -> str:
        """Return its address or letter (line 0) or its name (line 1), cut to the width inside the borders."""
        timing = self._labels[line]
        if self._continued and timing:
            timing = style.dots + timing
        if len(timing) > self.room:
            timing = timing[: self.room - 1].rstrip() + style.dots if self.room > 2 else timing[: self.room]
        return timing.ljust(self.room)


def _border(boxes: list[_Box], corners: str, line: str) -> str:
    left, tee, right = tuple(corners)
    return left + tee.join(line * box.room for box in boxes) + right
