"""The public names, with their parameters: a change since the last release must be in the changelog.

``public_names.txt`` has the names of the last release; before the first release, those of its preparation. A release writes it
again (``AXISBUS_UPDATE_GOLDEN=1``). Until then, each name that was added, removed or changed is in the section *Unreleased*.
"""

from __future__ import annotations

import importlib
import inspect
import os
import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path

from kit.pages import ROOT

MODULES = (
    *("axisbus", "axisbus.drives", "axisbus.drives.gim6010"),
    *("axisbus.eds", "axisbus.errors", "axisbus.testing"),
)
FILE = Path(__file__).with_name("public_names.txt")
CHANGELOG = ROOT / "CHANGELOG.md"


def parameters(what: object) -> str:
    """The names and kinds of the parameters, and whether they may be left out; empty for what is not called."""
    # The signatures of the classes of errors and of enumerations are those of Python, and change with its version.
    if not callable(what) or (inspect.isclass(what) and issubclass(what, (BaseException, Enum))):
        return ""
    try:
        found = inspect.signature(what).parameters.values()
    except (TypeError, ValueError):
        return ""
    shown = [
        ("*" if each.kind is each.VAR_POSITIONAL else "**" if each.kind is each.VAR_KEYWORD else "")
        + ("keyword " if each.kind is each.KEYWORD_ONLY else "")
        + each.name
        + ("" if each.default is each.empty else "=")
        for each in found
        if each.name != "self"
    ]
    return f"({', '.join(shown)})"


def names() -> Iterator[str]:
    for module in MODULES:
        home = importlib.import_module(module)
        for name in home.__all__:
            what = getattr(home, name)
            yield f"{module}.{name}{parameters(what)}"
            if inspect.isclass(what):
                yield from (f"{module}.{name}.{line}" for line in members(what))


def members(what: type) -> Iterator[str]:
    """The members that the class itself or a class of this project defines."""
    ours = [each for each in what.__mro__ if each.__module__.startswith("axisbus")]
    for name in {name for each in ours for name in vars(each) if not name.startswith("_")}:
        yield name + parameters(inspect.getattr_static(what, name))


def unreleased(text: str) -> str:
    """The section *Unreleased* of a changelog."""
    return text.partition("## [Unreleased]")[2].partition("\n## [")[0]


def unmentioned(before: set[str], now: set[str], section: str) -> list[str]:
    """The changed lines whose name the section does not have in code."""
    mentioned = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`]+)`", section))))
    changed = sorted(before ^ now)
    return [line for line in changed if line.partition("(")[0].rpartition(".")[2] not in mentioned]


def test_a_public_name_changes_only_with_the_changelog():
    now = set(names())
    if os.environ.get("AXISBUS_UPDATE_GOLDEN"):
        FILE.write_text("\n".join(sorted(now)) + "\n", encoding="utf-8")
    before = set(FILE.read_text(encoding="utf-8").split("\n")) - {""}
    missing = unmentioned(before, now, unreleased(CHANGELOG.read_text(encoding="utf-8")))
    assert missing == [], (
        "these public names differ from the last release; name them in CHANGELOG.md, under Unreleased"
    )


def test_a_change_is_noticed_until_the_changelog_names_it():
    before, now = (
        {"axisbus.Axis.halt(mode=)", "axisbus.wait(what)"},
        {"axisbus.Axis.halt(kind=)", "axisbus.wait(what)"},
    )
    text = "# Changelog\n\n## [Unreleased]\n\n- {}\n\n## [0.1.0]\n\n- `Axis.halt` is new\n"
    assert unmentioned(before, now, unreleased(text.format("nothing"))) == sorted(before ^ now)
    assert unmentioned(before, now, unreleased(text.format("`Axis.halt(kind)` was `mode`"))) == []
    assert unmentioned(before, set(), unreleased(text.format("`halt` is gone"))) == ["axisbus.wait(what)"]
