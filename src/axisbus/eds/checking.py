"""Checking an EDS or DCF by the rules of CiA DS 306, CiA 301 and CiA 402, from Python."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from axisbus.eds.io import reader
from axisbus.eds.io.lazy_objects import FileObjects
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.model import Eds, EdsFinding
from axisbus.errors import ArgumentError


def check(
    what: Eds | EdsParseResult | str | Path,
    *,
    select: str | Iterable[str] = (),
    ignore: str | Iterable[str] = (),
) -> tuple[EdsFinding, ...]:
    """Return all errors and oddities of a file, in the order of its lines.

    ``what`` is a path, or the result of ``load``, ``loads`` or ``reader.read``. ``select`` and ``ignore`` take ids of rules
    (``"V003"``) and their beginnings (``"V"``), one or several. Without ``select`` all rules apply. If both match a rule, the
    longer text decides. Lines and columns count from 1; 0 means the whole file.

    Blocks for the time the file takes to read and check, about 40 ms for 150 kB. No bus is used, nothing is written.

    Raises:
        EdsError: the file is missing, cannot be read, or is no EDS at all.
        ArgumentError: no rule's id begins with a given text, or the ``Eds`` was not read from a file's text.
    """
    from axisbus.eds.rules import (  # importing the rules takes as long as importing the rest of the reader
        engine,
        table,
    )

    return engine.check(reading(what), table.chooser(select, ignore))


def reading(what: Eds | EdsParseResult | str | Path) -> EdsParseResult:
    """Return the parse result of a path, or of a file that is already read; raises like ``check``."""
    if isinstance(what, EdsParseResult):
        return what
    eds = what if isinstance(what, Eds) else reader.load(what)
    if not isinstance(eds.objects, FileObjects):
        raise ArgumentError(
            "this dictionary has no text to check", remedy="write it, and check what load() returns"
        )
    return EdsParseResult(eds.objects.document, eds.objects.parts, eds)
