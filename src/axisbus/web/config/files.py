"""The DCFs of the pages: the file that each has uploaded, and the last backup made for it; bounded, and only in memory.

``python -m axisbus.web.config.files NAME`` reads a DCF from standard input and writes its description as JSON. The server runs this
as a process of low priority, because parsing a large file must not delay the jog of another page.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass

from axisbus.configuration import preconditions
from axisbus.eds.io import reader
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, EdsError, StateError, one_line
from axisbus.web.access import limits
from axisbus.web.view.axes import Values, explained
from axisbus.wording import counted

MOST = limits.FILE  # bytes of one file
MOST_ENTRIES = 100_000  # several times the number of the largest device
BROUGHT, MADE = "brought", "made"
_LONGEST = 80  # characters of a file name
_PATIENCE = 20.0  # seconds that reading a file may take
_NICE = 15
_UNFIT = re.compile(r"[^\w.() +-]")


@dataclass(frozen=True, slots=True)
class Dcf:
    """A file: its name, safe to show and to save, and its contents."""

    name: str
    data: bytes

    def reading(self) -> EdsParseResult:
        """Parse the file; may take a second.

        Raises:
            EdsError: the file is not an EDS or DCF, or describes more entries than any device has.
        """
        found, entries = reader.read(self.data, self.name), 0
        for each in found.eds:  # a few lines of a file may define thousands of entries
            entries += len(each.subs)
            if entries > MOST_ENTRIES:
                raise EdsError(
                    "the file has more entries than any device",
                    file=self.name,
                    observed=f"more than {MOST_ENTRIES}",
                    remedy="give the DCF of a device",
                )
        return found


class PageFiles:
    """Hold at most two files of each page; used by one thread."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, str], Dcf] = {}

    def keep(self, page: int, which: str, file: Dcf) -> None:
        """Store a file of a page in place of the previous one; a file larger than ``MOST`` is not stored."""
        self._kept.pop((page, which), None)
        if len(file.data) <= MOST:
            self._kept[page, which] = file

    def of(self, page: int, which: str) -> Dcf | None:
        """Return a file of a page; None if there is none."""
        return self._kept.get((page, which))

    def leave(self, page: int) -> None:
        """Remove the files of a closed page."""
        for which in (BROUGHT, MADE):
            self._kept.pop((page, which), None)


def named(text: str) -> str:
    """Return a file name that is safe to show and to save: without folders and unusual characters."""
    last = re.split(r"[\\/]", text)[-1]
    return _UNFIT.sub("_", last)[:_LONGEST].strip(" .") or "file.dcf"


def about(file: Dcf) -> Values:
    """Return the description of a file, or why it is invalid; may take a second."""
    try:
        eds = file.reading().eds
    except AxisbusError as error:
        return {"name": file.name, "text": "", "error": explained(error)}
    return {"name": file.name, "text": _what(eds), "error": None}


def about_apart(file: Dcf) -> Values:
    """Run ``about`` in a process of its own; blocks for at most 20 s."""
    command = [sys.executable, "-m", __name__, file.name]
    try:
        with subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ) as reading:  # Ctrl-C in the terminal must only end the server
            try:
                _let_wait(reading.pid)
                read, _ = reading.communicate(file.data, _PATIENCE)
            finally:
                reading.kill()
        told: Values = json.loads(read)
    except (OSError, ValueError, subprocess.TimeoutExpired) as error:
        unread = StateError(
            f"{file.name} could not be read", observed=one_line(error), remedy="choose it again"
        )
        return {"name": file.name, "text": "", "error": explained(unread)}
    return told


def _let_wait(process: int) -> None:
    """Lower the priority of a process as it starts, because starting it takes longer than parsing."""
    if hasattr(os, "setpriority"):
        os.setpriority(os.PRIO_PROCESS, process, _NICE)


def _what(eds: Eds) -> str:
    said = preconditions.identity_of(eds)
    numbers = (("vendor", said.vendor_id), ("product", said.product_code), ("serial", said.serial))
    known = [f"{title} 0x{number:X}" for title, number in numbers if number]
    given = sum(sub.parameter_value is not None for entry in eds for sub in entry.subs.values())
    of = "no particular node" if said.node_id is None else f"node {said.node_id}"
    return ", ".join((f"of {of}", *known, counted(given, "value")))


def main() -> None:
    """Read one file, and print its description."""
    sys.stdout.write(json.dumps(about(Dcf(sys.argv[1], sys.stdin.buffer.read()))))


if __name__ == "__main__":
    main()
