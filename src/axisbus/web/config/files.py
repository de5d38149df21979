"""The DCFs of the pages: the one that each has brought, and the last backup made for it; in memory alone, and bounded."""

from __future__ import annotations

import re
from dataclasses import dataclass

from axisbus.configuration import preconditions
from axisbus.eds.io import reader
from axisbus.eds.io.reader import Reading
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, EdsError
from axisbus.web.gate import limits
from axisbus.web.view.axes import Values, explained
from axisbus.wording import counted

MOST = limits.FILE  # bytes of one
MOST_ENTRIES = 100_000  # several times as many as the largest device has
BROUGHT, MADE = "brought", "made"
_LONGEST = 80  # characters of a name
_UNFIT = re.compile(r"[^\w.() +-]")


@dataclass(frozen=True, slots=True)
class Dcf:
    """A file: its name, fit to be shown and saved, and what is in it."""

    name: str
    data: bytes

    def reading(self) -> Reading:
        """Parse it; may take a second.

        Raises:
            EdsError: it is none, or describes more than any device has.
        """
        found, entries = reader.read(self.data, self.name), 0
        for each in found.eds:  # a few lines of a file may stand for thousands of entries
            entries += len(each.subs)
            if entries > MOST_ENTRIES:
                raise EdsError(
                    "the file has more entries than any device",
                    file=self.name,
                    observed=f"more than {MOST_ENTRIES}",
                    remedy="give the DCF of a device",
                )
        return found


class Files:
    """Holds two files of each page at most; used by one thread."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, str], Dcf] = {}

    def keep(self, page: int, which: str, file: Dcf) -> None:
        """Keep a file of a page, in the place of the one before; none that is larger than ``MOST``."""
        self._kept.pop((page, which), None)
        if len(file.data) <= MOST:
            self._kept[page, which] = file

    def of(self, page: int, which: str) -> Dcf | None:
        """Return a file of a page; None where there is none."""
        return self._kept.get((page, which))

    def leave(self, page: int) -> None:
        """A page is gone, and its files with it."""
        for which in (BROUGHT, MADE):
            self._kept.pop((page, which), None)


def named(text: str) -> str:
    """Return the name of a file as it may be shown and saved: without folders, and without what no name needs."""
    last = re.split(r"[\\/]", text)[-1]
    return _UNFIT.sub("_", last)[:_LONGEST].strip(" .") or "file.dcf"


def about(file: Dcf) -> Values:
    """Return what a file is of, or why it is none; may take a second."""
    try:
        eds = file.reading().eds
    except AxisbusError as error:
        return {"name": file.name, "text": "", "error": explained(error)}
    return {"name": file.name, "text": _what(eds), "error": None}


def _what(eds: Eds) -> str:
    said = preconditions.identity_of(eds)
    numbers = (("vendor", said.vendor_id), ("product", said.product_code), ("serial", said.serial))
    known = [f"{title} 0x{number:X}" for title, number in numbers if number]
    given = sum(sub.parameter_value is not None for entry in eds for sub in entry.subs.values())
    of = "no node in particular" if said.node_id is None else f"node {said.node_id}"
    return ", ".join((f"of {of}", *known, counted(given, "value")))
