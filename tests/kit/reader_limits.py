"""Judge how a reader takes one input: its error, its time, its memory, and whether an error message gives the location."""

from __future__ import annotations

import random
import time
import tracemalloc
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import NamedTuple

from axisbus.errors import UserError
from kit.byte_mutations import mutated
from kit.fuzz_frames import TooLongError, within

MB = 1 << 20
FEW = 25  # of so many inputs the memory of one is measured, which takes its time
# seconds of any clock after which a reader is interrupted, if it takes no longer by its own limit
HANGS = 60.0
Names = Callable[[str, Path], bool]


class PassedOver(Exception):
    """A reader has dropped an input without an error message, as the protocol demands."""


def names_file(message: str, path: Path) -> bool:
    """Whether a message names the file."""
    return str(path) in message


class Limits(NamedTuple):
    """The processor time (s) and memory (octets) that an input may take: a fixed part, and a part for its size."""

    seconds: float = 2.0
    per_kb: float = 0.02  # s for each kB
    memory: int = 64 * MB
    per_octet: int = 1024

    def time_of(self, size: int) -> float:
        """The seconds that an input of ``size`` octets may take."""
        return self.seconds + self.per_kb * size / 1024

    def memory_of(self, size: int) -> int:
        """The octets of memory that an input of ``size`` octets may take."""
        return self.memory + self.per_octet * size


class Reader(NamedTuple):
    """One reader: the ending of its files, valid ones of them, and a function that reads a file as users of it do.

    The reader may raise ``errors``; ``names`` says whether an error message gives the location. ``holds`` is a context that the
    reader needs around all inputs.
    """

    suffix: str
    valid: Callable[[Path], list[bytes]]
    read: Callable[[Path], object]
    mutate: Callable[[bytes, random.Random], bytes] = mutated
    errors: tuple[type[Exception], ...] = (UserError,)
    names: Names = names_file
    limits: Limits = Limits()
    holds: Callable[[], AbstractContextManager[object]] = nullcontext


class Fuzzed(NamedTuple):
    """The result of one input: the reason if it is a finding, else an empty text; and whether it was read."""

    finding: str
    taken: bool = False


def fuzzed(reader: Reader, path: Path, data: bytes, *, measured: bool = False) -> Fuzzed:
    """Let an input be read from ``path``; ``measured``: look at its memory, too, for which all is slower.

    The time is processor time, so that other programs do not count. A reader that hangs is interrupted.
    """
    path.write_bytes(data)
    limits, size, found, taken = reader.limits, len(data), "", False
    if measured:
        tracemalloc.start()
    hangs = max(HANGS, 2.0 * limits.time_of(size))
    began, until = time.process_time(), time.monotonic() + hangs
    try:
        with within(hangs):
            reader.read(path)
        taken = True
    except reader.errors as error:
        if not reader.names(str(error), path):
            found = f"does not name where it is wrong: {type(error).__name__}: {str(error)[:300]}"
    except TooLongError as error:
        found = f"hangs: {error}"
    except Exception as error:  # noqa: BLE001 - any other error is a finding
        found = f"{type(error).__name__}: {str(error)[:300]}"
    if time.monotonic() > until:
        found = found or f"hangs: not done after {hangs} s"  # also if the reader has caught the interruption
    took = time.process_time() - began
    if measured:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        if peak > limits.memory_of(size):
            found = found or f"takes {peak / MB:.0f} MB for {size / 1024:.0f} kB"
    elif took > limits.time_of(size):
        found = found or f"takes {took:.1f} s for {size / 1024:.0f} kB"
    return Fuzzed(found, taken)


def inputs(
    valid: Sequence[bytes], seed: int, mutate: Callable[[bytes, random.Random], bytes]
) -> Callable[[int], bytes]:
    """Return a function that mutates one of the ``valid`` files; each number of a ``seed`` always makes the same input."""

    def made(number: int) -> bytes:
        drawn = random.Random(f"{seed}:{number}")
        return mutate(drawn.choice(valid), drawn)

    return made


def few_mutations(reader: Reader, folder: Path, seed: int, count: int) -> list[str]:
    """Let a reader read its valid inputs, so many mutated ones, and the valid ones once more; return the findings."""
    path = folder / f"input{reader.suffix}"
    with reader.holds():
        valid = reader.valid(folder)
        made = inputs(valid, seed, reader.mutate)
        before = refusals(reader, path, valid)
        found = [fuzzed(reader, path, made(number), measured=number == 0).finding for number in range(count)]
        return [*before, *filter(None, found), *refusals(reader, path, valid)]


def refusals(reader: Reader, path: Path, valid: Sequence[bytes]) -> list[str]:
    """Return a finding for each valid input that the reader does not read."""
    read = [fuzzed(reader, path, data) for data in valid]
    return [
        f"a valid input is refused: {each.finding or 'with an error of its own'}"
        for each in read
        if each.finding or not each.taken
    ]
