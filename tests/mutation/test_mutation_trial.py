"""From the draw to the verdict: the same draw for the same seed, and a survivor that is reported as one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mutation import equivalent, linemap, selection
from mutation.code_swap import Functions, compile_quietly
from mutation.linemap import LineMap
from mutation.operators import mutants

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PACKAGES = (ROOT / "src" / "axisbus" / "cia402",)
SOURCE = "def f(a):\n    return a < 3\n\n\nclass G:\n    def h(self, a):\n        return a < 3\n"


def test_a_draw_is_the_same_for_the_same_seed() -> None:
    found = list(selection.every(ROOT, PACKAGES))
    drawn = selection.draw(found, 50, 1)
    assert drawn == selection.draw(list(selection.every(ROOT, PACKAGES)), 50, 1)
    assert len(set(drawn)) == 50
    assert drawn != selection.draw(found, 50, 2)
    assert selection.draw(found, 10**6, 1) == sorted(found)


def test_some_lines_can_be_chosen() -> None:
    found = mutants("a/f.py", SOURCE)
    assert {mutant.line for mutant in selection.select(found, "f.py")} == {2, 7}
    assert {mutant.line for mutant in selection.select(found, "f.py:7")} == {7}
    assert {mutant.line for mutant in selection.select(found, "a/f.py:1-6")} == {2}
    with pytest.raises(SystemExit, match=r"no mutant is in f\.py:3"):
        selection.select(found, "f.py:3")


def entry(text: str, folder: Path) -> list[equivalent.Equivalent]:
    """Return the entries of a file with this text."""
    path = folder / "equivalent.toml"
    path.write_text(text)
    return equivalent.load(path)


ENTRY = (
    '[[mutant]]\nfile = "f.py"\nline = "return a < 3"\nchange = "< -> <="\nreason = "nobody asks with 3"\n'
)


def test_a_mutant_that_changes_nothing_is_not_drawn(tmp_path: Path) -> None:
    found, texts = mutants("f.py", SOURCE), {"f.py": SOURCE}
    left = selection.without(found, entry(ENTRY, tmp_path), texts)
    assert {(m.line, m.change(SOURCE)) for m in set(found) - set(left)} == {(2, "< -> <="), (7, "< -> <=")}
    left = selection.without(found, entry(ENTRY + 'inside = "G.h"\n', tmp_path), texts)
    assert {(m.line, m.change(SOURCE)) for m in set(found) - set(left)} == {(7, "< -> <=")}


@pytest.mark.parametrize(
    ("old", "new"),
    [("f.py", "g.py"), ("a < 3", "a < 4"), ("< -> <=", "<= -> <"), ('inside = "G.h"', 'inside = "G.i"')],
)
def test_an_entry_that_matches_nothing_is_found(old: str, new: str, tmp_path: Path) -> None:
    found, texts = mutants("f.py", SOURCE), {"f.py": SOURCE}
    whole = ENTRY + 'inside = "G.h"\n'
    assert equivalent.stale(entry(whole, tmp_path), found, texts) == []
    entries = entry(whole.replace(old, new), tmp_path)
    assert equivalent.stale(entries, found, texts) == entries


def test_an_entry_without_a_reason_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="reason"):
        entry(ENTRY.replace("nobody asks with 3", " "), tmp_path)


def test_the_listed_mutants_are_those_of_the_source_of_today() -> None:
    entries = equivalent.load(HERE / "equivalent.toml")
    files = sorted({one.file for one in entries})
    found = [mutant for file in files for mutant in mutants(file, (ROOT / file).read_text())]
    assert equivalent.stale(entries, found, {file: (ROOT / file).read_text() for file in files}) == []


def test_the_tests_of_a_line_move_with_it() -> None:
    known = LineMap(times={"slow": 2.0, "fast": 1.0, "other": 1.0})
    known.texts["f.py"] = "a\nb\nc\nd\ne\nf\n"
    known.lines["f.py"] = {1: {""}, 2: {"slow", "fast"}, 6: {"other"}}
    known.follow("f.py", "new\na\nb\nc\nd\ne\nf\n")
    assert known.tests("f.py", 3, 3) == ["fast", "slow"]
    assert known.tests("f.py", 7, 7) == ["other"]
    assert known.at_import("f.py", 2, 2)
    known.follow("f.py", "new\na\nchanged\nmore\nc\nd\ne\nf\n")
    assert known.tests("f.py", 4, 4) == ["fast", "slow"]
    assert not known.at_import("f.py", 8, 8)


def test_the_map_is_read_as_it_was_written(tmp_path: Path) -> None:
    known = LineMap(
        {"a": 1.0, "b": 2.0}, {"f.py": "x\n"}, {"f.py": {1: {"", "a"}, 2: {"b"}}}, {"test_f.py": "0"}
    )
    known.save(tmp_path / "folder" / "map.json")
    assert linemap.load(tmp_path / "folder" / "map.json") == known
    known.forget("a")
    assert known.tests("f.py", 1, 2) == ["b"]


def test_a_constant_concerns_the_tests_of_its_users() -> None:
    source = "LIMIT = 3\n"
    [mutant, _] = mutants("f.py", source)
    known = LineMap(
        {"a": 1.0, "b": 2.0, "c": 80.0}, {"f.py": source, "g.py": "x = LIMIT\ny = 1\nz = LIMIT\n"}
    )
    known.lines = {"f.py": {1: {""}}, "g.py": {1: {"b", "c"}, 2: {"a"}}}
    assert selection.tests_for(mutant, known, 90.0) == ["b", "c"]
    assert selection.tests_for(mutant, known, 75.0) == ["b"]


def test_a_constant_concerns_the_tests_of_derived_constants_and_of_its_module() -> None:
    source = "LIMIT = 3\n_WAYS = {LIMIT: 1}\n_ALL = [*_WAYS]\nOTHER = 1\n"
    file = "src/axisbus/cia402/f.py"
    mutant = mutants(file, source)[0]
    tests = {"test_a.py::a": 1.0, "test_a.py::b": 2.0, "test_c.py::c": 3.0, "test_d.py::d": 4.0}
    known = LineMap(tests, {file: source, "g.py": "_ALL\nOTHER\n"})
    known.lines = {"g.py": {1: {"test_c.py::c"}, 2: {"test_d.py::d"}}}
    known.test_texts = {
        "test_a.py": "from axisbus.cia402 import (\n    e,\n    f,\n)",
        "test_d.py": "from axisbus.cia402 import ff",
    }
    assert selection.tests_for(mutant, known, 90.0) == ["test_a.py::a", "test_a.py::b", "test_c.py::c"]
    known.lines[file] = {1: {"", "test_d.py::d"}}  # imported by a child process of that test
    assert selection.tests_for(mutant, known, 90.0) == [
        "test_a.py::a",
        "test_a.py::b",
        "test_c.py::c",
        "test_d.py::d",
    ]
    known.lines[file] = {}
    known.test_texts["test_d.py"] = "import axisbus.cia402.f"
    assert selection.tests_for(mutant, known, 90.0)[2] == "test_d.py::d"


def test_a_function_that_is_called_at_import_only_concerns_the_tests_that_import_it() -> None:
    source = "def table():\n    return 3\nROWS = table()\n"
    file = "src/axisbus/cia402/f.py"
    mutant = next(one for one in mutants(file, source) if one.line == 2)
    known = LineMap({"test_a.py::a": 1.0, "test_b.py::b": 2.0}, {file: source})
    known.test_texts = {
        "test_a.py": "from axisbus.cia402 import f",
        "test_b.py": "from axisbus.cia402 import g",
    }
    known.lines[file] = {2: set()}
    assert selection.tests_for(mutant, known, 90.0) == []
    known.lines[file] = {2: {""}}
    assert selection.tests_for(mutant, known, 90.0) == ["test_a.py::a"]


def test_only_the_changed_function_is_swapped(tmp_path: Path) -> None:
    path = str(tmp_path / "f.py")
    text = "A = 1\ndef f(a):\n    for b in a:\n        a()\n    return [c for c in a]\ndef g(a=A):\n    return a\n"
    there: dict[str, object] = {}
    exec(compile_quietly(text, path), there)
    functions = Functions(str(tmp_path))

    def changed(mutated: str) -> list[str] | None:
        changes = functions.changes(path, text, mutated)
        return None if changes is None else [function.__name__ for function, _ in changes]

    assert changed(text.replace("a()\n", "a()\n        break\n")) == ["f"]
    assert changed(text.replace("[c for", "[a for")) == ["f"]
    assert changed(text.replace("return a\n", "return None\n")) == ["g"]
    assert changed(text.replace("A = 1", "A = 2")) is None
    assert changed(text.replace("a=A", "a=0")) is None


PROGRAM = """\
import sys
from pathlib import Path
import pytest
from mutation import linemap, process_run, selection
from mutation.fresh_imports import OPTIONS
from mutation.report import Report
from mutation.trial import Trial
if __name__ == "__main__":
    root, process_run.LEAST_TIME, linemap.PROCESSES = Path.cwd(), 1.0, "1"
    packages = (root / "src" / "planted",)
    files = [root / "tests" / "test_planted.py"]
    known = linemap.up_to_date(root / "map.json", root, packages, files)
    chosen = [m for m in selection.every(root, packages) if m.kind in ("number", "sign")]
    report = Report(root, len(chosen), sys.stdout)
    trial = Trial(root, chosen, known, report.tell, jobs=2, enough=9.0)
    pytest.main(["tests", *OPTIONS], plugins=[trial])
    report.finish()
