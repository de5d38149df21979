"""Read frames from a file: candump text by axisbus's own parser, other formats by python-can (asc, blf, csv, db, mf4, trc, ...)."""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Generator, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO, TextIO, cast

import can
from can.io import blf

from axisbus.cia301.frame import CanFrame
from axisbus.errors import UserError
from axisbus.wording import counted

_TEXT = frozenset({".log", ".txt", ".candump", ""})
_SHOWN = 80
# Lines without an event, which python-can's readers skip.
_ASC_HEAD = re.compile(r"\s*(?:date\s|base\s|//|(?:no\s+)?internal events logged)", re.IGNORECASE)
_NO_EVENTS: dict[str, re.Pattern[str]] = {
    ".asc": re.compile(
        rf"{_ASC_HEAD.pattern}|\s*$|\s*(?:begin|end) triggerblock|.*start of measurement", re.IGNORECASE
    ),
    ".trc": re.compile(r"\s*(?:;|$)"),
}
# In these files channels count from 1, in python-can's messages from 0.
_COUNTED_FROM_0 = frozenset({".asc", ".blf"})
# Bytes of a container of a BLF, which has 128 kB by default, and of an object that goes on in the next container.
_BLF_CONTAINER, _BLF_OBJECT = 16 << 20, 4 << 20


@dataclass(slots=True)
class SkippedLines:
    """Lines that a reader could not use, and the buses in the file; holds state: counts while reading continues.

    ``channels``: frames by the name of their bus; ``times_back``: frames with an earlier time than the frame before on their bus.
    """

    count: int = 0
    first: str = ""
    frames: int = field(default=0)
    channels: dict[str, int] = field(default_factory=dict)
    times_back: int = 0
    line: int = 0  # for a text that python-can reads: the last line that it has read

    def words(self) -> list[str]:
        """Return remarks about the frames for the user, one line each."""
        found = []
        if len(self.channels) > 1:
            each = ", ".join(
                f"{name or 'without a name'} ({counted(count, 'frame')})"
                for name, count in self.channels.items()
            )
            found.append(
                f"the recording has {len(self.channels)} buses: {each}; --channel NAME selects one of them"
            )
        if self.times_back:
            found.append(
                f"the times go back {counted(self.times_back, 'time')}, so steps and durations are wrong: "
                "record with absolute times (candump -L or -ta, not -td)"
            )
        return found

    def note(self, number: int, line: str) -> None:
        """Count a line that is not a frame."""
        self.count += 1
        self.first = self.first or f"{number}: {line.strip()[:_SHOWN]}"


def read(path: Path, skipped: SkippedLines, channel: str | None = None) -> Iterator[CanFrame]:
    """Return the frames of a recording; other lines are counted in ``skipped``. Each step blocks as its file does.

    ``channel``: only frames of this bus, by its name in the file.

    Raises:
        UserError: there is no such file, or (with the frames) its format is not known, it is damaged, or it has no frame
            (of ``channel``).
    """
    require(path)
    return of_channel(_frames(path, skipped), skipped, channel, str(path))


def of_channel(
    frames: Iterable[CanFrame], skipped: SkippedLines, channel: str | None, source: str
) -> Iterator[CanFrame]:
    """Yield the frames of one bus, of all if ``channel`` is None; count those of each.

    Raises:
        UserError: ``channel`` has no frame (at the end).
    """
    newest: dict[str, float] = {}
    for frame in frames:
        on = frame.channel
        skipped.channels[on] = skipped.channels.get(on, 0) + 1
        if channel is not None and on != channel:
            continue
        skipped.times_back += frame.time < newest.get(on, -math.inf)
        newest[on] = frame.time
        yield frame
    if channel is not None and channel not in skipped.channels:
        raise UserError(
            f"{source} has no frame of channel {channel!r}",
            observed=f"there are {', '.join(sorted(skipped.channels)) or 'none'}",
            remedy="give one of them as --channel",
        )


def require(path: Path) -> None:
    """Check that a recording exists and can be read.

    Raises:
        UserError: it does not or cannot.
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


def _frames(path: Path, skipped: SkippedLines) -> Iterator[CanFrame]:
    yield from _text(path, skipped) if path.suffix.lower() in _TEXT else _by_library(path, skipped)
    if not skipped.frames:
        seen = f"the first line is {skipped.first!r}" if skipped.first else "it is empty"
        raise UserError(
            f"there is no CAN frame in {path}",
            observed=seen,
            remedy="record with candump -l, or with python-can's can_logger",
        )


def lines(source: Iterable[str], skipped: SkippedLines) -> Iterator[CanFrame]:
    """Yield the frames of candump's output as it comes; count other lines in ``skipped``."""
    for number, line in enumerate(source, start=1):
        frame = parse(line)
        if frame is not None:
            skipped.frames += 1
            yield frame
        elif line.strip():
            skipped.note(number, line)


