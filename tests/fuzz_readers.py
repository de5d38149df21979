"""Mutated files for every reader of files from outside: ``make fuzz``.

``python tests/fuzz_readers.py [--inputs 100000] [--reader NAME] [--seed N]``: each reader gets so many mutations of valid files. It
may raise the library's own error, which names the file, and nothing else; it may take the time and memory of ``kit.readers``. The
valid files are read before and after. A finding is printed with the number of its input, and its input kept in ``-o``; then the
exit code is 1.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

from kit.readers import FEW, READERS, Reader, fuzzed, inputs

MOST_SHOWN = 10  # findings of a reader, each of another kind


def fuzz(name: str, reader: Reader, count: int, seed: int, kept: Path | None) -> int:
    """Fuzz one reader; return the number of findings. Progress goes to standard error."""
    began, taken, kinds = time.monotonic(), 0, Counter[str]()
    with tempfile.TemporaryDirectory() as place:
        folder, wrong = Path(place), 0
        path = folder / f"input{reader.suffix}"
        valid = reader.valid(folder)
        made = inputs(valid, seed)
        wrong += _valid_ones(name, reader, path, valid)
        for number in range(count):
            data = made(number)
            found = fuzzed(reader, path, data, measured=number % FEW == 0)
            taken += found.taken
            if found.finding:
                wrong += 1
                kind = found.finding.split(":")[0]
                kinds[kind] += 1
                if kinds[kind] == 1 and len(kinds) <= MOST_SHOWN:
                    print(f"\n{name}, seed {seed}, input {number}: {found.finding}")
                    if kept is not None:
                        (kept / f"{name.replace(' ', '-')}-{number}{reader.suffix}").write_bytes(data)
            if number % 500 == 0:
                _progress(name, number, count, wrong, began)
        wrong += _valid_ones(name, reader, path, valid)
    took = time.monotonic() - began
    print(f"\r{name:12} {count} inputs, {taken} read, {wrong} findings, {took:.0f} s        ", flush=True)
    return wrong


def _valid_ones(name: str, reader: Reader, path: Path, valid: list[bytes]) -> int:
    found = [fuzzed(reader, path, data).finding for data in valid]
    for each in filter(None, found):
        print(f"{name}: a valid file is refused: {each}")
    return sum(map(bool, found))


def _progress(name: str, number: int, count: int, wrong: int, began: float) -> None:
    left = (time.monotonic() - began) / max(1, number) * (count - number)
    state = f"{name}: {number}/{count}, {wrong} findings, {left / 60:.0f} min left"
    print(f"\r{state}   ", end="", file=sys.stderr, flush=True)


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=100_000, help="of each reader")
    parser.add_argument("--reader", choices=READERS, help="only this one")
    parser.add_argument("--seed", type=int, default=None, help="without, another one in each run")
    parser.add_argument("-o", type=Path, default=None, help="a folder for the inputs that are findings")
    given = parser.parse_args()
    seed = given.seed if given.seed is not None else time.time_ns() % 1_000_000
    if given.o is not None:
        given.o.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")  # of readers about what they have repaired
    names = [given.reader] if given.reader else list(READERS)
    wrong = sum(fuzz(name, READERS[name], given.inputs, seed, given.o) for name in names)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
