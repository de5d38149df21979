"""Rows of the documentation's tables: messages, error bits and contradictions, as text cells."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.fields import MessageField
from axisbus.drives.gim6010.can_simple.messages import MESSAGES, Message
from kit.can_simple.discrepancies import NOTES

Row = tuple[str, ...]


def messages() -> Iterator[Row]:
    """Yield for each message: ID, name, sender of its data, fields to the module, fields from it, and its meaning."""
    for each in MESSAGES:
        command = f"{each.command:02X}h"
        yield (
            command,
            f"`{each.name}`",
            direction(each),
            _fields(each.sent),
            _fields(each.answer),
            each.meaning,
        )


def direction(message: Message) -> str:
    """Return the direction of a message's data; a request without data does not count."""
    if not message.answer:
        return "to the module"
    return "both ways" if message.sent else "from the module"


def error_bits() -> Iterator[Row]:
    """Yield for each bit: category, bit, name, meaning, remedy."""
    for each in faults.FAULTS:
        compare = f"; compare `{each.parameter}`" if each.parameter else ""
        yield (each.category, f"{each.bits:08X}h", f"`{each.name}`", each.meaning, f"{each.remedy}{compare}")


def contradictions() -> Iterator[Row]:
    """Yield for each contradiction: subject, the manual's statement, the owners' reports, accepted data, sent data."""
    for each in NOTES:
        yield (each.subject, each.manual, each.field, each.taken, each.sent)


def table(header: Row, rows: Iterable[Row]) -> str:
    """Return a table in Markdown."""
    lines = [header, tuple("---" for _ in header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _fields(fields: Iterable[MessageField]) -> str:
    return "; ".join(map(_field, fields)) or "none"


def _field(field: MessageField) -> str:
    unit = f"{1 / field.per_unit:g} {field.unit}" if field.per_unit != 1 else field.unit
    facts = (field.type.name, _place(field), unit, field.side.value)
    return f"{field.name} ({', '.join(filter(None, facts))})"


def _place(field: MessageField) -> str:
    byte, bit = divmod(field.start, 8)
    whole = not bit and field.type.bits % 8 == 0
    if whole:
        return f"byte {byte}"
    return f"bits {field.start} to {field.end - 1}" if field.type.high_first else f"byte {byte} bit {bit}"
