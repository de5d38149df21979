"""Output files: checked before any work, folders are made, and each file is written completely or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from axisbus.cli.shared.common import say, say_next
from axisbus.cli.shared.options import PATH
from axisbus.errors import UserError

_F = TypeVar("_F", bound=Callable[..., Any])


def output_option(text: str, **more: Any) -> Callable[[_F], _F]:
    """Add ``-o``, the file that a command writes."""
    return click.option("-o", "--output", type=PATH, help=text, **more)


picture_option = output_option("Image file to write, .png or .svg; by default none is drawn.")


def concise_option(text: str) -> Callable[[_F], _F]:
    """Add ``--concise``, the concise DCF that a command writes."""
    return click.option("--concise", "concise_out", type=PATH, help=text)


# Without it no existing file is replaced (see ``require_free``).
force_option = click.option("--force", is_flag=True, help="Replace an existing file.")


def require_writable(output: Path | None, concise: Path | None = None) -> None:
    """Check before any work that the files of ``-o`` and ``--concise`` are writable and different; None: no file.

    It must be possible to make a missing folder. The check leaves nothing behind.

    Raises:
        UserError: a file cannot be written.
    """
    for path, option in _given(output, concise):
        try:
            _require_writable(path)
        except OSError as error:
            raise _cannot(path, error, option) from error
    if output is not None and concise is not None and os.path.realpath(output) == os.path.realpath(concise):
        raise UserError(f"{concise} is given for two files; nothing was written", remedy="give two names")


def require_free(output: Path | None, concise: Path | None = None, *, force: bool) -> None:
    """As ``require_writable``; in addition neither file may exist, unless ``force`` is given.

    A device or a pipe may exist: it is not replaced.

    Raises:
        UserError: a file exists, or cannot be written.
    """
    require_writable(output, concise)
    for path, option in _given(output, concise):
        if not force and os.path.lexists(path) and not _is_special(path):
            raise UserError(
                f"{path} already exists; nothing was written",
                remedy=f"give another name with {option}, or --force to replace it",
            )


def _given(output: Path | None, concise: Path | None) -> list[tuple[Path, str]]:
    return [(path, option) for path, option in ((output, "-o"), (concise, "--concise")) if path is not None]


def write_whole(path: Path, data: bytes) -> None:
    """Write a file atomically: it has either the old or the new contents; a symbolic link and the permissions remain.

    A missing folder is made. A device or a pipe is written directly.

    Raises:
        UserError: the file cannot be written; then nothing has changed.
    """
    write_file(path, lambda file: file.write_bytes(data))


def write_file(path: Path, write: Callable[[Path], object]) -> None:
    """As ``write_whole``, for contents that ``write`` writes into the file of a given path, which has the suffix of ``path``.

    Raises:
        UserError: the file cannot be written. The errors of ``write``. Then nothing has changed.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if _is_special(path):
            write(path)
        else:
            _replace(Path(os.path.realpath(path)), write, path.suffix)
    except OSError as error:
        raise _cannot(path, error) from error


def _replace(target: Path, write: Callable[[Path], object], suffix: str) -> None:
    temporary = _temporary_path(target.parent, suffix)
    try:
        write(temporary)
        with temporary.open("ab") as file:
            os.fsync(file.fileno())
        if target.exists():
            shutil.copymode(target, temporary)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def _require_writable(path: Path) -> None:
    if path.is_dir():
        raise IsADirectoryError("it is a folder")
    if _is_special(path):
        return
    target = Path(os.path.realpath(path))
    folder = next(each for each in target.parents if os.path.lexists(each))
    if not folder.is_dir():
        raise NotADirectoryError(f"{folder} is not a folder")
    target.exists()  # fails if the name is too long
    probe = _temporary_path(folder)
    probe.touch(exist_ok=False)
    probe.unlink()


def _temporary_path(folder: Path, suffix: str = "") -> Path:
    """Return an unused temporary name in a folder: a killed run may have left one, and the file's name may be too long."""
    return folder / f".axisbus-{os.urandom(6).hex()}.new{suffix}"


def _is_special(path: Path) -> bool:
    return path.exists() and not path.is_file()


def _cannot(path: Path, error: OSError, option: str = "-o") -> UserError:
    why = f"[Errno {error.errno}] {error.strerror}" if error.errno is not None else str(error)
    return UserError(f"{path} cannot be written", observed=why, remedy=f"give another path with {option}")


def write_and_say(path: Path, data: bytes, what: str, next_step: str) -> None:
    """Write a file as ``write_whole``, and say ``what`` it has, and the next step."""
    write_whole(path, data)
    say(f"{path}: {what}")
    say_next(next_step)
