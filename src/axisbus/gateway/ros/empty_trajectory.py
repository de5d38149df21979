"""Whether a JointTrajectory has no points, found out in no time: a halt must not wait until what is long was read."""

from __future__ import annotations

import struct

_HEADER = 4  # octets before the message itself, from which it is aligned
_STAMP = 8
_MOST = 256  # joints that are looked at


def names_to_halt(data: bytes) -> tuple[str, ...] | None:
    """Return the joints of a JointTrajectory without points; None where it has some, or is none."""
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
    """Holds how far it has read."""

    def __init__(self, data: bytes, order: str) -> None:
        self._data = data
        self._count = struct.Struct(f"{order}I")
        self._at = _HEADER + _STAMP

    def count(self) -> int:
        """Return the number that is next."""
        self._at += -self._at % 4
        (found,) = self._count.unpack_from(self._data, self._at)
        self._at += 4
        return int(found)

    def text(self) -> bytes:
        """Return the text that is next, without the octet that ends it."""
        length = self.count()
        found = self._data[self._at : self._at + length]
        self._at += length
        return found[:-1]
