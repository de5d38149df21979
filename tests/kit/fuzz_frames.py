"""Frames for the fuzzers: any bytes, and frames near those that CiA 301 and CiA 305 have; and a limit to the work of a test."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from hypothesis import strategies as st

from axisbus.errors import AxisbusError

NODE = 5
OBJECTS = [(0x1000, 0), (0x1001, 0), (0x1018, 1), (0x1008, 0), (0x6041, 0), (0x6064, 0), (0xFFFF, 0xFF)]

any_bytes = st.binary(max_size=8)
long_bytes = st.binary(max_size=64)  # lengths possible with CAN FD
numbers32 = st.sampled_from(
    [0, 1, 7, 8, 255, 256, 1000, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF]
) | st.integers(0, 0xFFFF_FFFF)


def multiplexer(index: int, subindex: int) -> bytes:
    return index.to_bytes(2, "little") + bytes([subindex])


objects = st.sampled_from(OBJECTS).map(lambda each: multiplexer(*each))


def _initiation(commands: list[int]) -> st.SearchStrategy[bytes]:
    return st.tuples(st.sampled_from(commands), objects, numbers32).map(
        lambda each: bytes([each[0]]) + each[1] + each[2].to_bytes(4, "little")
    )


def _behind(commands: st.SearchStrategy[int]) -> st.SearchStrategy[bytes]:
    return st.tuples(commands, st.binary(min_size=7, max_size=7)).map(lambda each: bytes([each[0]]) + each[1])


# The answers of an SDO server, by the phase of a transfer (CiA 301 7.2.4.3).
_EXPEDITED = _initiation([0x40, 0x41, 0x42, 0x43, 0x47, 0x4B, 0x4F])
_WRITTEN = _initiation([0x60, 0x61, 0x7F])
_ABORT = _initiation([0x80])
_BLOCK_START = _initiation([0xC0, 0xC2, 0xC4, 0xC6, 0xA0, 0xA4])
_BLOCK_GRANT = st.tuples(st.sampled_from([0xA0, 0xA4]), objects, st.integers(0, 255)).map(
    lambda each: bytes([each[0]]) + each[1] + bytes([each[2], 0, 0, 0])
)
_SEGMENT = _behind(st.integers(0x00, 0x1F))
_SEGMENT_TAKEN = _behind(st.integers(0x20, 0x3F))
_BLOCK_SEGMENT = _behind(st.integers(1, 127) | st.integers(129, 255) | st.sampled_from([1, 2, 3, 127]))
_BLOCK_CONFIRMED = st.tuples(
    st.sampled_from([0xA2, 0xA1]), st.integers(0, 255), st.integers(0, 255), st.binary(min_size=5, max_size=5)
).map(lambda each: bytes(each[:3]) + each[3])
_BLOCK_END = _behind(st.sampled_from([0xC1, 0xC5, 0xD9, 0xDD]))

whole_answers = st.one_of(
    _EXPEDITED,
    _WRITTEN,
    _ABORT,
    _BLOCK_START,
    _BLOCK_GRANT,
    _SEGMENT,
    _SEGMENT_TAKEN,
    _BLOCK_SEGMENT,
    _BLOCK_CONFIRMED,
    _BLOCK_END,
)


@st.composite
def mutated(draw: st.DrawFn, frames: st.SearchStrategy[bytes]) -> bytes:
    """A frame as it is, cut, lengthened, or with a byte or a bit changed."""
    frame = draw(frames)
    how = draw(st.sampled_from(["whole", "whole", "whole", "cut", "longer", "byte", "bit"]))
    if how == "cut":
        return frame[: draw(st.integers(0, len(frame)))]
    if how == "longer":
        return frame + draw(st.binary(min_size=1, max_size=8))
    if how in ("byte", "bit") and frame:
        at = draw(st.integers(0, len(frame) - 1))
        value = draw(st.integers(0, 255)) if how == "byte" else frame[at] ^ 1 << draw(st.integers(0, 7))
        return frame[:at] + bytes([value]) + frame[at + 1 :]
    return frame


sdo_answers = mutated(whole_answers) | any_bytes


def outcome(act: Callable[[], object]) -> object:
    """Return the outcome of a call: its result, or its one clear error."""
    try:
        return act()
    except AxisbusError as error:
        return error


class TooLongError(AssertionError):
    """The work has no end."""


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Fail if the block does not end in time; for the main thread.

    The test's own time-out uses the same timer: it continues afterwards, and must be later.
    """

    def ring(*_: object) -> None:
        raise TooLongError(f"not done after {seconds} s")

    before = signal.signal(signal.SIGALRM, ring)
    # Again after a while: a log handler, for one, catches whatever is raised in it.
    left, _ = signal.setitimer(signal.ITIMER_REAL, seconds, min(1.0, seconds))
    until = time.monotonic() + left
    try:
        assert not left or seconds < left, (
            f"{seconds} s are not below the {left:.0f} s that the test has left"
        )
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if left:
            signal.setitimer(signal.ITIMER_REAL, max(0.001, until - time.monotonic()))
