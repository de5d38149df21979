"""Defects planted at random places of clean files are reported on their line, and nothing else is."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from axisbus.eds import EdsFinding, Severity, check
from axisbus.eds.io import reader
from kit.corpus import CORPUS
from kit.eds.planted_defect_rows import EVERY
from kit.eds.planted_defects import KINDS, Plant, Text, plant

OURS = sorted((Path(__file__).parents[2] / "eds").glob("*.eds"))
PLANTS_OF_A_KIND = 5
MISSED = "nothing of"
PlantKind = Callable[[random.Random, Text], Plant | None]


def findings(text: str, name: str) -> tuple[EdsFinding, ...]:
    return check(reader.read(text.encode("latin-1"), name))


@cache
def clean(path: Path) -> Text | None:
    """Return a file in which nothing above a note is found."""
    text = Text.of(path.read_bytes().decode("latin-1"))
    found = findings("\n".join(text.lines), path.name)
    return text if all(each.severity is Severity.NOTE for each in found) else None


@cache
def before(path: Path) -> frozenset[tuple[str, int]]:
    """Return rule and line of the findings in the unchanged file."""
    text = clean(path)
    assert text is not None
    return frozenset((each.rule, each.line) for each in findings("\n".join(text.lines), path.name))


def complaint(path: Path, planted: Plant) -> str:
    """Return the errors of the report on one planted defect; empty if it is right."""
    expected = {(rule, planted.moved.get(line, line)) for rule, line in before(path)}
    where = {planted.moved[line] for line in planted.where}
    found = findings("\n".join(planted.lines), path.name)
    if not any(each.line in where and each.rule in planted.rules for each in found):
        return f"{path.name}: {planted.what}: {MISSED} {planted.rules} in line {where}"
    strange = [each for each in found if each.line not in where and (each.rule, each.line) not in expected]
    return f"{path.name}: {planted.what}: {strange[0]}" if strange else ""


def reports(rng: random.Random, paths: list[Path], kind: PlantKind, most: int, tries: int) -> list[str]:
    """Plant a kind up to so many times; return the complaint about each planted defect, empty if its report is right."""
    found: list[str] = []
    for _ in range(tries):
        path = rng.choice(paths)
        text = clean(path)
        assert text is not None
        planted = plant(rng, text, kind)
        if planted is not None:
            found.append(complaint(path, planted))
        if len(found) == most:
            break
    return found


def run(paths: list[Path], seed: int) -> tuple[list[str], int]:
    """Plant each kind several times over; return the complaints, and how many were planted."""
    rng, found = random.Random(seed), []
    for kind in KINDS:
        of_kind = reports(rng, paths, kind, PLANTS_OF_A_KIND, 40 * PLANTS_OF_A_KIND)
        assert of_kind, f"there is no place for {kind.__name__}"
        found += of_kind
    return [*filter(None, found)], len(found)


@pytest.mark.timeout(240)
@pytest.mark.parametrize("seed", [402, 306])
def test_defects_planted_into_our_own_files(seed: int) -> None:
    assert all(clean(path) is not None for path in OURS)
    complaints, count = run(OURS, seed)
    assert count >= 150
    assert sum(MISSED in each for each in complaints) <= 0.03 * count, "\n".join(complaints)
    assert len(complaints) <= 0.05 * count, "\n".join(complaints)


@pytest.mark.timeout(240)
@pytest.mark.skipif(not CORPUS.is_dir(), reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_defects_planted_into_clean_files_of_many_makers() -> None:
    paths = [path for path in sorted(CORPUS.glob("*.eds")) if clean(path) is not None]
    assert len(paths) >= 5
    complaints, count = run(paths, 301)
    assert len(complaints) <= 0.05 * count, "\n".join(complaints)


def widened(paths: list[Path], seed: int, each: int) -> tuple[list[str], int]:
    """Plant each of the further kinds; return the complaints, and how many were planted."""
    found: list[str] = []
    for name, kind in EVERY.items():
        found += reports(random.Random(f"{seed} {name}"), paths, kind, each, 30 * each)
    return [*filter(None, found)], len(found)


@pytest.mark.timeout(240)
def test_further_kinds_planted_into_our_own_files() -> None:
    complaints, count = widened(OURS, 5, 3)
    assert count >= 200
    assert sum(MISSED in each for each in complaints) <= 0.03 * count, "\n".join(complaints)
    assert len(complaints) <= 0.05 * count, "\n".join(complaints)


@pytest.mark.timeout(240)
@pytest.mark.skipif(not CORPUS.is_dir(), reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_further_kinds_planted_into_clean_files_of_many_makers() -> None:
    paths = [path for path in sorted(CORPUS.glob("*.eds")) if clean(path) is not None]
    complaints, count = widened(paths, 7, 2)
    assert count >= 140
    assert sum(MISSED in each for each in complaints) <= 0.03 * count, "\n".join(complaints)
    assert len(complaints) <= 0.05 * count, "\n".join(complaints)
