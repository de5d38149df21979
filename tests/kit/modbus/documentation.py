"""Rows of the documentation's tables about Modbus: registers and open points, as text cells."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.drives.gim6010.modbus.registers import REGISTERS, Register
from kit.modbus.open_points import NOTES

Row = tuple[str, ...]
_ACCESS = {"r": "read", "w": "write", "rw": "read, write"}


def registers() -> Iterator[Row]:
    """Yield for each value: addresses, name, bank, access, type, unit with its side of the gear, description."""
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
    """Yield for each open point: subject, the manual's statement, the solution used."""
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
