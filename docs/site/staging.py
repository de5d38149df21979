"""Collect the sources of the site in one folder: the pages of docs/, notebooks, and pages generated from tables of the code."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import cell_toml
import codes
import commands
import eds_rules
import python_names
import symptoms

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent

# The navigation in its order; a page of docs/ that is not listed here is added under the last caption but one.
NAVIGATION: Mapping[str, tuple[str, ...]] = {
    "Guide": ("guide", "commissioning", "raspberry-pi", "symptoms/index"),
    "Using it": ("motion", "stopping", "replacing-drives", "programs", "io", "recordings", "web"),
    "Reference": (
        *("reference/cli/index", "cell-file", "reference/cell-toml", "reference/cell-checks"),
        *("eds-workbench", "reference/eds-rules"),
        *(
            "api/axisbus",
            "api/drives",
            "api/gim6010",
            "api/eds",
            "api/errors",
            "reference/python/index",
            "reference/codes",
        ),
    ),
    "Protocols and modules": ("drives", "gim6010-8", "fleet", "opcua", "ros"),
    "Notebooks": ("examples/first_steps", "examples/tuning_by_capture", "examples/eds_inspection"),
    "Further": (),
    "How it is built": ("architecture", "decisions/*", "glossary"),
}
REST = "Further"
# Titles in the navigation, for pages whose own title is not clear among others.
TITLES = {
    "api/axisbus": "The library: machines and axes",
    "api/drives": "The library: makes of drives",
    "api/gim6010": "The library: MIT control of a GIM6010-8",
    "api/eds": "The library: EDS files",
    "api/errors": "The library: errors",
}

Pages = Mapping[str, str]  # path without suffix -> Markdown
_GENERATED: tuple[Callable[[], Pages], ...] = (
    commands.pages,
    eds_rules.pages,
    cell_toml.pages,
    codes.pages,
    python_names.pages,
)


def stage(source: Path) -> None:
    """Replace the folder of sources."""
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(ROOT / "docs", source, ignore=shutil.ignore_patterns("site", "__pycache__"))
    for path in sorted((ROOT / "examples").glob("*.ipynb")):
        _copy(path, source / "examples")
    _copy(ROOT / "examples" / "cell.toml", source / "examples")
    for path in (ROOT / "eds").glob("*.eds"):
        _copy(path, source / "eds")
    for make in _GENERATED:
        _write(source, make())
    _write(source, symptoms.pages(title_of=lambda page, anchor: _title(source / page, anchor)))
    index = (HERE / "index.txt").read_text(encoding="utf-8")
    (source / "index.md").write_text(f"{index}\n{toctrees(source)}", encoding="utf-8")


def _copy(path: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, folder)


def _write(source: Path, pages: Pages) -> None:
    for name, text in pages.items():
        path = source / f"{name}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _title(path: Path, anchor: str) -> str:
    """Return the title of a page, or the heading of an anchor, by the rule of code hosts and MyST."""
    headings = [
        line.lstrip("#").strip()
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.match("#+ ", line)
    ]
    found = [each.replace("`", "") for each in headings if anchor in ("", _slug(each))]
    if not found:
        raise LookupError(f"{path.name} has no heading {anchor!r}, to which a symptom refers")
    return found[0]


def _slug(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-")


def toctrees(source: Path) -> str:
    """Return the navigation: it contains each page of the sources once, including pages that are not listed here."""
    chosen = {caption: [*_expanded(source, names)] for caption, names in NAVIGATION.items()}
    named = {name for names in chosen.values() for name in names}
    top = sorted(path.stem for path in source.glob("*.md") if path.stem != "index")
    chosen[REST] = [name for name in top if name not in named]
    return "\n".join(_toctree(caption, names) for caption, names in chosen.items() if names)


def _expanded(source: Path, names: Iterable[str]) -> Iterable[str]:
    for name in names:
        if name.endswith("*"):
            yield from sorted(
                path.relative_to(source).with_suffix("").as_posix() for path in source.glob(f"{name}.md")
            )
        elif any((source / f"{name}{suffix}").exists() for suffix in (".md", ".ipynb")):
            yield name


def _toctree(caption: str, names: Iterable[str]) -> str:
    lines = "\n".join(f"{TITLES[name]} <{name}>" if name in TITLES else name for name in names)
    return f"```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{lines}\n```\n"
