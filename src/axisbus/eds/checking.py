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
    """Return everything that is wrong or odd in a file, in the order of its lines.

    ``what`` is a path, or what ``load``, ``loads`` or ``reader.read`` returned. ``select`` and ``ignore`` take ids of rules
    (``"V003"``) and their beginnings (``"V"``), one or several; without ``select`` all rules are meant, and the longer text wins
    where both speak of a rule. Lines and columns count from 1, 0 stands for the whole file.

    Blocks for the time the file takes to read and check, some 40 ms for 150 kB. No bus is used, nothing is written.

    Raises:
        EdsError: the file is missing, cannot be read, or is no EDS at all.
        ArgumentError: no rule's id begins so, or the ``Eds`` was not read from a file's text.
    """
    from axisbus.eds.rules import (  # the rules take as long to import as all the rest of reading
        engine,
        rule_selection,
    )

    return engine.check(reading(what), rule_selection.chooser(select, ignore))


def reading(what: Eds | EdsParseResult | str | Path) -> EdsParseResult:
    """Return what a file says with its text: of a path, or of what was read already; raises like ``check``."""
    if isinstance(what, EdsParseResult):
        return what
    eds = what if isinstance(what, Eds) else reader.load(what)
    if not isinstance(eds.objects, FileObjects):
        raise ArgumentError(
            "this dictionary has no text to check", remedy="write it, and check what load() returns"
        )
    return EdsParseResult(eds.objects.document, eds.objects.parts, eds)
