"""The rows of the pages' tables about Modbus: registers and open points, as cells of text."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.drives.gim6010.modbus.open_points import NOTES
from axisbus.drives.gim6010.modbus.registers import REGISTERS, Register

Row = tuple[str, ...]
_ACCESS = {"r": "read", "w": "write", "rw": "read, write"}


def registers() -> Iterator[Row]:
    """Yield for each value: addresses, name, bank, access, type, unit with its side, what it is."""
    for each in REGISTERS:
        unit = ", ".join(filter(None, (each.field.unit, each.field.side.value)))
        yield (
            _addresses(each),
            f"`{each.name}`",
            each.bank.name.lower(),
            _ACCESS[each.access],
            each.field.type.name,
            unit or "none",
            _is(each),
        )


def open_points() -> Iterator[Row]:
    """Yield for each open point: subject, what the manual says, what is done."""
    for each in NOTES:
        yield (each.subject, each.said, each.done)


def _addresses(register: Register) -> str:
    last = register.address + register.count - 1
    return f"{register.address:02X}h" + (f" to {last:02X}h" if register.count > 1 else "")


def _is(register: Register) -> str:
    listed = ", ".join(f"{value} {words}" for value, words in register.field.values.items())
    return "; ".join(
        filter(None, (register.title.replace("—", "-"), register.kind.value, listed, register.note))
    )
