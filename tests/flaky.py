"""The tests again and again beside busy processors, with counts. ``make flaky``; the number of rounds as argument, 20 without."""

from __future__ import annotations

import multiprocessing
import os
import re
import subprocess
import sys
import time
from collections import Counter


def burn() -> None:
    """Keep one processor busy."""
    while True:
        sum(range(10_000))


def main() -> int:
    """Run the rounds and return how many had a failure."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    hogs = [multiprocessing.Process(target=burn, daemon=True) for _ in range(os.cpu_count() or 1)]
    for hog in hogs:
        hog.start()
    failed: Counter[str] = Counter()
    bad = 0
    for number in range(1, rounds + 1):
        start = time.monotonic()
        ran = subprocess.run(
            [sys.executable, "-m", "pytest", "-n", "4", "--dist", "loadfile"],
            capture_output=True,
            text=True,
            check=False,
        )
        names = re.findall(r"^(?:FAILED|ERROR) (\S+)", ran.stdout, re.MULTILINE)
        failed.update(names)
        bad += ran.returncode != 0
        last = ran.stdout.strip().splitlines()[-1] if ran.stdout.strip() else ran.stderr[-200:]
        print(f"round {number} of {rounds}: {last} ({time.monotonic() - start:.0f} s)", flush=True)
        if ran.returncode:
            print(ran.stdout, ran.stderr, flush=True)
    print(f"{bad} of {rounds} rounds had a failure")
    for name, count in failed.most_common():
        print(f"{count:>4} x {name}")
    for hog in hogs:
        hog.terminate()
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
