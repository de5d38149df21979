"""The DCFs of the pages: the file that each has uploaded, and the last backup made for it; bounded, and only in memory."""

from __future__ import annotations

import re
from dataclasses import dataclass

from axisbus.configuration import preconditions
from axisbus.eds.io import reader
from axisbus.eds.io.reader import EdsParseResult
from axisbus.errors import EdsError
from axisbus.web.access import limits
from axisbus.wording import counted

MAX_SIZE = limits.FILE  # bytes of one file
MAX_ENTRIES = 100_000  # several times the number of the largest device
UPLOADED, BACKED_UP = "brought", "made"
_LONGEST = 80  # characters of a file name
_SHORT = 128 * 1024  # bytes of a file that is parsed in some hundredths of a second
_MAX_SECTIONS = 2500  # sections of such a file: each takes time, even an empty one
_NOT_IN_FILE_NAMES = re.compile(r"[^\w.() +-]")


@dataclass(frozen=True, slots=True)
class Dcf:
    """A file: its name, safe to show and to save, and its contents."""

    name: str
    data: bytes

    @property
    def is_short(self) -> bool:
        """Whether it is parsed so fast that no page notices: it is small, has few sections, and no line defines many entries."""
        compact = (
            b"compact" in self.data.replace(b"\0", b"").lower()
        )  # CompactSubObj, CompactPDO; \0: in UTF-16
        return len(self.data) <= _SHORT and self.data.count(b"[") <= _MAX_SECTIONS and not compact

    def reading(self) -> EdsParseResult:
        """Parse the file; may take a second.

        Raises:
            EdsError: the file is not an EDS or DCF, or describes more entries than any device has.
        """
        found, entries = reader.read(self.data, self.name), 0
        for each in found.eds:  # a few lines of a file may define thousands of entries
            entries += len(each.subs)
            if entries > MAX_ENTRIES:
                raise EdsError(
                    "the file has more entries than any device",
                    file=self.name,
                    observed=f"more than {MAX_ENTRIES}",
                    remedy="give the DCF of a device",
                )
        return found


class PageFiles:
    """Hold at most two files of each page; used by one thread."""

    def __init__(self) -> None:
        self._files: dict[tuple[int, str], Dcf] = {}

    def store(self, page: int, which: str, file: Dcf) -> None:
        """Store a file of a page in place of the previous one; a file larger than ``MAX_SIZE`` is not stored."""
        self._files.pop((page, which), None)
        if len(file.data) <= MAX_SIZE:
            self._files[page, which] = file

    def of(self, page: int, which: str) -> Dcf | None:
        """Return a file of a page; None if there is none."""
        return self._files.get((page, which))

    def remove_page(self, page: int) -> None:
        """Remove the files of a closed page."""
        for which in (UPLOADED, BACKED_UP):
            self._files.pop((page, which), None)


def named(text: str) -> str:
    """Return a file name that is safe to show and to save: without folders and unusual characters."""
    last = re.split(r"[\\/]", text)[-1]
    return _NOT_IN_FILE_NAMES.sub("_", last)[:_LONGEST].strip(" .") or "file.dcf"


def summary(file: Dcf) -> str:
    """Return the description of a file; may take a second.

    Raises:
        EdsError: as ``Dcf.reading``.
    """
    eds = file.reading().eds
    identity = preconditions.identity_of(eds)
    numbers = (
        ("vendor", identity.vendor_id),
        ("product", identity.product_code),
        ("serial", identity.serial),
    )
    known = [f"{title} 0x{number:X}" for title, number in numbers if number]
    given = sum(sub.parameter_value is not None for entry in eds for sub in entry.subs.values())
    of = "no particular node" if identity.node_id is None else f"node {identity.node_id}"
    return ", ".join((f"of {of}", *known, counted(given, "value")))
