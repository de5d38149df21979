"""The tests that concern a line: measured once, stored in ``.mutants-map``, and updated with later changes."""

from __future__ import annotations

import difflib
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

from coverage import CoverageData

from mutation import line_coverage

PATIENCE = 2400.0  # seconds that the tests of one folder may take, which is far too long
PROCESSES = "4"  # as in ``make test``: many tests wait for drives in real time


@dataclass
class LineMap:
    """The tests with their times, and per file of the source the text that was measured and the tests of each line."""

    times: dict[str, float] = field(default_factory=dict)  # seconds, of the tests that passed
    texts: dict[str, str] = field(default_factory=dict)  # file -> the text that was measured
    lines: dict[str, dict[int, set[str]]] = field(default_factory=dict)  # "" as a test: at import
    files: dict[str, str] = field(default_factory=dict)  # test file -> hash
    test_texts: dict[str, str] = field(default_factory=dict)  # test file -> its text of today

    def tests(self, file: str, line: int, last: int) -> list[str]:
        """Return the tests that execute one of these lines, the fastest first."""
        by_line = self.lines.get(file, {})
        found = set().union(*(by_line.get(number, set()) for number in range(line, last + 1)))
        return sorted(
            (test for test in found if test in self.times), key=lambda test: (self.times[test], test)
        )

    def at_import(self, file: str, line: int, last: int) -> bool:
        """Whether one of these lines is executed before any test."""
        by_line = self.lines.get(file, {})
        return any("" in by_line.get(number, ()) for number in range(line, last + 1))

    def forget(self, test_file: str) -> None:
        """Drop the tests of a file."""
        gone = {test for test in self.times if test.split("::")[0] == test_file}
        for test in gone:
            del self.times[test]
        for by_line in self.lines.values():
            for tests in by_line.values():
                tests -= gone

    def follow(self, file: str, text: str) -> None:
        """Take the lines of a changed file to where they are now."""
        old, new = self.texts.get(file, "").splitlines(), text.splitlines()
        before, now = self.lines.get(file, {}), {}
        matcher = difflib.SequenceMatcher(None, old, new, autojunk=False)
        for kind, i, j, k, m in matcher.get_opcodes():
            if kind == "equal":
                now.update({k + n + 1: before[i + n + 1] for n in range(j - i) if i + n + 1 in before})
            else:  # the tests of the old lines here, and of the lines around
                near = set().union(*(before.get(n, set()) for n in range(i - 1, j + 3)))
                now.update({n + 1: set(near) for n in range(k, m)})
        self.lines[file], self.texts[file] = now, text

    def save(self, path: Path) -> None:
        """Write it; equal sets of tests once."""
        numbers = {test: number for number, test in enumerate(["", *self.times])}
        sets: dict[tuple[int, ...], int] = {}
        lines = {
            file: {
                line: sets.setdefault(tuple(sorted(numbers[t] for t in tests if t in numbers)), len(sets))
                for line, tests in by_line.items()
            }
            for file, by_line in self.lines.items()
        }
        content = {
            "times": self.times,
            "texts": self.texts,
            "files": self.files,
            "sets": list(sets),
            "lines": lines,
        }
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(content))


def load(path: Path) -> LineMap:
    """Read the saved map; an empty one if there is none."""
    if not path.exists():
        return LineMap()
    content = json.loads(path.read_text())
    names = ["", *content["times"]]
    sets = [{names[number] for number in numbers} for numbers in content["sets"]]
    lines = {
        file: {int(line): set(sets[number]) for line, number in by_line.items()}
        for file, by_line in content["lines"].items()
    }
    return LineMap(content["times"], content["texts"], lines, content["files"])


def up_to_date(
    path: Path, root: Path, packages: tuple[Path, ...], test_files: list[Path], *, fresh: bool = False
) -> LineMap:
    """Return the map at ``path``, after measuring the test files that are new or have changed, all of them if ``fresh``."""
    known = LineMap() if fresh else load(path)
    hashes = {str(file.relative_to(root)): _hash(file) for file in test_files}
    changed = [name for name, is_now in hashes.items() if known.files.get(name) != is_now]
    for package in packages:
        for file in sorted(package.rglob("*.py")):
            name, text = str(file.relative_to(root)), file.read_text()
            if known.texts.get(name) != text:
                known.follow(name, text)
    for name in set(known.files) - (set(hashes) - set(changed)):
        known.forget(name)
        known.files.pop(name)
    for folder, names in groupby(changed, key=lambda name: name.rpartition("/")[0]):
        batch = list(names)
        print(f"measuring which lines the tests of {folder} execute ({len(batch)} files) ...", flush=True)
        _measure(known, root, packages, batch)
        known.files.update({name: hashes[name] for name in batch})
        known.save(path)
    known.test_texts = {str(file.relative_to(root)): file.read_text() for file in test_files}
    known.save(path)
    return known


def _measure(known: LineMap, root: Path, packages: tuple[Path, ...], changed: list[str]) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "start").mkdir()
        (folder / "start" / "sitecustomize.py").write_text(line_coverage.CHILD)
        environment = os.environ | {
            line_coverage.FOLDER: name,
            line_coverage.SOURCES: os.pathsep.join(map(str, packages)),
            "PYTHONPATH": os.pathsep.join(
                [str(folder / "start"), str(root / "src"), str(Path(__file__).parents[1])]
            ),
        }
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "mutation.line_coverage",
            "-n",
            PROCESSES,
            "--dist",
            "loadfile",
        ]
        try:
            subprocess.run(
                [*command, "--timeout", "240", *changed],
                cwd=root,
                env=environment,
                check=False,
                timeout=PATIENCE,
            )
        except subprocess.TimeoutExpired:
            print(f"not all has been measured: some test has not ended within {PATIENCE / 60:.0f} min")
        _take_times(known, folder)
        for file in folder.glob("lines.*"):
            _take_lines(known, file, root)


def _take_times(known: LineMap, folder: Path) -> None:
    for file in folder.glob("times.*.json"):
        for test, (took, passed) in json.loads(file.read_text()).items():
            if passed:
                known.times[test] = took
            else:
                print(f"not counted on, as it did not pass: {test}")


def _take_lines(known: LineMap, file: Path, root: Path) -> None:
    data = CoverageData(str(file))
    data.read()
    for measured in data.measured_files():
        by_line = known.lines.setdefault(str(Path(measured).relative_to(root)), {})
        for line, tests in data.contexts_by_lineno(measured).items():
            by_line.setdefault(line, set()).update(tests)


def _hash(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
