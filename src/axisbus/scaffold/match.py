"""Find the EDS file of a device by its identity; pure, except for reading the files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from axisbus.drives import registry
from axisbus.eds import builtin, load
from axisbus.eds.model import Eds
from axisbus.errors import EdsError, UserError

_SUFFIXES = (".eds", ".dcf")
_MOST = 5000  # files in all folders: more indicate a mistyped folder


@dataclass(frozen=True, slots=True)
class CandidateFile:
    """A file that may describe a device; ``spec`` is its name in a cell file (a path, or ``builtin:NAME``)."""

    spec: str
    eds: Eds


@dataclass(frozen=True, slots=True)
class FileMatch:
    """The files for one device; a single file is used, of several the user must choose. ``exact``: the revision matches."""

    files: tuple[CandidateFile, ...]
    exact: bool
    note: str = ""

    @property
    def chosen(self) -> CandidateFile | None:
        """The file to use, None if there is none or the user must choose."""
        return self.files[0] if len(self.files) == 1 else None


def collect(folders: Iterable[Path]) -> tuple[list[CandidateFile], list[str]]:
    """Read each EDS and DCF in these folders and below, the built-in ones, and those of the drive plug-ins.

    Return the files and the errors of unreadable ones.

    Raises:
        UserError: a path is neither a folder nor a file, or holds too many files.
    """
    found = [
        CandidateFile(f"{builtin.PREFIX}{name}", load(builtin.PREFIX + name)) for name in builtin.names()
    ]
    problems: list[str] = []
    of_plugins = [Path(file) for plugin in registry.plugins() for file in plugin.eds_files]
    for path in (*_files(folders), *of_plugins):
        try:
            found.append(CandidateFile(str(path), load(path)))
        except EdsError as error:
            problems.append(str(error).splitlines()[0])
    return found, problems


def _files(folders: Iterable[Path]) -> list[Path]:
    files: list[Path] = []
    for folder in folders:
        if folder.is_file():
            files.append(folder)
            continue
        if not folder.is_dir():
            raise UserError(
                f"{folder} is neither a folder nor a file", remedy="give --eds a folder of EDS files"
            )
        files += sorted(path for path in folder.rglob("*") if path.suffix.lower() in _SUFFIXES)
        if len(files) > _MOST:
            raise UserError(
                f"{folder} contains more than {_MOST} EDS files",
                remedy="give the folder of this machine's files",
            )
    return files


def match(
    known: Iterable[CandidateFile],
    node_id: int,
    vendor_id: int | None,
    product_code: int | None,
    revision: int | None,
) -> FileMatch:
    """Return the files of this vendor and product: with this revision, else with any; a DCF only if it is made for this node.

    A file without a vendor ID describes no particular device and is never used. A file without a product code is only used if no
    file of the vendor has the device's code. Of equal files the first one is used.
    """
    if not vendor_id:
        return FileMatch((), exact=False, note="the device reports no vendor ID (1018h:01)")
    ours = [
        each
        for each in known
        if each.eds.identity.vendor_id == vendor_id and each.eds.node_id in (None, node_id)
    ]
    same = [each for each in ours if each.eds.identity.product_code == (product_code or None)]
    if product_code and not same:
        same = [each for each in ours if each.eds.identity.product_code is None]
    exact = [each for each in same if each.eds.identity.revision == (revision or None)]
    files = _unequal(exact or same)
    if not files:
        return FileMatch(
            (), exact=False, note=f"no file of vendor 0x{vendor_id:X}, product 0x{product_code or 0:X}"
        )
    note = "" if exact else f"the device has revision 0x{revision or 0:X}"
    return FileMatch(tuple(files), bool(exact), note)


def _unequal(files: list[CandidateFile]) -> list[CandidateFile]:
    """Return the files without later ones that equal an earlier one in FileName, FileRevision, object count and node-ID."""
    seen: dict[tuple[object, ...], CandidateFile] = {}
    for each in files:
        info = each.eds.info.get("fileinfo", {})
        seen.setdefault(
            (info.get("filename"), info.get("filerevision"), len(each.eds.objects), each.eds.node_id), each
        )
    return list(seen.values())
