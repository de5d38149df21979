"""Random commands, faults and closings of simulated cells, each judged on its plants: ``make campaign``.

``python tests/campaign.py [--scenarios 10000] [--first SEED] [--jobs N] [--scene NAME]``: each run uses new scripts unless the
first seed is given. Every second seed draws its cell as well (all do with ``--scene drawn``); the others run on fixed scenes. A
failing script is shrunk and printed in a form that can be pasted into ``tests/scenarios/test_scenario_random.py``. The exit
code is 1 if a rule did not hold, or if one of the rules of drawn cells was never exercised.

``--mutant NAME`` (or ``all``) is the self-test: the product is changed while it runs (``kit.campaign.mutants``), and the exit
code is 1 if no rule detects that within ``--scenarios`` (500) drawn cells. A script that fails without the change as well does
not count.
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

from kit.campaign.cells import scripts as drawn
from kit.campaign.cells.recipe import CellRecipe
from kit.campaign.cells.rules import RULES
from kit.campaign.events import Script
from kit.campaign.mutants import MUTANTS, mutated
from kit.campaign.scenes import NotHere
from kit.campaign.script_replay import Played, run, shrink, told
from kit.campaign.scripts import script

MOST_SHRUNK = 20  # failures that are shrunk; of the rest the seed is printed
FEW = 500  # scenarios of drawn cells, below which a rule may not have been exercised
BY_MUTANT = 500  # scenarios within which a mutant has to be noticed


class Outcome(NamedTuple):
    """The result of one seed; ``broke``: the trial itself failed, which is a finding as well."""

    seed: int
    scene: str
    played: Played | None = None
    broke: str = ""
    cell: CellRecipe | None = None
    left_out: str = ""

    @property
    def finding(self) -> str:
        if self.broke:
            return f"an exception: {self.broke}"
        violation = self.played and self.played.violation
        return violation.kind if violation else ""


@dataclass
class Sum:
    """The figures of a campaign so far."""

    scenarios: Counter[str] = field(default_factory=Counter)
    findings: Counter[str] = field(default_factory=Counter)
    failed: list[int] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    cells: set[CellRecipe] = field(default_factory=set)
    tally: Counter[str] = field(default_factory=Counter)  # of drawn cells
    found: dict[str, list[int]] = field(default_factory=dict)
    commands: int = 0
    seconds: float = 0.0
    worst: tuple[float, int] = (0.0, 0)

    def add(self, outcome: Outcome) -> None:
        if outcome.played is None and not outcome.broke:
            if outcome.left_out:
                self.left_out[outcome.left_out] += 1
            return
        self.scenarios[outcome.scene] += 1
        if outcome.finding:
            self.findings[outcome.finding] += 1
            self.failed.append(outcome.seed)
            self.found.setdefault(outcome.finding, []).append(outcome.seed)
        if outcome.played is not None:
            if outcome.cell is not None:
                self.cells.add(outcome.cell)
                self.tally.update(outcome.played.tally)
            self.commands += outcome.played.commands
            self.seconds += outcome.played.seconds
            self.worst = max(self.worst, (outcome.played.worst, outcome.seed))


class Kind(NamedTuple):
    """Options of a campaign: the only scene, fields of drawn axes that keep their usual values, and the mutant of the product."""

    only: str = ""
    usual: tuple[str, ...] = ()
    mutant: str = ""


def script_of(seed: int, kind: Kind) -> Script:
    """Return the script of a seed: every second one is of a drawn cell."""
    only = kind.only
    return drawn.script(seed, kind.usual) if only == drawn.SCENE or (not only and seed % 2) else script(seed)


def trial(seed: int, kind: Kind) -> Outcome:
    """Play one seed in a folder of its own; of a mutant nothing counts that is wrong without it as well."""
    made = script_of(seed, kind)
    scene = made.scene.partition(":")[0]
    if kind.only and scene != kind.only:
        return Outcome(seed, scene)
    with mutated(kind.mutant):
        outcome = _trial(seed, scene, made)
    if kind.mutant and outcome.finding and _trial(seed, scene, made).finding == outcome.finding:
        return Outcome(seed, scene)
    return outcome


def _trial(seed: int, scene: str, made: Script) -> Outcome:
    try:
        with tempfile.TemporaryDirectory() as folder:
            return Outcome(seed, scene, run(made, Path(folder)), cell=made.cell)
    except NotHere as error:
        return Outcome(seed, scene, left_out=str(error).partition(":")[0] if made.cell else "no such drive")
    except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
        return Outcome(seed, scene, broke=f"{type(error).__name__}: {str(error)[:200]}")


def outcomes(seeds: Sequence[int], jobs: int, kind: Kind) -> Iterator[Outcome]:
    """The outcomes of all seeds as they come, from ``jobs`` processes."""
    with multiprocessing.get_context("spawn").Pool(jobs, _quiet) as pool:
        yield from pool.imap_unordered(partial(trial, kind=kind), seeds, chunksize=4)


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
        ("left out", f"{total.left_out.total()}"),
        *((f"  {reason}", f"{number}") for reason, number in total.left_out.most_common()),
        ("commands", f"{total.commands}"),
        ("virtual hours", f"{total.seconds / 3600:.2f}"),
        ("slowest stop or way out", f"{total.worst[0]:.2f} s (seed {total.worst[1]})"),
        ("findings", f"{total.findings.total()}"),
        *(
            (f"  {rule}", f"{number} (seeds {', '.join(map(str, total.found[rule][:5]))})")
            for rule, number in total.findings.most_common()
        ),
        *(exercised(total) if total.cells else ()),
        ("took", f"{took:.0f} s"),
    ]
    return "\n".join(f"{name:52} {value}" for name, value in rows)


def exercised(total: Sum) -> list[tuple[str, str]]:
    """Return the table for drawn cells: how often each rule was checked, the commands, and the share of axes with each promise."""
    tally = total.tally
    given, refused = (
        tally["commands"],
        tally["commands refused at the call"] + tally["commands refused later"],
    )
    rows = [
        ("drawn cells, each another one", f"{len(total.cells)}"),
        ("commands on them that took effect", f"{1.0 - refused / max(1, given):.0%} of {given}"),
        *(
            (f"axes with the promise of {_after(key)}", _share(tally[key], tally["axes"]))
            for key in _keys(tally, "promise")
        ),
    ]
    rows += [(f"rule: {rule}", f"{tally[f'rule: {rule}'] or 'NEVER EXERCISED'}") for rule in RULES]
    for kind in ("done", "interrupted", "cause", "mishap", "limit", "legal, refused"):
        rows += [(key, f"{tally[key]}") for key in _keys(tally, kind)]
    return rows


def unexercised(total: Sum) -> list[str]:
    """Rules of drawn cells that were never exercised, although there were enough scenarios."""
    few = total.scenarios[drawn.SCENE] < FEW
    return [] if few else [rule for rule in RULES if not total.tally[f"rule: {rule}"]]


def _keys(tally: Counter[str], kind: str) -> list[str]:
    return sorted(key for key in tally if key.startswith(f"{kind}: ") and tally[key])


def _after(key: str) -> str:
    return key.partition(": ")[2]


def _share(part: int, whole: int) -> str:
    return f"{part / max(1, whole):.0%}"


def shrunk(seed: int, kind: Kind) -> str:
    """A failing seed as a script that is as short as it can be."""
    made = script_of(seed, kind)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        violation = run(made, folder).violation
        return told(*shrink(made, violation, folder)) if violation else _unchanged(made)


def _unchanged(made: Script) -> str:
    return f"it fails by an exception: {made!r}"


def campaign(seeds: Sequence[int], jobs: int, kind: Kind) -> Sum:
    """Play all seeds; progress goes to standard error."""
    total, began = Sum(), time.monotonic()
    for number, outcome in enumerate(outcomes(seeds, jobs, kind), start=1):
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


def self_test(names: Sequence[str], seeds: Sequence[int], jobs: int, kind: Kind) -> int:
    """Let each mutant be looked for; return how many were not noticed."""
    missed = 0
    for name in names:
        seen, played = Counter[str](), 0
        for outcome in outcomes(seeds, jobs, kind._replace(only=drawn.SCENE, mutant=name)):
            played += 1
            if outcome.finding:
                seen[outcome.finding] += 1
                break
        found = ", ".join(f"{rule} (seed {outcome.seed})" for rule in seen)
        missed += not seen
        print(
            f"{name:24} {f'noticed after {played}: {found}' if seen else f'NOT NOTICED in {played}'}",
            flush=True,
        )
    return missed


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", type=int, default=None)
    parser.add_argument(
        "--first", type=int, default=None, help="the first seed; without, another one in each run"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--shrink", type=int, default=MOST_SHRUNK, help="how many failures to shrink")
    parser.add_argument("--scene", default="", help="only this kind of cell")
    parser.add_argument(
        "--mutant", default="", choices=["", "all", *MUTANTS], help="look for this change of the product"
    )
    parser.add_argument(
        "--usual",
        default="",
        help="fields of AxisRecipe, by commas, which drawn cells have as usual: to leave out known faults",
    )
    given = parser.parse_args()
    kind = Kind(given.scene, tuple(filter(None, given.usual.split(","))))
    given.scenarios = given.scenarios or (BY_MUTANT if given.mutant else 10_000)
    first = given.first if given.first is not None else time.time_ns() % 1_000_000_000
    print(f"seeds {first} to {first + given.scenarios - 1}")
    if given.mutant:
        names = list(MUTANTS) if given.mutant == "all" else [given.mutant]
        return 1 if self_test(names, range(first, first + given.scenarios), given.jobs, kind) else 0
    began = time.monotonic()
    total = campaign(range(first, first + given.scenarios), given.jobs, kind)
    _quiet()
    first_of_each = [seeds[0] for seeds in total.found.values()]
    shown = [*first_of_each, *(seed for seed in total.failed if seed not in first_of_each)][: given.shrink]
    for seed in shown:
        print(f"\nseed {seed}: {shrunk(seed, kind)}")
    if more := sorted(set(total.failed).difference(shown)):
        print(f"\nmore seeds that fail: {more}")
    print(report(total, time.monotonic() - began))
    return 1 if total.findings or unexercised(total) else 0


if __name__ == "__main__":
    sys.exit(main())
