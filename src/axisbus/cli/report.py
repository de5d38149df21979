"""``axisbus report``: what a report of a fault needs, in one archive, without names of computers and people."""

from __future__ import annotations

import getpass
import io
import json
import platform
import re
import socket
import zipfile
from collections.abc import Iterable
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import click

from axisbus.cell import reader
from axisbus.check.run import check
from axisbus.cli.shared.common import OK, say, say_next
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.core.process.launch import path_of
from axisbus.core.process.persistence import journal
from axisbus.eds import builtin
from axisbus.errors import StateError, UserError
from axisbus.version import __version__
from axisbus.wording import counted

_LARGEST = 16 * 1024 * 1024  # bytes of one file
_FAULTS = 3  # the newest stored ones
_SHORTEST = 3  # letters of a name that is replaced: shorter ones are parts of words
_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest of a ZIP archive: when a file was changed is nobody's business
# The places of serial numbers, each with the text that stays: a cell file, a DCF, 1018h:04 in an EDS or DCF.
_SERIALS = (
    re.compile(r"(?im)^([ \t]*serial[ \t]*=[ \t]*)[^#\r\n]*"),
    re.compile(r"(?im)^([ \t]*LSS_SerialNumber[ \t]*=[ \t]*)[^\r\n]*"),
    re.compile(
        r"(?im)^([ \t]*\[1018sub4\][^\[]*?^[ \t]*(?:ParameterValue|DefaultValue)[ \t]*=[ \t]*)[^\r\n]*"
    ),
)


class ReportItem(NamedTuple):
    """One file of the archive; ``replaced``: how many names and numbers were replaced in it, None: it is not a text."""

    name: str
    data: bytes
    replaced: int | None = None


@click.command("report")
@click.argument("cell", type=PATH)
@click.argument("files", metavar="[FILE]...", nargs=-1, type=PATH)
@output_option("The archive to write.", default=Path("axisbus-report.zip"), show_default=True)
@click.option("--without-eds", is_flag=True, help="Leave out the makers' EDS and DCF files that CELL names.")
@click.option("--yes", is_flag=True, help="Write the archive without asking.")
@force_option
def command(
    cell: Path, files: tuple[Path, ...], output: Path, without_eds: bool, yes: bool, force: bool
) -> int:
    """Collect in one archive what others need to understand a fault: versions, CELL, its EDS, DCF and drive files, the findings of
    axisbus check, the journal of its core, the newest stored faults, and each FILE (a log, a recording).

    Names of this computer, of the user and of the home directory, and serial numbers, are replaced in texts. Recordings are not
    texts: they contain what was on the bus. The contents are listed before anything is written; nothing is sent.

    \b
    axisbus report cell.toml candump.log
    """
    require_free(output, force=force)
    items = [
        _versions(),
        *_of_cell(cell, without_eds),
        *(_read(path, f"files/{path.name}") for path in files),
    ]
    items = [_replaced(item) for item in _with_unique_names(items)]
    width = max(len(item.name) for item in items)
    for item in items:
        result = "not a text: unchanged" if item.replaced is None else f"{item.replaced} replaced"
        say(f"{item.name:<{width}}  {counted(len(item.data), 'byte'):>14}  {result}")
    if not yes and not click.confirm(f"write {output}?", err=True):
        say("nothing was written")
        return OK
    write_whole(output, _archive(items))
    say(f"{counted(len(items), 'file')} written to {output}")
    say_next(f"look into {output} before you attach it to a report: a maker's EDS may not be passed on")
    return OK


def _versions() -> ReportItem:
    """Return the versions of axisbus, of Python, of the system, and of the installed packages that axisbus can use."""
    needed: list[str] = []
    with suppress(metadata.PackageNotFoundError):  # it runs from a folder of sources
        needed = metadata.requires("axisbus") or []
    packages: dict[str, str] = {}
    for name in sorted({re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in needed}):
        with suppress(metadata.PackageNotFoundError):  # an extra that is not installed
            packages[name] = metadata.version(name)
    found = {
        "axisbus": __version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "packages": packages,
    }
    return ReportItem("versions.json", json.dumps(found, indent=2).encode())


