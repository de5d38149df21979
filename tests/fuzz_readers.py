"""Mutated files, frames and messages for every reader of bytes from outside: ``make fuzz``.

``python tests/fuzz_readers.py [--inputs 100000] [--reader NAME] [--seed N] [--seconds S]``: a reader gets so many mutations of
valid inputs, or as many as fit into the seconds. A reader raises only the errors in ``kit.readers``. Their messages must name the
file, line, object or frame. Its time and memory are limited by ``kit.reader_limits.Limits``. The valid inputs must be accepted
before, during and after the run. A finding is printed with the number of its input; ``-o`` keeps the input. The exit code is 1 if
there are findings.
"""

from __future__ import annotations

import argparse
import logging
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

from kit import gim6010_readers, readers
from kit.reader_limits import FEW, Reader, fuzzed, inputs, refusals

READERS = {**readers.READERS, **gim6010_readers.READERS}
MOST_SHOWN = 10  # findings of a reader, each of another kind
VALID_EVERY = 5000  # inputs between two looks whether the valid ones are read still


def fuzz(name: str, reader: Reader, count: int, seed: int, kept: Path | None, seconds: float) -> int:
    """Fuzz one reader; return the number of findings. Progress goes to standard error."""
    began, taken, done, kinds = time.monotonic(), 0, 0, Counter[str]()
    with tempfile.TemporaryDirectory() as place, reader.holds():
        folder, wrong = Path(place), 0
        path = folder / f"input{reader.suffix}"
        valid = reader.valid(folder)
        made = inputs(valid, seed, reader.mutate)
        wrong += _valid_ones(name, reader, path, valid)
        for number in range(count):
            if time.monotonic() - began > seconds:
                break
            data = made(number)
            found = fuzzed(reader, path, data, measured=number % FEW == 0)
            taken, done = taken + found.taken, number + 1
            if done % VALID_EVERY == 0:
                wrong += _valid_ones(name, reader, path, valid)
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
    rate = done / max(took, 1e-9)
    print(
        f"\r{name:16} {done} inputs, {taken} read, {wrong} findings, {took:.0f} s, {rate:.0f}/s        ",
        flush=True,
    )
    return wrong


def _valid_ones(name: str, reader: Reader, path: Path, valid: list[bytes]) -> int:
    found = refusals(reader, path, valid)
    for each in found:
        print(f"{name}: {each}")
    return len(found)


def _progress(name: str, number: int, count: int, wrong: int, began: float) -> None:
    left = (time.monotonic() - began) / max(1, number) * (count - number)
    state = f"{name}: {number}/{count}, {wrong} findings, {left / 60:.0f} min left"
    print(f"\r{state}   ", end="", file=sys.stderr, flush=True)


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=100_000, help="of each reader")
    parser.add_argument(
        "--reader", choices=READERS, action="append", help="only this one; may be given again"
    )
    parser.add_argument("--seconds", type=float, default=float("inf"), help="the most for each reader")
    parser.add_argument("--seed", type=int, default=None, help="without, another one in each run")
    parser.add_argument("-o", type=Path, default=None, help="a folder for the inputs that are findings")
    given = parser.parse_args()
    seed = given.seed if given.seed is not None else time.time_ns() % 1_000_000
    if given.o is not None:
        given.o.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")  # of readers about their repairs
    logging.getLogger("can").setLevel(
        logging.CRITICAL
    )  # python-can logs each line that it does not understand
    print(f"seed {seed}", flush=True)
    names = given.reader or list(READERS)
    wrong = sum(fuzz(name, READERS[name], given.inputs, seed, given.o, given.seconds) for name in names)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