def of_message(message: can.Message, first_channel: int = 0) -> CanFrame:
    """Return python-can's message as a frame; ``first_channel``: the number of its channel 0."""
    channel = message.channel
    return CanFrame(
        message.timestamp if math.isfinite(message.timestamp) else 0.0,
        message.arbitration_id,
        b"" if message.is_remote_frame else bytes(message.data),
        message.is_extended_id and not message.is_error_frame,
        message.is_remote_frame,
        message.is_error_frame,
        "" if channel is None else str(channel + first_channel if isinstance(channel, int) else channel),
    )


def _text(path: Path, skipped: SkippedLines) -> Iterator[CanFrame]:
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            yield from lines(file, skipped)
    except OSError as error:
        raise UserError(f"{path} cannot be read", observed=str(error)) from error


def _by_library(path: Path, skipped: SkippedLines) -> Iterator[CanFrame]:
    try:
        with ExitStack() as stack:
            first_channel = int(path.suffix.lower() in _COUNTED_FROM_0)
            for message in _reader(stack, path, skipped):
                skipped.frames += 1
                yield of_message(message, first_channel)
    except GeneratorExit:
        raise
    except Exception as error:  # readers raise anything at a damaged file
        raise _unreadable(path, error, skipped) from error


def _reader(stack: ExitStack, path: Path, skipped: SkippedLines) -> Iterable[can.Message]:
    kind = path.suffix.lower()
    if kind == ".blf":  # this reader leaves a file open that it cannot read
        return _BlfReader(cast(BinaryIO, _Sized(stack.enter_context(path.open("rb")), path.stat().st_size)))
    if kind in _NO_EVENTS:
        file = stack.enter_context(path.open(encoding="utf-8", errors="replace"))
        text: Any = _Lines(file, _NO_EVENTS[kind], skipped, headed=kind == ".asc")
        reader = can.ASCReader if kind == ".asc" else can.TRCReader
        messages: Iterable[can.Message] = text.counted(reader(text))
        return messages
    return stack.enter_context(can.LogReader(path))


