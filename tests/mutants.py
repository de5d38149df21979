"""Small wrong changes of the source, and whether a test notices each. ``make mutants``; ``--help`` lists the options."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import pytest

from mutation import equivalent, linemap, selection
from mutation.fresh_imports import OPTIONS
from mutation.mutant import Mutant
from mutation.report import Report
from mutation.trial import Trial

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "axisbus"
TRIED = tuple(SOURCE / name for name in ("motion", "cia402", "bus", "drives/gim6010/bus"))
MEASURED = (
    *TRIED,
    *(
        SOURCE / name
        for name in (
            "machine",
            "core",
            "cell",
            "boot",
            "check",
            "drives",
            "cia301",
            "cia302",
            "cia305",
            "record",
            "cli",
        )
    ),
)  # the users of a constant
MAP = ROOT / ".mutants-map" / "map.json"
EQUIVALENT = ROOT / "tests" / "mutation" / "equivalent.toml"
NOT_FOR_THESE = {"eds", "sim", "socketcan", "mutation"}  # folders whose tests do not concern the tried code
# Minutes of matrices and of processes that are killed: they come last for every line, and never within the time of a mutant.
TOO_LONG = {"test_scenario_plants.py", "test_scenario_killed_config.py", "test_scenario_zz_golden.py"}
ENOUGH_KILLED = 0.9


def main() -> int:
    """Draw, try, report; return 1 where too many survive."""
    asked = _arguments()
    known = linemap.up_to_date(MAP, ROOT, MEASURED, _test_files(), fresh=asked.fresh)
    chosen = _chosen(asked)
    print(f"{len(chosen)} mutants, seed {asked.seed}, {asked.jobs} at a time", flush=True)
    report = Report(ROOT, len(chosen), os.fdopen(os.dup(1), "w"))
    files = sorted(
        {
            test.split("::")[0]
            for mutant in chosen
            for test in selection.tests_for(mutant, known, asked.enough)
        }
    )
    trial = Trial(ROOT, chosen, known, report.tell, jobs=asked.jobs, enough=asked.enough)
    os.chdir(ROOT)
    code = pytest.main([*files, *OPTIONS], plugins=[trial])
    if len(report.verdicts) != len(chosen):
        raise SystemExit(
            f"only {len(report.verdicts)} of {len(chosen)} could be tried (pytest ended with {code})"
        )
    report.finish()
    return int(report.killed < ENOUGH_KILLED * len(chosen))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=402, help="which mutants are drawn (%(default)s)")
    parser.add_argument("--count", type=int, default=200, help="how many (%(default)s); 0 for all")
    parser.add_argument(
        "--only", metavar="FILE[:LINE[-LINE]]", help="only those of a file or folder, a line or some lines"
    )
    parser.add_argument("--kind", help="only those of one kind")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time (%(default)s)")
    parser.add_argument(
        "--enough",
        type=float,
        default=selection.ENOUGH,
        help="seconds of tests for each mutant (%(default)s)",
    )
    parser.add_argument("--fresh", action="store_true", help="measure anew which tests execute which lines")
    return parser.parse_args()


def _chosen(asked: argparse.Namespace) -> list[Mutant]:
    found = list(selection.every(ROOT, TRIED))
    texts = {mutant.file: (ROOT / mutant.file).read_text() for mutant in found}
    entries = equivalent.load(EQUIVALENT)
    for entry in equivalent.stale(entries, found, texts):
        raise SystemExit(
            f"{EQUIVALENT}: no mutant of {entry.file} changes {entry.line!r} by {entry.change!r}: take the entry out"
        )
    found = selection.without(found, entries, texts)
    if asked.only:
        found = selection.select(found, asked.only)
    if asked.kind:
        found = [mutant for mutant in found if mutant.kind == asked.kind]
    return selection.draw(found, asked.count or len(found), asked.seed)


def _test_files() -> list[Path]:
    files = (ROOT / "tests").rglob("test_*.py")
    return sorted(
        file for file in files if not (NOT_FOR_THESE | TOO_LONG) & set(file.relative_to(ROOT).parts)
    )


if __name__ == "__main__":
    sys.exit(main())
