"""Find out where a thread hangs: in the adapter's driver, in user code that it has called, or in axisbus."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import FrameType
from typing import NamedTuple

from axisbus.bus.link.channel import Channel

_GIVES_TO_DRIVER = Channel._attempt.__code__
_OURS = str(Path(__file__).parents[1])
_LIBRARY = str(Path(threading.__file__).parent)


class BlockedLocation(Enum):
    """The location of a thread."""

    DRIVER = "in the adapter's driver"
    PROGRAM = "in the program's own code"
    OURS = "in axisbus"


class HangDiagnosis(NamedTuple):
    """The location of a thread; ``text`` contains function, file and line."""

    place: BlockedLocation
    text: str


def whereabouts(ident: int | None) -> HangDiagnosis | None:
    """Return the present location of the thread ``ident``; None if the thread has ended."""
    top = sys._current_frames().get(ident or 0)
    if top is None:
        return None
    frames = list(_outwards(top))
    if any(frame.f_code is _GIVES_TO_DRIVER for frame in frames):
        return HangDiagnosis(BlockedLocation.DRIVER, _text(top))
    called = [frame for frame in frames if not _in_ours(frame) and not _in_library(frame)]
    return (
        HangDiagnosis(BlockedLocation.PROGRAM, _text(called[0]))
        if called
        else HangDiagnosis(BlockedLocation.OURS, _text(top))
    )


def _outwards(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


def _in_ours(frame: FrameType) -> bool:
    return frame.f_code.co_filename.startswith(_OURS)


def _in_library(frame: FrameType) -> bool:
    """Whether the frame is in Python's standard library: the thread's start, a lock, a sleep."""
    name = frame.f_code.co_filename
    return name.startswith(_LIBRARY) and "site-packages" not in name


def _text(frame: FrameType) -> str:
    return f"{frame.f_code.co_name} ({Path(frame.f_code.co_filename).name}:{frame.f_lineno})"
