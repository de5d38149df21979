"""Random commands, mishaps and ways out on simulated cells, each judged on its plants: ``make campaign``.

``python tests/campaign.py [--scenarios 10000] [--first SEED] [--jobs N] [--scene NAME]``: fresh scripts in each run unless the
first seed is given. What fails is shrunk and printed as a script that can be pasted into ``tests/stories/test_story_random.py``.
Exit code 1 where a rule did not hold.
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import NamedTuple

from kit.campaign.events import Script
from kit.campaign.play import Played, run, shrink, told
from kit.campaign.scenes import NotHere
from kit.campaign.scripts import script

MOST_SHRUNK = 20  # failures that are shrunk; of the rest the seed is printed


class Outcome(NamedTuple):
    """What came of one seed; ``broke``: the trial itself failed, which is a finding as well."""

    seed: int
    scene: str
    played: Played | None = None
    broke: str = ""

    @property
    def finding(self) -> str:
        if self.broke:
            return f"an exception: {self.broke}"
        violation = self.played and self.played.violation
        return violation.rule if violation else ""


@dataclass
class Sum:
    """The figures of a campaign so far."""

    scenarios: Counter[str] = field(default_factory=Counter)
    findings: Counter[str] = field(default_factory=Counter)
    failed: list[int] = field(default_factory=list)
    left_out: int = 0
    commands: int = 0
    seconds: float = 0.0
    worst: tuple[float, int] = (0.0, 0)

    def add(self, outcome: Outcome) -> None:
        if outcome.played is None and not outcome.broke:
            self.left_out += 1
            return
        self.scenarios[outcome.scene] += 1
        if outcome.finding:
            self.findings[outcome.finding] += 1
            self.failed.append(outcome.seed)
        if outcome.played is not None:
            self.commands += outcome.played.commands
            self.seconds += outcome.played.seconds
            self.worst = max(self.worst, (outcome.played.worst, outcome.seed))


def trial(seed: int, only: str = "") -> Outcome:
    """Play one seed in a folder of its own."""
    made = script(seed)
    scene = made.scene.partition(":")[0]
    if only and scene != only:
        return Outcome(seed, scene)
    try:
        with tempfile.TemporaryDirectory() as folder:
            return Outcome(seed, scene, run(made, Path(folder)))
    except NotHere:
        return Outcome(seed, scene)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
        return Outcome(seed, scene, broke=f"{type(error).__name__}: {str(error)[:200]}")


def outcomes(seeds: Sequence[int], jobs: int, only: str) -> Iterator[Outcome]:
    """The outcomes of all seeds as they come, from ``jobs`` processes."""
    with multiprocessing.get_context("spawn").Pool(jobs, _quiet) as pool:
        yield from pool.imap_unordered(partial(trial, only=only), seeds, chunksize=4)


def _quiet() -> None:
    logging.disable(
        logging.CRITICAL
    )  # of handles that failed and were not asked: the campaign asks the plants


def report(total: Sum, took: float) -> str:
    """The table."""
    count = total.scenarios.total()
    rows = [
        ("scenarios", f"{count}"),
        *((f"  {name}", f"{number}") for name, number in sorted(total.scenarios.items())),
        ("left out (no such drive)", f"{total.left_out}"),
        ("commands", f"{total.commands}"),
        ("virtual hours", f"{total.seconds / 3600:.2f}"),
        ("slowest stop or way out", f"{total.worst[0]:.2f} s (seed {total.worst[1]})"),
        ("findings", f"{total.findings.total()}"),
        *((f"  {rule}", f"{number}") for rule, number in total.findings.most_common()),
        ("took", f"{took:.0f} s"),
    ]
    return "\n".join(f"{name:36} {value}" for name, value in rows)


def shrunk(seed: int) -> str:
    """A failing seed as a script that is as short as it can be."""
    made = script(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        violation = run(made, folder).violation
        return told(*shrink(made, violation, folder)) if violation else _unchanged(made)


def _unchanged(made: Script) -> str:
    return f"it fails by an exception: {made!r}"


def campaign(seeds: Sequence[int], jobs: int, only: str = "") -> Sum:
    """Play all seeds; progress goes to standard error."""
    total, began = Sum(), time.monotonic()
    for number, outcome in enumerate(outcomes(seeds, jobs, only), start=1):
        total.add(outcome)
        if outcome.finding:
            print(f"\nseed {outcome.seed} ({outcome.scene}): {outcome.finding}", file=sys.stderr)
        if number % 20 == 0 or number == len(seeds):
            took = time.monotonic() - began
            left = took / number * (len(seeds) - number)
            state = f"{number}/{len(seeds)}, {total.findings.total()} findings, {left / 60:.0f} min left"
            print(f"\r{state}   ", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return total


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", type=int, default=10_000)
    parser.add_argument(
        "--first", type=int, default=None, help="the first seed; without, another one in each run"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--scene", default="", help="only this kind of cell")
    given = parser.parse_args()
    first = given.first if given.first is not None else time.time_ns() % 1_000_000_000
    print(f"seeds {first} to {first + given.scenarios - 1}")
    began = time.monotonic()
    total = campaign(range(first, first + given.scenarios), given.jobs, given.scene)
    _quiet()
    for seed in total.failed[:MOST_SHRUNK]:
        print(f"\nseed {seed}: {shrunk(seed)}")
    if total.failed[MOST_SHRUNK:]:
        print(f"\nmore seeds that fail: {total.failed[MOST_SHRUNK:]}")
    print(report(total, time.monotonic() - began))
    return 1 if total.findings else 0


if __name__ == "__main__":
    sys.exit(main())