"""
PLANTED = """\
STEP = 5


def forward(count):
    return count + STEP


def wait(count):
    while count:
        count -= 1


def never(count):
    return count + 7


def unseen(count):
    return count - 9
"""
TESTS = """\
import os
import planted
def test_forward():
    assert planted.forward(1) == 6
def test_wait():
    planted.wait(4)
def test_unseen():
    planted.unseen(1)
def test_that_fails_without_a_mutant_too():
    planted.unseen(1)
    assert "PYTEST_DEBUG_TEMPROOT" not in os.environ
"""


def test_a_planted_mutant_that_no_test_notices_is_reported_as_a_survivor(tmp_path: Path) -> None:
    (tmp_path / "src" / "planted").mkdir(parents=True)
    (tmp_path / "src" / "planted" / "__init__.py").write_text(PLANTED)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_planted.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    path = os.pathsep.join([str(tmp_path / "src"), str(HERE.parent)])
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        cwd=tmp_path,
        env={k: v for k, v in os.environ.items() if "PYTEST" not in k} | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    first, _, survivors = ran.stdout.partition("survived:")
    assert "planted/__init__.py:1 number: killed: tests/test_planted.py::test_forward fails" in first, ran
    assert "planted/__init__.py:5 sign: killed: tests/test_planted.py::test_forward fails" in first
    assert "planted/__init__.py:10 sign: killed: tests/test_planted.py::test_wait takes too long" in first
    assert "+    return count + 8" in survivors
    assert "none executes this line" in survivors
    assert "-    return count - 9\n+    return count + 9" in survivors
    assert "2 of tests/test_planted.py" in survivors
    assert "STEP" not in survivors
