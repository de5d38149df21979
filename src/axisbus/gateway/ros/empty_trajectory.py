"""Detect a JointTrajectory without points quickly, so that a halt does not wait for the decoding of long messages."""

from __future__ import annotations

import struct

_HEADER = 4  # octets before the message itself; its alignment counts from there
_STAMP = 8
_MOST = 256  # the most joints that are read


def names_to_halt(data: bytes) -> tuple[str, ...] | None:
    """Return the joints of a JointTrajectory without points; None if it has points or is invalid."""
    if len(data) < _HEADER or data[0] != 0 or data[1] > 1:
        return None
    reader = _Reader(data, "<" if data[1] else ">")
    try:
        reader.text()  # the frame
        names = [reader.text().decode() for _ in range(min(reader.count(), _MOST + 1))]
        return None if len(names) > _MOST or reader.count() else tuple(names)
    except (struct.error, UnicodeDecodeError):
        return None


class _Reader:
    """Read a message in sequence."""

    def __init__(self, data: bytes, order: str) -> None:
        self._data = data
        self._count = struct.Struct(f"{order}I")
        self._at = _HEADER + _STAMP

    def count(self) -> int:
        """Return the next number."""
        self._at += -self._at % 4
        (found,) = self._count.unpack_from(self._data, self._at)
        self._at += 4
        return int(found)

    def text(self) -> bytes:
        """Return the next text, without its terminating octet."""
        length = self.count()
        found = self._data[self._at : self._at + length]
        self._at += length
        return found[:-1]
