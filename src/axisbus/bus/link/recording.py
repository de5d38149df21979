"""Frames from a file: candump text by our own reader, everything else by python-can's (asc, blf, csv, db, mf4, trc, ...)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import can

from axisbus.bus.link import candump
from axisbus.cia301.frame import Frame
from axisbus.errors import UserError
from axisbus.wording import counted

_TEXT = frozenset({".log", ".txt", ".candump", ""})
_SHOWN = 80


@dataclass(slots=True)
class Skipped:
    """What a reader could not use; holds state: counts while reading goes on, and keeps the first line of it."""

    count: int = 0
    first: str = ""
    frames: int = field(default=0)


def read(path: Path, skipped: Skipped) -> Iterator[Frame]:
    """Return the frames of a recording; lines that are no frames are counted in ``skipped``. Each blocks as its file does.

    Raises:
        UserError: there is no such file, or (with the frames) its format is not known, it is damaged, or there is no frame in it.
    """
    require(path)
    return _frames(path, skipped)


def require(path: Path) -> None:
    """Check that there is a recording that can be read.

    Raises:
        UserError: there is none.
    """
    remedy = "give the path of a recording, or - for candump's output"
    try:
        if path.is_file():
            path.open("rb").close()
            return
    except OSError as error:
        raise UserError(
            f"{path} cannot be read", observed=error.strerror or str(error), remedy=remedy
        ) from error
    raise UserError(f"there is no recording {path}", remedy=remedy)


def _frames(path: Path, skipped: Skipped) -> Iterator[Frame]:
    yield from _text(path, skipped) if path.suffix.lower() in _TEXT else _by_library(path, skipped)
    if not skipped.frames:
        seen = f"the first line is {skipped.first!r}" if skipped.first else "it is empty"
        raise UserError(
            f"there is no CAN frame in {path}",
            observed=seen,
            remedy="record with candump -l, or with python-can's can_logger",
        )


def lines(source: Iterable[str], skipped: Skipped) -> Iterator[Frame]:
    """Yield the frames of candump's output, as it comes; other lines are counted in ``skipped``."""
    for number, line in enumerate(source, start=1):
        frame = candump.parse(line)
        if frame is not None:
            skipped.frames += 1
            yield frame
        elif line.strip():
            skipped.count += 1
            skipped.first = skipped.first or f"{number}: {line.strip()[:_SHOWN]}"


def of_message(message: can.Message) -> Frame:
    """Return python-can's message as a frame."""
    return Frame(
        message.timestamp if math.isfinite(message.timestamp) else 0.0,
        message.arbitration_id,
        b"" if message.is_remote_frame else bytes(message.data),
        message.is_extended_id and not message.is_error_frame,
        message.is_remote_frame,
        message.is_error_frame,
    )


def _text(path: Path, skipped: Skipped) -> Iterator[Frame]:
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            yield from lines(file, skipped)
    except OSError as error:
        raise UserError(f"{path} cannot be read", observed=str(error)) from error


def _by_library(path: Path, skipped: Skipped) -> Iterator[Frame]:
    try:
        with ExitStack() as stack:
            for message in _reader(stack, path):
                skipped.frames += 1
                yield of_message(message)
    except GeneratorExit:
        raise
    except Exception as error:  # readers raise anything at a damaged file
        raise _unreadable(path, error, skipped) from error


def _reader(stack: ExitStack, path: Path) -> Iterable[can.Message]:
    if path.suffix.lower() == ".blf":  # its reader leaves a file open that it cannot read
        return can.BLFReader(stack.enter_context(path.open("rb")))
    return stack.enter_context(can.LogReader(path))


def _unreadable(path: Path, error: Exception, skipped: Skipped) -> UserError:
    if isinstance(error, ValueError) and "unknown" in str(error).lower() and not skipped.frames:
        known = ", ".join(sorted(can.io.player.MESSAGE_READERS))
        return UserError(
            f"{path}: recordings of this format are not known",
            observed=f"known are {known}, and candump's text",
        )
    where = f"after {counted(skipped.frames, 'frame')}" if skipped.frames else "at its beginning"
    return UserError(
        f"{path} cannot be read {where}",
        observed=f"{type(error).__name__}: {error}",
        remedy="check that it is whole, and of the format its name says",
    )
