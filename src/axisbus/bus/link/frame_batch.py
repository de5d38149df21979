"""Receive or send many CAN frames in one system call: ``recvmmsg`` and ``sendmmsg`` of Linux, on a non-blocking socket.

Theory of operation
-------------------
With one Python call per frame, each call releases the interpreter lock, and each received frame needs a list for its ancillary
data. Together this is half of the cost of a frame. Here the buffers of all frames are prepared once, and each call reuses them. The
calls do not release the interpreter lock, because neither of them blocks.
"""

from __future__ import annotations

import ctypes
import errno
import os
import socket
import struct
import sys
from collections.abc import Sequence
from functools import cache

FRAME = struct.Struct("=IB3x8s")  # struct can_frame (linux/can.h)
MOST = 64  # frames per call
_STAMP = struct.Struct("@Niill")  # struct cmsghdr, with the seconds and nanoseconds of SO_TIMESTAMPNS
_CONTROL_SIZE = struct.calcsize("@Niill0N")  # CMSG_SPACE of this header
_LENGTH = struct.Struct("@I")

Received = tuple[int, int, bytes, int, int]
"""Wire identifier, length, eight data bytes, and the receive time in seconds and nanoseconds (0, 0: unknown)."""


class _IoVec(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("len", ctypes.c_size_t))


class _Message(ctypes.Structure):  # struct msghdr, as in glibc, and in musl on little-endian systems
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_len", ctypes.c_uint),
        ("iov", ctypes.c_void_p),
        ("iov_len", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_len", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _Head(ctypes.Structure):  # struct mmsghdr
    _fields_ = (("message", _Message), ("length", ctypes.c_uint))


@cache
def available() -> bool:
    """Return whether this system has both calls."""
    if sys.platform != "linux":
        return False
    return all(hasattr(ctypes.PyDLL(None), name) for name in ("recvmmsg", "sendmmsg"))


class _Batch:
    """Buffers for ``MOST`` frames, with the result of the last call. Only one thread at a time may use them."""

    def __init__(self, control: int) -> None:
        """``control``: number of bytes for the ancillary data of each frame."""
        size, heads_size = FRAME.size, ctypes.sizeof(_Head) * MOST
        # The ancillary data follow the headers in the same block, so that one copy resets both.
        self._heads = ctypes.create_string_buffer(heads_size + control * MOST)
        self._frames = ctypes.create_string_buffer(size * MOST)
        self._vectors = (_IoVec * MOST)()
        self._at, frames = ctypes.addressof(self._heads), ctypes.addressof(self._frames)
        for number, head in enumerate((_Head * MOST).from_buffer(self._heads)):
            vector, message = self._vectors[number], head.message
            vector.base, vector.len = frames + size * number, size
            message.iov, message.iov_len = ctypes.addressof(vector), 1
            if control:
                message.control = self._at + heads_size + control * number
                message.control_len = control
        self._ancillary = memoryview(self._heads)[heads_size:]
        self._library = ctypes.PyDLL(None, use_errno=True)  # PyDLL: calls keep the interpreter lock


class ReceiveBatch(_Batch):
    """Buffers that read the received frames of a socket."""

    def __init__(self) -> None:
        super().__init__(_CONTROL_SIZE)
        self._initial_heads = self._heads.raw
        self._call = self._library.recvmmsg
        self._call.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
        self._data = memoryview(self._frames)

    def take(self, line: socket.socket) -> list[Received]:
        """Return the received frames, at most ``MOST``; empty if there are none. Does not block.

        Raises:
            OSError: the socket is closed, or its link is down or removed.
        """
        ctypes.memmove(self._at, self._initial_heads, len(self._initial_heads))
        count = self._call(line.fileno(), self._at, MOST, socket.MSG_DONTWAIT, None)
        if count < 0:
            code = ctypes.get_errno()
            if code in (errno.EAGAIN, errno.EINTR):
                return []
            raise OSError(code, os.strerror(code))
        count = self._whole(count)
        frames = FRAME.iter_unpack(self._data[: FRAME.size * count])
        stamps = _STAMP.iter_unpack(self._ancillary[: _CONTROL_SIZE * count])
        return [(*frame, stamp[3], stamp[4]) for frame, stamp in zip(frames, stamps, strict=True)]

    def _whole(self, count: int) -> int:
        """Return the number of packets before the first one without the size of a frame (the other end of a pair was closed)."""
        size, at = ctypes.sizeof(_Head), _Head.length.offset
        for number in range(count):
            if _LENGTH.unpack_from(self._heads, size * number + at)[0] != FRAME.size:
                return number
        return count


class SendBatch(_Batch):
    """Buffers that write frames to a socket."""

    def __init__(self) -> None:
        super().__init__(0)
        self._call = self._library.sendmmsg
        self._call.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int)

    def send_batch(self, line: socket.socket, frames: Sequence[tuple[int, bytes]]) -> int:
        """Send at most ``MOST`` frames (wire identifier, data). Return the number of frames that were accepted. Does not block.

        This method does not report why a frame was refused; sending that frame again shows the reason.
        """
        pack, buffer, size = FRAME.pack_into, self._frames, FRAME.size
        at = 0
        for can_id, data in frames:
            pack(buffer, at, can_id, len(data), data)
            at += size
        return max(0, int(self._call(line.fileno(), self._at, len(frames), socket.MSG_DONTWAIT)))
