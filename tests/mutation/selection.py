"""Which mutants are tried, and with which tests each."""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Iterator
from pathlib import Path

from mutation.equivalent import Equivalent
from mutation.linemap import LineMap
from mutation.mutant import Mutant
from mutation.mutation_points import names_of
from mutation.operators import mutants

ENOUGH = 75.0  # seconds of tests, by their measured times, that a mutant has to get through


def every(root: Path, packages: tuple[Path, ...]) -> Iterator[Mutant]:
    """Yield all mutants of the packages, always in the same order."""
    for package in packages:
        for file in sorted(package.rglob("*.py")):
            yield from mutants(str(file.relative_to(root)), file.read_text())


def select(found: list[Mutant], only: str) -> list[Mutant]:
    """Return those of a file or folder, or of some lines of a file: ``FILE``, ``FILE:LINE``, ``FILE:FIRST-LAST``."""
    file, _, lines = only.partition(":")
    first, _, last = lines.partition("-")
    chosen = [mutant for mutant in found if file in mutant.file]
    if lines:
        chosen = [mutant for mutant in chosen if int(first) <= mutant.line <= int(last or first)]
    if not chosen:
        raise SystemExit(f"no mutant is in {only}: give a part of a path, FILE:LINE or FILE:FIRST-LAST")
    return chosen


def draw(found: list[Mutant], count: int, seed: int) -> list[Mutant]:
    """Return ``count`` of them, the same for the same seed."""
    return sorted(random.Random(seed).sample(found, min(count, len(found))))


def without(found: list[Mutant], equivalents: list[Equivalent], texts: dict[str, str]) -> list[Mutant]:
    """Return those that are not known to change nothing."""
    return [m for m in found if not any(entry.matches(m, texts[m.file]) for entry in equivalents)]


def tests_for(mutant: Mutant, known: LineMap, enough: float) -> list[str]:
    """Return the tests that concern a mutant, the fastest first, as many as fit into the time.

    They are those that execute its statement. Code executed at import only concerns tests that execute a line with its name, or
    with that of a constant made of it, and the tests that import its module.
    """
    found = known.tests(mutant.file, *mutant.lines)
    # Imports of a test's child process do not concern that test alone; a function may be called at import only.
    if mutant.names or known.at_import(mutant.file, *mutant.lines):
        users = _users(_made_of(mutant.names[-1:], known.texts.get(mutant.file, "")), known)
        importers = _importers(mutant.file, known) or _users(set(mutant.names), known)
        concerned = {*found, *users, *importers}
        found = sorted(concerned, key=lambda test: (test not in importers, known.times[test], test))
    total, chosen = 0.0, []
    for test in found:
        total += known.times[test]
        if chosen and total > enough:
            break
        chosen.append(test)
    return chosen


def _made_of(names: tuple[str, ...], text: str) -> set[str]:
    """Return these names and those of the module's constants that are made of them, one of the other."""
    found, statements = set(names), ast.parse(text).body
    for _ in statements:
        more = {
            name for statement in statements for name in names_of(statement) if found & _mentioned(statement)
        } - found
        if not more:
            break
        found |= more
    return found


def _mentioned(statement: ast.stmt) -> set[str]:
    return {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)}


def _users(names: set[str], known: LineMap) -> set[str]:
    """Return the tests that execute a line with one of these names."""
    if not names:
        return set()
    word, tests = re.compile(rf"\b(?:{'|'.join(map(re.escape, names))})\b"), set()
    for file, text in known.texts.items():
        for number, line in enumerate(text.splitlines(), 1):
            if word.search(line):
                tests.update(known.tests(file, number, number))
    return tests


def _importers(file: str, known: LineMap) -> set[str]:
    """Return the tests of the files that import the module themselves."""
    package, module = re.escape(".".join(Path(file).parts[1:-1])), Path(file).stem
    names = rf"from {package} import (?:\([^)]*|[^\n]*)\b{module}\b|{package}\.{module}\b"
    files = {name for name, text in known.test_texts.items() if re.search(names, text)}
    return {test for test in known.times if test.split("::")[0] in files}