class _Sized:
    """A binary file that limits each read to its own size: the sizes in a damaged file may be anything."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size

    def read(self, size: int = -1) -> bytes:
        """Return ``size`` bytes, or fewer at the end of the file."""
        return self._file.read(min(size, self._size))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


class _BlfReader(can.BLFReader):
    """python-can's reader of BLF, with bounds for the sizes that a file gives.

    python-can reads an object of size 0 again and again, without end. It decompresses containers whatever their size, and stores
    whatever it takes for the beginning of an object.
    """

    def __iter__(self) -> Generator[can.Message]:
        """Yield the frames; raises ValueError and struct.error at a damaged file."""
        complete = True
        while data := self.file.read(blf.OBJ_HEADER_BASE_STRUCT.size):
            signature, _, _, size, kind = blf.OBJ_HEADER_BASE_STRUCT.unpack(data)
            if signature != b"LOBJ":
                raise ValueError("there is no object where one must begin")
            content = self.file.read(max(0, size - blf.OBJ_HEADER_BASE_STRUCT.size))
            complete = len(data) + len(content) >= size
            self.file.read(size % 4)  # padding
            if kind == blf.LOG_CONTAINER:
                yield from self._parse_container(_decompressed(content))
                if len(self._tail) > _BLF_OBJECT:
                    raise ValueError(f"an object is larger than {_BLF_OBJECT >> 20} MB")
        if not complete or self._tail.strip(b"\0"):  # zeros are padding
            raise ValueError(
                "it ends in the middle of an object: the recording is cut, or the size of an object is wrong"
            )

    def _parse_data(self, data: bytes) -> Iterator[can.Message]:
        """Yield the frames of the objects up to the first one whose size is impossible."""
        wrong = _impossible_object(data)
        yield from super()._parse_data(data if wrong is None else data[:wrong])
        if wrong is not None:
            raise ValueError("an object is shorter than its header")


def _decompressed(container: bytes) -> bytes:
    method, _ = blf.LOG_CONTAINER_STRUCT.unpack_from(container)
    content = container[blf.LOG_CONTAINER_STRUCT.size :]
    if method == blf.NO_COMPRESSION:
        return content
    if method != blf.ZLIB_DEFLATE:
        raise ValueError(f"a container has compression {method}, which is neither 0 (none) nor 2 (zlib)")
    found = zlib.decompressobj()
    data = found.decompress(content, _BLF_CONTAINER)
    if found.unconsumed_tail:
        raise ValueError(f"a container has more than {_BLF_CONTAINER >> 20} MB")
    return data


def _impossible_object(data: bytes) -> int | None:
    """Return where the first object begins that is shorter than its header; None if there is none."""
    header = blf.OBJ_HEADER_BASE_STRUCT
    at = data.find(b"LOBJ", 0, 8)
    while 0 <= at <= len(data) - header.size:
        size = header.unpack_from(data, at)[3]
        if size < header.size:
            return at
        at = data.find(b"LOBJ", at + size, at + size + 8)
    return None


class _Lines:
    """The lines of a file that python-can reads; counts those from which it makes no frame.

    python-can's ASC reader drops the line that ends the header. With ``headed`` that is an inserted empty line, and not the first
    frame.
    """

    def __init__(
        self, file: TextIO, no_event: re.Pattern[str], skipped: SkippedLines, *, headed: bool
    ) -> None:
        self._lines = self._taken(file, headed)
        self._no_event = no_event
        self._skipped = skipped
        self._waiting: tuple[int, str] | None = None  # a line from which no frame was made so far

    def __iter__(self) -> Iterator[str]:
        return self._lines

    def counted(self, messages: Iterable[can.Message]) -> Iterator[can.Message]:
        """Yield the messages that a reader makes from these lines."""
        for message in messages:
            self._waiting = None
            yield message
        self._note()

    def _taken(self, file: TextIO, headed: bool) -> Iterator[str]:
        for number, line in enumerate(file, start=1):
            self._note()
            if headed and not _ASC_HEAD.match(line):
                headed = False
                yield "\n"
            self._skipped.line = number
            self._waiting = None if self._no_event.match(line) else (number, line)
            yield line

    def _note(self) -> None:
        if self._waiting is not None:
            self._skipped.note(*self._waiting)
            self._waiting = None

    # For python-can, an object with these methods is a file.
    def read(self) -> str:
        """Return the remaining text."""
        return "".join(self._lines)

    def write(self, text: str) -> None:
        """Write nothing."""

    def close(self) -> None:
        """Do nothing: the code that opened the file closes it."""


def _unreadable(path: Path, error: Exception, skipped: SkippedLines) -> UserError:
    if isinstance(error, ValueError) and "unknown" in str(error).lower() and not skipped.frames:
        known = ", ".join(sorted(can.io.player.MESSAGE_READERS))
        return UserError(
            f"{path}: this recording format is not supported",
            observed=f"the supported formats are {known}, and candump's text",
        )
    where = f"after {counted(skipped.frames, 'frame')}" if skipped.frames else "at its beginning"
    where += f", in line {skipped.line}" if skipped.line else ""
    return UserError(
        f"{path} cannot be read {where}",
        observed=f"{type(error).__name__}: {error}",
        remedy="check that it is complete, and of the format that its name indicates",
    )


# -- Parse the output of can-utils' ``candump`` line by line: its log format (-L, -l) and its screen format ------------


_ERROR_FLAG = 0x2000_0000  # CAN_ERR_FLAG of linux/can.h, in the identifier of an error frame
_MASK = 0x1FFF_FFFF
_STANDARD = 0x7FF


# (1436509052.249713) vcan0 044#2A366C2BBA    optionally followed by a flag R or T, or more
_LOG = re.compile(
    r"\((?P<time>\d{1,20}\.\d{1,20})\)\s+(?P<channel>\S+)\s+(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?P<data>R\d?|[0-9A-Fa-f.]*)(?:\s.*)?"
)
#  (1436509052.249713)  vcan0  RX - -  123   [3]  11 22 33    time, direction and flags may be missing
_SCREEN = re.compile(
    r"\s*(?:\((?P<time>[\d.]{1,40}|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+)\)\s+)?(?P<channel>\S+)\s+(?:(?:RX|TX)\s+[-B]\s+[-E]\s+)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<count>\d)\]\s*"
    r"(?P<data>remote request|ERRORFRAME|(?:[0-9A-Fa-f]{2}(?:\s|$)\s*)*)"
    r"(?P<rest>.*)"
)


def parse(line: str) -> CanFrame | None:
    """Return the frame of a line; None if it is not a line of ``candump`` with a classic CAN frame.

    Without a time stamp the time is 0. A relative time stamp (-t d, -t z) is returned unchanged.
    """
    found = _LOG.fullmatch(line.strip())
    if found is not None:
        return _frame(found, found["data"].replace(".", ""))
    found = _SCREEN.fullmatch(line.rstrip())
    return None if found is None else _of_screen(found)


def _of_screen(found: re.Match[str]) -> CanFrame | None:
    data, count = found["data"].strip(), int(found["count"])
    digits = "R" if data == "remote request" else "".join(data.split())
    if data == "ERRORFRAME":
        octets = re.match(r"\s*((?:[0-9A-Fa-f]{2}\s*)*)", found["rest"])
        digits = "".join(octets[1].split())[: 2 * count] if octets is not None else ""
        return _frame(found, digits, error=True)
    if digits != "R" and len(digits) != 2 * count:
        return None
    return _frame(found, digits)


def _time(text: str | None) -> float:
    if not text:
        return 0.0
    try:
        return float(text) if "-" not in text else datetime.fromisoformat(text).timestamp()
    except (ValueError, OverflowError, OSError):  # the last on Windows, before 1970
        return 0.0


def _frame(found: re.Match[str], digits: str, error: bool = False) -> CanFrame | None:
    identifier, time = found["id"], _time(found["time"])
    number = int(identifier, 16)
    remote = digits[:1] == "R"
    if not remote and (len(digits) % 2 or len(digits) > 16):
        return None
    if len(identifier) == 3 and number > _STANDARD:
        return None
    data = b"" if remote else bytes.fromhex(digits)
    error = error or bool(number & _ERROR_FLAG and len(identifier) == 8)
    return CanFrame(
        time, number & _MASK, data, len(identifier) == 8 and not error, remote, error, found["channel"]
    )
