"""Limit asyncua's decoder: the lengths in a message must not cost more memory or time than its size permits.

Theory of operation
-------------------
asyncua trusts the lengths in a message. A negative length moves backwards, so that a short message is read for ever, and an array
of null values may claim two thousand million elements. Any client that reaches the port can send such messages, before it is
authenticated. Here a negative length is an error, an array has at most as many elements as octets are left (of null values: none),
and each message in the server's thread is decoded in at most the number of pieces given to ``allow``.
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
)  # ``pieces`` left for the present message; unset in other threads, such as a client's


def allow(pieces: int) -> None:
    """Set the number of pieces in which the next message of this thread may be decoded."""
    _left.pieces = pieces


def _refused(why: str) -> Exception:
    return ua.uaerrors.BadDecodingError(why)


def _read_soundly(buffer: Buffer, size: int) -> bytes:
    if size < 0:
        raise _refused("a length below zero")
    pieces = getattr(_left, "pieces", None)
    if pieces is not None:
        if pieces <= 0:
            raise _refused("too many chunks")
        _left.pieces = pieces - 1
    return _read(buffer, size)


def _within(unpack: _Unpack, nothings: bool = False) -> _Unpack:
    """Return an array decoder that checks whether the elements can fit into the remaining octets."""

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
    """Install the limits in asyncua for the whole process; harmless when repeated."""
    Buffer.read = _read_soundly
    ua_binary._create_uatype_array_deserializer = _array
    ua_binary._create_list_deserializer = _list
    for cached in (ua_binary._create_type_deserializer, ua_binary._create_dataclass_deserializer):
        cached.cache_clear()  # decoders made before have no limits