def _of_cell(path: Path, without_eds: bool) -> Iterable[ReportItem]:
    """Yield the cell file, its findings, its EDS, DCF and drive files, journal and faults; less if the cell file is faulty."""
    yield _read(path, "cell.toml")
    yield ReportItem("check.txt", "\n".join(map(str, check(path))).encode())
    cell, _ = reader.read(path)
    if cell is None:
        return
    named = {node.file for node in cell.nodes.values() if node.file is not None}
    for file in sorted(named):
        if without_eds or file.startswith(builtin.PREFIX):
            continue
        eds_path = builtin.resolve(file, cell.folder)
        if eds_path.is_file():  # else the findings report it
            yield _read(eds_path, f"eds/{eds_path.name}")
    yield from (_read(file, f"drives/{file.name}") for file in cell.drive_files)
    try:
        log, faults = journal.path_of(path_of(cell)), journal.faults_of(path_of(cell))
    except StateError:  # there is no place where anything could have been stored
        return
    if log.is_file():
        yield _read(log, "journal.log")
    for fault in faults[-_FAULTS:]:
        yield _read(fault, f"faults/{fault.name}")


def _read(path: Path, name: str) -> ReportItem:
    try:
        if path.stat().st_size > _LARGEST:
            raise UserError(
                f"{path} is larger than {_LARGEST >> 20} MB; nothing was written",
                remedy="give a shorter recording (axisbus record export), or send it separately",
            )
        return ReportItem(name, path.read_bytes())
    except OSError as error:
        raise UserError(
            f"{path} cannot be read; nothing was written",
            observed=error.strerror or str(error),
            remedy="give a file that exists and may be read",
        ) from error


def _with_unique_names(items: Iterable[ReportItem]) -> list[ReportItem]:
    """Give files of the same name different names."""
    counts: dict[str, int] = {}
    renamed = []
    for item in items:
        number = counts[item.name] = counts.get(item.name, 0) + 1
        eds_path = Path(item.name)
        name = item.name if number == 1 else str(eds_path.with_stem(f"{eds_path.stem}-{number}").as_posix())
        renamed.append(item._replace(name=name))
    return renamed


def _replaced(item: ReportItem) -> ReportItem:
    """Replace the names of the computer and of the user, and serial numbers, if the file is a text."""
    if b"\0" in item.data:
        return item
    try:
        text, encoding = item.data.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        text, encoding = item.data.decode("latin-1"), "latin-1"
    count = 0
    for pattern, new in _patterns():
        text, number = pattern.subn(new, text)
        count += number
    return ReportItem(item.name, text.encode(encoding), count)


def _patterns() -> list[tuple[re.Pattern[str], str]]:
    """Return what is replaced, and by what: the home directory first, because it contains the name of the user."""
    host = socket.gethostname()
    names = [(host, "HOST"), (host.partition(".")[0], "HOST")]
    with suppress(RuntimeError):  # this user has no home
        names.insert(0, (str(Path.home()), "~"))
    with suppress(OSError, KeyError, ImportError):  # this user has no name
        names.append((getpass.getuser(), "USER"))
    # A name may be a part of a longer one, such as the host in a domain, but not of a word.
    patterns = [
        (re.compile(rf"(?i)(?<![\w]){re.escape(name)}(?![\w])"), new)
        for name, new in names
        if len(name) >= _SHORTEST
    ]
    return [*patterns, *((pattern, r"\g<1>0") for pattern in _SERIALS)]


def _archive(items: Iterable[ReportItem]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for item in items:
            archive.writestr(zipfile.ZipInfo(item.name, _DATE), item.data, zipfile.ZIP_DEFLATED)
    return packed.getvalue()
