"""Frames and messages as a fuzzer's input, one in each line as hexadecimal digits, and their mutations."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

from kit.byte_mutations import MUTATIONS

_LONGEST = 400  # frames of an input


def packed(frames: Sequence[bytes]) -> bytes:
    """Return frames as the text of an input."""
    return "".join(f"{frame.hex()}\n" for frame in frames).encode()


def unpacked(data: bytes) -> list[bytes]:
    """Return the frames of an input."""
    return [bytes.fromhex(line.decode("ascii")) for line in data.splitlines()]


def mutated_frames(data: bytes, drawn: random.Random) -> bytes:
    """Return an input with one to four mutations, of a frame or of the order and number of frames."""
    frames = unpacked(data)
    for _ in range(drawn.choice((1, 1, 1, 2, 4))):
        mutate = drawn.choice(_OF_FRAMES)
        frames = mutate(frames, drawn)[:_LONGEST] or [b""]
    return packed(frames)


def _one_of(frames: list[bytes], drawn: random.Random) -> int:
    return drawn.randrange(len(frames))


def _changed(frames: list[bytes], drawn: random.Random) -> list[bytes]:
    at = _one_of(frames, drawn)
    return [*frames[:at], drawn.choice(MUTATIONS)(frames[at], drawn), *frames[at + 1 :]]


def _bit(frames: list[bytes], drawn: random.Random) -> list[bytes]:
    at = _one_of(frames, drawn)
    frame = bytearray(frames[at])
    if frame:
        frame[drawn.randrange(len(frame))] ^= 1 << drawn.randrange(8)
    return [*frames[:at], bytes(frame), *frames[at + 1 :]]


def _lost(frames: list[bytes], drawn: random.Random) -> list[bytes]:
    at = _one_of(frames, drawn)
    return frames[:at] + frames[at + drawn.choice((1, 1, 3)) :]


def _again(frames: list[bytes], drawn: random.Random) -> list[bytes]:
    at = _one_of(frames, drawn)
    return frames[:at] + [frames[at]] * drawn.choice((2, 2, 3, 100)) + frames[at + 1 :]


def _swapped(frames: list[bytes], drawn: random.Random) -> list[bytes]:
    at, other = _one_of(frames, drawn), _one_of(frames, drawn)
    swapped = list(frames)
    swapped[at], swapped[other] = swapped[other], swapped[at]
    return swapped


def _ended(frames: list[bytes], drawn: random.Random) -> list[bytes]:
    return frames[: _one_of(frames, drawn)]


def _foreign(frames: list[bytes], drawn: random.Random) -> list[bytes]:
    at = _one_of(frames, drawn)
    return [*frames[:at], drawn.randbytes(drawn.choice((0, 1, 4, 8, 64))), *frames[at:]]


_OF_FRAMES: Sequence[Callable[[list[bytes], random.Random], list[bytes]]] = (
    _changed,
    _changed,
    _changed,
    _bit,
    _bit,
    _lost,
    _again,
    _swapped,
    _ended,
    _foreign,
)
