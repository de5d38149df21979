"""The highest velocity, acceleration and jerk of axes that the master controls, as a share of the limits: ``make bounds``.

``python tests/bounds.py [--commands 10000] [--first SEED] [--jobs N]``: random lines, paths, circles, streams, trajectories,
gears, replans, soft velocities and moves, overrides, halts and resumes, in virtual time, with a table of the commands and the
highest share of each limit; and a tenth as many starts of a group, with the number of SYNCs between the starts of its axes.
Each run uses new seeds unless the first seed is given. The exit code is 1 if a limit did not hold, or if an axis started later
than another.
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import os
import sys
import tempfile
import time
from pathlib import Path

from kit.bounds.group_starts import Starts, starts
from kit.bounds.highest_shares import MOST
from kit.bounds.random_motion import ORDER, Play, played

STEPS = 25  # commands of a play


def trial(seed: int) -> Play:
    """Play one seed in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return played(seed, STEPS, Path(folder))


def group_starts(seed: int, count: int) -> Starts:
    """Start a group so often in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return starts(seed, count, Path(folder))


def _quiet() -> None:
    logging.disable(
        logging.CRITICAL
    )  # of handles that failed and were not asked: the ledger looks at the axes


def table(total: Play) -> str:
    """Return the commands, and their results."""
    lines = [f"{'':32}{'asked for':>10}{'done':>8}{'broken off':>12}"]
    for what in ORDER:
        counts = total.asked[what], total.done[what], total.broken_off[what]
        lines.append(f"{what:32}{counts[0]:>10}{counts[1]:>8}{counts[2]:>12}")
    lines += ["", f"highest share of a limit, in {total.worst.cycles} cycles of an axis"]
    lines += [f"{what:18}{share:>20.12f}   {where}" for what, (share, where) in total.worst.shares.items()]
    return "\n".join(lines)


def main() -> int:
    """Play until so many commands have been given, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commands", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=int(time.time()))
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    chosen = parser.parse_args()
    seeds = range(chosen.first, chosen.first + -(-chosen.commands // STEPS))
    print(f"seeds {seeds[0]} to {seeds[-1]}")
    total = Play()
    with multiprocessing.get_context("spawn").Pool(chosen.jobs, _quiet) as pool:
        began = pool.apply_async(group_starts, (chosen.first, max(1, chosen.commands // 10)))
        for number, play in enumerate(pool.imap_unordered(trial, seeds), 1):
            total.join(play)
            print(f"\r{number}/{len(seeds)} plays", end="", file=sys.stderr, flush=True)
        print(file=sys.stderr)
        together = began.get()
    print(table(total))
    print(
        f"\n{together.count} starts of three axes, {together.changed} of them out of other modes: at most "
        f"{together.apart} SYNCs apart"
    )
    return int(together.apart > 0 or any(share > MOST for share, _ in total.worst.shares.values()))


if __name__ == "__main__":
    sys.exit(main())
