"""asyncua's decoder within limits: what a message claims of itself takes neither memory nor time beyond its own length.

Theory of operation
-------------------
asyncua believes the lengths that stand in a message. One below zero goes back in it, so that a short message is read for ever, and
an array of nothing may claim two thousand million elements; whoever reaches the port may send such, before anybody has come in.
Here a length is never below zero, no array has more elements than octets are left (of nothings: none), and a message of the
server's thread is read in at most so many pieces as ``allow`` was told.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from asyncua import ua
from asyncua.common.utils import Buffer
from asyncua.ua import ua_binary

_Unpack = Callable[[Any], Any]
_read = Buffer.read
_arrays, _lists = ua_binary._create_uatype_array_deserializer, ua_binary._create_list_deserializer
_left = (
    threading.local()
)  # ``pieces`` of the message that is decoded; in other threads, such as a client's, there is none


def allow(pieces: int) -> None:
    """Let the next message of this thread be read in so many pieces."""
    _left.pieces = pieces


def _refused(why: str) -> Exception:
    return ua.uaerrors.BadDecodingError(why)


def _read_soundly(buffer: Buffer, size: int) -> bytes:
    if size < 0:
        raise _refused("a length below zero")
    pieces = getattr(_left, "pieces", None)
    if pieces is not None:
        if pieces <= 0:
            raise _refused("too many pieces")
        _left.pieces = pieces - 1
    return _read(buffer, size)


def _within(unpack: _Unpack, nothings: bool = False) -> _Unpack:
    """Return what unpacks an array, where its elements can be in what is left."""

    def unpacked(data: Any) -> Any:
        start = data.copy()
        length = ua_binary.Primitives.Int32.unpack(start)
        if length > (0 if nothings else len(start)):
            raise _refused("an array that is longer than its message")
        return unpack(data)

    return unpacked


def _array(kind: Any) -> _Unpack:
    return _within(_arrays(kind), kind is ua.VariantType.Null)


def _list(kind: Any) -> _Unpack:
    return _within(_lists(kind))


def install() -> None:
    """Have asyncua decode so, in this whole process; again is as once."""
    Buffer.read = _read_soundly
    ua_binary._create_uatype_array_deserializer = _array
    ua_binary._create_list_deserializer = _list
    for cached in (ua_binary._create_type_deserializer, ua_binary._create_dataclass_deserializer):
        cached.cache_clear()  # what was made before reads the old way
