"""Read an EDS or DCF: convert bytes to the model.

Theory of operation. Reading a file takes only three quick steps. ``text`` decodes the bytes, splits them into lines and finds the
beginnings of the sections, without losing anything. ``sections`` separates objects, sub-indices and others by the sections' names.
``lazy_objects`` collects the indices. An object is made on first access: then its sections are split into keys, ``build`` makes the
object, with ``values`` for each number and text, and ``compact`` adds the implied parts. A machine uses several tens of a drive's
thousand objects, so most of a file is never parsed. Most sections of a file repeat another one except for the name: ``build``
parses each text once and makes the entries of the others from the first.

No error in a text stops the reading: a part that is not understood is missing in the model and reported in a finding. The findings
need a pass over the whole file, on first access; this pass also makes all objects. These findings are those of the reader itself.
Rules over a whole document are in the package ``rules``; they take the ``EdsParseResult``, which has the lines, the sections and
the model. Only a file that is no EDS at all is an error.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from axisbus.eds import builtin
from axisbus.eds.io import modules, sections, text
from axisbus.eds.io.lazy_objects import FileObjects, node_id
from axisbus.eds.io.text import EdsText
from axisbus.eds.model import Eds
from axisbus.errors import EdsError
from axisbus.wording import counted, files_near

MAX_BYTES = 16 * 1024 * 1024  # twenty times the largest known EDS
MAX_LINES = 1_000_000  # fifty times the largest known number
MAX_SECTIONS = 500_000  # fifty times the largest known number
SUFFIXES = (".eds", ".dcf")

_ANY_SECTION = re.compile(
    r"^[ \t]*\[[ \t]*(?:[0-9a-f]{4}|fileinfo|deviceinfo|mandatoryobjects)\b", re.I | re.M
)
_WHAT_IS_AN_EDS = "an EDS is a text with sections such as [DeviceInfo] and [1000]"


@dataclass(frozen=True, slots=True)
class EdsParseResult:
    """The result of reading one file: its text, its sections by kind, and the model with the findings."""

    document: EdsText
    parts: sections.SectionIndex
    eds: Eds


def load(path: str | Path) -> Eds:
    """Read an EDS or DCF file; the same content is parsed once, however many nodes use it.

    ``path`` may also be a text such as ``builtin:gim6010-8``: one of the files that come with axisbus. Blocks for the time the file
    takes to read. Oddities of the file are in ``findings`` of the result.

    Raises:
        EdsError: the file is missing, cannot be read, is larger than 16 MiB, or is no EDS at all.
    """
    path = builtin.resolve(path, Path()) if isinstance(path, str) else path
    return loads(file_bytes(path), str(path))


def loads(data: bytes, source: str) -> Eds:
    """Read an EDS or DCF from ``data``; ``source`` is the name in messages.

    Raises:
        EdsError: the data is larger than 16 MiB, or is no EDS at all.
    """
    try:
        eds = _parsed(data)
    except EdsError as error:
        raise EdsError(error.message, file=source, observed=error.observed, remedy=error.remedy) from None
    return replace(eds, source=source)


def read(data: bytes, source: str) -> EdsParseResult:
    """Read like ``loads``, and return the document as well, for rules and for writing back; nothing is cached.

    Raises:
        EdsError: the data is larger than 16 MiB, or is no EDS at all.
    """
    _check_size(len(data), source)
    if not data.strip():
        raise EdsError(
            "the file is empty", file=source, remedy="get the file again from the manufacturer of the drive"
        )
    content = text.decode(data)
    if not _ANY_SECTION.search(content.text):
        raise EdsError(
            "this is not an EDS or DCF",
            file=source,
            observed=_looks_like(data),
            remedy=f"give an EDS; {_WHAT_IS_AN_EDS}",
        )
    size = len(content.text)  # a text shorter than the limits needs no counting
    if size > MAX_LINES and max(content.text.count("\n"), content.text.count("\r")) > MAX_LINES:
        raise EdsError(
            "the file has too many lines for an EDS", file=source, observed=f"more than {MAX_LINES} lines",
            remedy=f"give an EDS; {_WHAT_IS_AN_EDS}",
        )  # fmt: skip
    if size > MAX_SECTIONS and content.text.count("[") > MAX_SECTIONS:
        raise EdsError(
            "the file has too many sections for an EDS", file=source, observed=f"more than {MAX_SECTIONS} brackets",
            remedy=f"give an EDS; {_WHAT_IS_AN_EDS}",
        )  # fmt: skip
    return read_document(text.parse(content), source)


def read_document(document: EdsText, source: str) -> EdsParseResult:
    """Return the parse result of a document, such as one that ``edit`` changed.

    Raises:
        EdsError: it describes no object.
    """
    parts = sections.sort(document.sections)
    objects = FileObjects(document, parts)
    if not objects:
        raise EdsError(
            "the file describes no object", file=source,
            observed=f"{counted(len(document.sections), 'section')}, none of an object",
            remedy=f"get the file again from the manufacturer of the drive; {_WHAT_IS_AN_EDS}",
        )  # fmt: skip
    eds = Eds(
        source,
        objects,
        parts.info,
        node_id(document),
        modules.modules(document),
        modules.connected(document),
        modules.dynamic_channels(document),
        _diagnose=objects.findings,
    )
    return EdsParseResult(document, parts, eds)


@lru_cache(maxsize=64)
def _parsed(data: bytes) -> Eds:
    return read(data, "").eds


def file_bytes(path: Path) -> bytes:
    """Return the content of a file that may be an EDS.

    Raises:
        EdsError: it is missing, no file, larger than 16 MiB, or cannot be read; the remedy names files of the folder.
    """
    try:
        if path.is_dir():
            raise EdsError(
                "this is a folder, not a file",
                file=str(path),
                remedy=_suggestion(path, "") or "name a file in it",
            )
        if path.exists() and not path.is_file():
            raise EdsError("this is not a regular file", file=str(path), remedy="give an EDS or DCF file")
        _check_size(path.stat().st_size, str(path))
        return path.read_bytes()
    except FileNotFoundError:
        remedy = (
            _suggestion(path.parent, path.name) or f"check the path: there is no EDS or DCF in {path.parent}"
        )
        raise EdsError("the file does not exist", file=str(path), remedy=remedy) from None
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise EdsError(
            "the file cannot be read",
            file=str(path),
            observed=str(error),
            remedy="check the path and its permissions",
        ) from error


def _check_size(size: int, source: str) -> None:
    if size > MAX_BYTES:
        raise EdsError(
            f"the file is too large for an EDS: {size / 2**20:.0f} MiB",
            file=source,
            remedy=f"give an EDS, of at most {MAX_BYTES >> 20} MiB; {_WHAT_IS_AN_EDS}",
        )


def _suggestion(folder: Path, name: str) -> str:
    return files_near(folder, name, lambda path: path.suffix.lower() in SUFFIXES)


_KINDS = (
    (b"\x89PNG", "a PNG picture"),
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"<?xml", "an XML file (an XDD or XDC is another format)"),
    (b"\x7fELF", "a program"),
    (b"\x1f\x8b", "a gzip archive"),
)


def _looks_like(data: bytes) -> str:
    start = data.lstrip(b"\xef\xbb\xbf \t\r\n")
    for mark, kind in _KINDS:
        if start.startswith(mark):
            return f"it looks like {kind}"
    if b"\0" in data[:4096]:
        return "it holds binary data"
    first = start[:60].decode("ascii", errors="replace").splitlines()
    return f"it begins with {first[0]!r}" if first else "it holds nothing to read"
