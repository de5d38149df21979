"""One client's dialogue with a socketcand server as bytes; pure: sends nothing itself.

Theory of operation
-------------------
The server greets with ``< hi >``. The client opens the bus by its name and requests raw mode. From then on each ``< send ID LENGTH
BYTES >`` is a frame, and each frame of the others is sent as ``< frame ID TIME DATA >``. Remote frames and CAN FD are not
supported. A client of python-can treats everything that arrives with an answer as part of the answer; therefore no frame may be
sent for ``QUIET`` s after the last answer.
"""

from __future__ import annotations

import re
from typing import NamedTuple

QUIET = 0.05  # seconds
GREETING = b"< hi >"
_OK = b"< ok >"
_LONGEST = 200  # bytes of a message
_MESSAGE = re.compile(rb"<\s*(.*?)\s*>", re.DOTALL)
_STANDARD, _EXTENDED = 0x7FF, 0x1FFF_FFFF


class Frame(NamedTuple):
    """A data frame; identifiers of 29 bits have eight digits on the line."""

    can_id: int
    data: bytes
    extended: bool = False


def frame_text(frame: Frame, time: float) -> bytes:
    """Return a frame as the server sends it to a client; ``time`` in seconds since 1970."""
    number = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
    return f"< frame {number} {time:.6f} {frame.data.hex().upper()} >".encode()


class Dialogue:
    """The client's incomplete message and the state of its dialogue."""

    def __init__(self, channel: str) -> None:
        """``channel``: the name of the bus."""
        self._channel = channel
        self._waiting = b""
        self._opened = False
        self.raw = False  # whether it is in raw mode and gets the frames of the bus
        self.is_overlong = False  # whether it does not use this protocol and must be disconnected

    def take(self, data: bytes) -> tuple[bytes, list[Frame]]:
        """Take received bytes; return the answers to send, and the frames for the bus."""
        self._waiting += data
        answers, frames = b"", []
        while (found := _MESSAGE.search(self._waiting)) is not None:
            self._waiting = self._waiting[found.end() :]
            words = found[1].decode("ascii", "replace").split()
            if self.raw and words[:1] == ["send"]:
                frame = _frame(words[1:])
                frames += [] if frame is None else [frame]
                answers += b"< error no frame >" if frame is None else b""
            else:
                answers += self._answer(words)
        self.is_overlong = len(self._waiting) > _LONGEST
        return answers, frames

    def _answer(self, words: list[str]) -> bytes:
        if words == ["echo"]:
            return b"< echo >"
        if not self._opened:
            self._opened = words == ["open", self._channel]
            return (
                _OK if self._opened else f"< error this bus is opened by < open {self._channel} > >".encode()
            )
        if words == ["rawmode"]:
            self.raw = True
            return _OK
        return b"< error only raw mode is served here >"


def _frame(words: list[str]) -> Frame | None:
    """Return the frame of a ``send``, None if it is invalid."""
    try:
        number, length = int(words[0], 16), int(words[1], 16)
        data = bytes(int(word, 16) for word in words[2:])
    except (ValueError, IndexError):
        return None
    extended = len(words[0]) > 3
    fits = 0 <= number <= (_EXTENDED if extended else _STANDARD)
    return Frame(number, data, extended) if fits and length == len(data) <= 8 else None
