"""Make a cell file with another ``[bus]``: the server of its simulated drives."""

from __future__ import annotations

import re

from axisbus.errors import UserError

_HEADER = re.compile(r"\s*\[+\s*([^\[\]]+?)\s*\]+")
_REPLACED = re.compile(r"\s*(interface|channel|options)\b")


def with_bus(source: str, lines: list[str]) -> str:
    """Return the text of a cell file with ``lines`` in its ``[bus]``, in place of its interface, channel and options.

    Raises:
        UserError: the file has no line ``[bus]``.
    """
    kept: list[str] = []
    table, found = "", False
    for line in source.splitlines():
        header = _HEADER.match(line)
        if header is not None:
            table = header[1].replace(" ", "")
        if table == "bus" and header is not None:
            kept += [line, *lines]
            found = True
        elif table != "bus.options" and not (table == "bus" and _REPLACED.match(line)):
            kept.append(line)
    if not found:
        raise UserError(
            "the cell file has no line [bus], so its bus cannot be replaced",
            remedy="write it as a table: [bus]",
        )
    return "\n".join(kept) + "\n"
