"""Read the tables of the standards, which are tab-separated files in the packages."""

from __future__ import annotations

from importlib import resources


def rows(package: str, name: str) -> list[dict[str, str]]:
    """Return the rows of the table ``name`` in ``package`` as dictionaries by column name; ``#`` starts a comment line."""
    text = resources.files(package).joinpath(name).read_text(encoding="utf-8")
    lines = [line.split("\t") for line in text.splitlines() if line and not line.startswith("#")]
    header = lines[0]
    return [dict(zip(header, line, strict=True)) for line in lines[1:]]
