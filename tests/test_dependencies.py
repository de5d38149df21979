"""The versions of the dependencies: ``tests/highest.txt`` names each one of users, within the limits of pyproject.toml."""

from __future__ import annotations

import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from kit.pages import ROOT

HIGHEST = Path(__file__).with_name("highest.txt")


def wanted() -> dict[str, SpecifierSet]:
    """The dependencies of the package and of its extras for users, with the versions that pyproject.toml allows."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    texts = [*project["dependencies"], *(text for name in extras.keys() - {"dev"} for text in extras[name])]
    return {each.name: each.specifier for each in map(Requirement, texts)}


def test_the_highest_tested_version_of_each_dependency_is_named_and_allowed():
    lines = HIGHEST.read_text(encoding="utf-8").splitlines()
    named = [Requirement(line) for line in lines if not line.startswith("#")]
    assert [each.name for each in named] == sorted(wanted())
    for each in named:
        (exactly,) = each.specifier
        assert exactly.operator == "=="
        assert wanted()[each.name].contains(exactly.version, prereleases=True), each.name
