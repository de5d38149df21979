"""The bytes of a node's program from a file: Intel HEX, Motorola S-record, or the file as it is.

A device gets one sequence of bytes (1F50h), without addresses. So the bytes between the records of a file must be known: a gap is
an error unless the user gives the byte for it, usually the value of erased memory (FFh).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from axisbus.errors import UserError
from axisbus.optional_dependencies import require
from axisbus.wording import counted

LARGEST = 1 << 24  # bytes; a few records with distant addresses must not fill the computer's memory
_IHEX_END = 1  # type of the last record
_SREC_ENDS = "789"
_NEW_FILE = "get the file again from its source"


@dataclass(frozen=True, slots=True)
class ProgramImage:
    """The bytes of a program; ``first`` is the address of the first one, None if the file has no addresses.

    ``filled``: the number of bytes that the file does not contain.
    """

    data: bytes = field(repr=False)
    form: str
    first: int | None = None
    filled: int = 0

    def __str__(self) -> str:
        where = "" if self.first is None else f" from address {self.first:X}h"
        filled = f", {self.filled} of them filled in" if self.filled else ""
        return f"{self.form}, {counted(len(self.data), 'byte')}{where}{filled}, CRC-32 {zlib.crc32(self.data):08X}h"


def read_image(
    path: Path, *, raw: bool = False, fill: int | None = None, start: int | None = None
) -> ProgramImage:
    """Read the file of a program; blocks. With ``raw``, its bytes are taken as they are, whatever it contains.

    ``fill``: the byte for gaps between the records; ``start``: the address of the first byte, else the lowest one of the file.

    Raises:
        UserError: the file cannot be read, is empty, damaged, or of an unknown format; it has a gap, or bytes before ``start``; or
            bincopy is not installed.
    """
    content = _bytes_of(path)
    if raw:
        return ProgramImage(content, "binary file")
    form = _form_of(content)
    if form is None:
        raise UserError(
            f"{path} is neither Intel HEX nor S-record",
            observed=f"it begins with {content[:8].hex(' ')}",
            remedy="if the device takes the bytes of this file as they are, add --raw",
        )
    require("bincopy", "reading Intel HEX and S-record needs bincopy", "program")
    pieces = _pieces(path, content.decode("ascii", "replace"), form)
    return _joined(path, pieces, form, fill, start)


def _bytes_of(path: Path) -> bytes:
    try:
        if path.stat().st_size > 8 * LARGEST:  # a HEX file has at most some characters for each byte
            raise _too_large(path, path.stat().st_size)
        content = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise UserError(
            f"{path} cannot be read", observed=getattr(error, "strerror", None) or str(error)
        ) from None
    if not content.strip():
        raise UserError(f"{path} is empty", remedy=_NEW_FILE)
    return content


def _form_of(content: bytes) -> str | None:
    first = content.lstrip()[:2]
    if first[:1] == b":":
        return "Intel HEX"
    return "S-record" if first[:1] == b"S" and first[1:].isdigit() else None


def _pieces(path: Path, text: str, form: str) -> list[tuple[int, bytes]]:
    """Return the data of the records as address and bytes, in the order of the addresses, adjacent ones joined."""
    import bincopy

    unpack, is_end = (
        (bincopy.unpack_ihex, lambda kind: kind == _IHEX_END)
        if form == "Intel HEX"
        else (bincopy.unpack_srec, lambda kind: kind in _SREC_ENDS)
    )
    _check_records(path, text, form, unpack, is_end)
    file = bincopy.BinFile()
    try:
        (file.add_ihex if form == "Intel HEX" else file.add_srec)(text)
    except (bincopy.Error, ValueError) as error:
        raise UserError(
            f"{path} is not a valid {form} file", observed=f"{error} (two records with the same address?)"
        ) from None
    return [(segment.address, bytes(segment.data)) for segment in file.segments]


def _check_records(
    path: Path, text: str, form: str, unpack: Callable[[str], Any], is_end: Callable[[Any], bool]
) -> None:
    """Check each record, and that the last one is the end record: a file that was cut off has none."""
    import bincopy

    ended = 0
    for number, line in _lines(text):
        if ended:
            raise UserError(f"{path}:{number}: there is a record after the end record", remedy=_NEW_FILE)
        try:
            kind = unpack(line)[0]
        except (bincopy.Error, ValueError, IndexError) as error:
            raise UserError(
                f"{path}:{number}: this is not a valid {form} record", observed=str(error), remedy=_NEW_FILE
            ) from None
        ended = number if is_end(kind) else 0
    if not ended:
        raise UserError(f"{path} was cut off: it has no end record", remedy=_NEW_FILE)


def _lines(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip():
            yield number, line.strip()


def _joined(
    path: Path, pieces: list[tuple[int, bytes]], form: str, fill: int | None, start: int | None
) -> ProgramImage:
    if not any(data for _, data in pieces):
        raise UserError(f"{path} contains no data", remedy=_NEW_FILE)
    first, end = pieces[0][0], pieces[-1][0] + len(pieces[-1][1])
    if start is not None and first < start:
        raise UserError(
            f"{path} has data before the address {start:X}h",
            observed=f"its first byte is at {first:X}h",
            remedy="check the address of --start in the device's manual, and whether the file is for this device",
        )
    begin = first if start is None else start
    if end - begin > LARGEST:
        raise _too_large(path, end - begin)
    gaps = [
        (before, after)
        for before, after in pairwise(
            [begin, *(edge for at, data in pieces for edge in (at, at + len(data)))]
        )
    ][::2]
    gaps = [(before, after) for before, after in gaps if after > before]
    filled = sum(after - before for before, after in gaps)
    if gaps and fill is None:
        before, after = gaps[0]
        raise UserError(
            f"{path} has {counted(len(gaps), 'gap')}, {counted(filled, 'byte')} in all",
            observed=f"the first one is from {before:X}h to {after - 1:X}h",
            remedy="give the byte for them: --fill 0xFF, if the manual of the device does not name another one",
        )
    image = bytearray([fill or 0]) * (end - begin)
    for at, data in pieces:
        image[at - begin : at - begin + len(data)] = data
    return ProgramImage(bytes(image), form, begin, filled)


def _too_large(path: Path, size: int) -> UserError:
    return UserError(
        f"{path} is too large for the program of a node",
        observed=f"it has or covers {counted(size, 'byte')}; at most {LARGEST} are accepted",
        remedy="check whether it is the file for this device, and whether it contains records of another memory",
    )
