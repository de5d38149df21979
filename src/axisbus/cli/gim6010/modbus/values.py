"""Parse and format values of registers and parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from axisbus.errors import ArgumentError

if TYPE_CHECKING:
    from axisbus.drives.gim6010.can_simple.fields import Number
    from axisbus.drives.gim6010.modbus.registers import Register


def is_parameter(name: str) -> bool:
    """Whether a name is a parameter of the list of endpoints: these have a point, except a few of the first level."""
    from axisbus.drives.gim6010.modbus.registers import BY_NAME

    return "." in name or name not in BY_NAME


def pair(text: str) -> tuple[str, str]:
    """Return NAME and VALUE of ``NAME=VALUE``.

    Raises:
        UsageError: the text has another form.
    """
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise click.UsageError(f"{text!r}: write NAME=VALUE")
    return name.strip(), value.strip()


def parse(register: Register, text: str) -> Number:
    """Return a text as a value of the register's type.

    Raises:
        ArgumentError: the text is not such a value.
    """
    found: Number | None
    try:
        found = float(text) if register.field.type.name == "float32" else int(text, 0)
    except ValueError:
        found = None
    if found is None or not math.isfinite(found):
        raise ArgumentError(
            f"{register.name}: {text!r} is not a value of type {register.field.type.name} that can be written"
        )
    return found


def show(register: Register, value: Number) -> str:
    """Return a value as text with its meaning, its unit and its side of the gear."""
    field = register.field
    number = f"{value:.7g}" if isinstance(value, float) else str(value)
    words = field.values.get(int(value)) if field.values and math.isfinite(value) else None
    side = f" ({field.side.value})" if field.side.value else ""
    return " ".join(filter(None, (number, words and f"({words})", field.unit))) + side
