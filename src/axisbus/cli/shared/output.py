"""Output files: whether one can be written is found out first, its folder is made, and it is written whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from axisbus.errors import UserError

_F = TypeVar("_F", bound=Callable[..., Any])


def output_option(text: str, **more: Any) -> Callable[[_F], _F]:
    """Add ``-o``, the file that a command writes."""
    return click.option("-o", "--output", type=click.Path(path_type=Path), help=text, **more)


def require_writable(*paths: Path | None) -> None:
    """Check before any work that files can be written, and that no two are the same one; None is none.

    A folder that is not there yet must be one that can be made. Nothing is left behind.

    Raises:
        UserError: one cannot.
    """
    given = [path for path in paths if path is not None]
    for number, path in enumerate(given):
        try:
            _try(path)
        except OSError as error:
            raise _cannot(path, error) from error
        if any(os.path.realpath(path) == os.path.realpath(other) for other in given[:number]):
            raise UserError(f"{path} is named for two files; nothing was written", remedy="give two names")


def require_free(*paths: Path | None, force: bool) -> None:
    """As ``require_writable``; in addition none of them may be there yet, unless ``force`` is given.

    Raises:
        UserError: one is, or cannot be written.
    """
    require_writable(*paths)
    for path in paths:
        if path is not None and not force and os.path.lexists(path):
            raise UserError(
                f"{path} is there already; nothing was written",
                remedy="give another name with -o, or --force to replace it",
            )


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is either the old one or the new one, never half of it; a link stays, and so do permissions.

    Its folder is made where it is not there yet. A device or a pipe is written to as it is.

    Raises:
        UserError: it cannot be written; then nothing has changed.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if _is_special(path):
            path.write_bytes(data)
        else:
            _replace(Path(os.path.realpath(path)), data)
    except OSError as error:
        raise _cannot(path, error) from error


def _replace(target: Path, data: bytes) -> None:
    beside = _beside(target.parent)
    try:
        with beside.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if target.exists():
            shutil.copymode(target, beside)
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)


def _try(path: Path) -> None:
    if path.is_dir():
        raise IsADirectoryError("it is a folder")
    if _is_special(path):
        return
    target = Path(os.path.realpath(path))
    folder = next(each for each in target.parents if os.path.lexists(each))
    if not folder.is_dir():
        raise NotADirectoryError(f"{folder} is no folder")
    target.exists()  # a name that is too long is told by this
    probe = _beside(folder)
    probe.touch(exist_ok=False)
    probe.unlink()


def _beside(folder: Path) -> Path:
    """Return a name of our own in a folder: a killed run may have left one, and the name of the file may have no room for more."""
    return folder / f".axisbus-{os.urandom(6).hex()}.new"


def _is_special(path: Path) -> bool:
    return path.exists() and not path.is_file()


def _cannot(path: Path, error: OSError) -> UserError:
    why = f"[Errno {error.errno}] {error.strerror}" if error.errno is not None else str(error)
    return UserError(f"{path} cannot be written", observed=why, remedy="give another path with -o")
