"""docs/cell-file.md has each key of a cell file, with its range, and no other."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import pytest

from axisbus.cell import other_protocols, schema
from axisbus.units import AXIS_UNITS
from kit import pages

PAGE = pages.ROOT / "docs" / "cell-file.md"
TABLES: Mapping[str, schema.Keys] = {
    "## `[bus]`": schema.BUS,
    "## `[nodes.N]`": schema.node_keys(),
    "### `[nodes.N.pdo.NAME]`": schema.PDO,
    "### `[nodes.N.can_simple]`": other_protocols.keys_of("can_simple"),
    "### `[nodes.N.program]`": schema.PROGRAM,
    "## `[axes.NAME]`": schema.AXIS,
    "### `[axes.NAME.defaults]`": schema.DEFAULTS,
    "### `[axes.NAME.homing]`": schema.HOMING,
    "### `[axes.NAME.stop]`": schema.STOP,
    "### `[axes.NAME.feed_forward]`": schema.FEED_FORWARD,
    "## `[groups.NAME]`": schema.GROUP,
    "## `[io.NAME]`": schema.IO,
}
each_table = pytest.mark.parametrize("heading", TABLES, ids=lambda heading: heading.strip("# `"))


def told(heading: str) -> dict[str, list[str]]:
    """The page's row of each key below a heading: value, default, and text."""
    after = pages.text_of(PAGE).split(f"\n{heading}\n")[1]
    section = re.split(r"^##", after, maxsplit=1, flags=re.MULTILINE)[0]
    found = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines()]
    return {cells[0].strip("`"): cells[1:] for cells in found if cells[0].startswith("`") and len(cells) == 4}


def range_of(json: Mapping[str, Any]) -> list[str]:
    """The range of a value by its JSON Schema: bounds of whole numbers and of times, and words, as the page writes them."""
    if json.get("enum") == list(AXIS_UNITS):
        return []  # they are below the table
    if json.get("type") == "integer":
        return [str(json["minimum"]), str(json["maximum"])] if "minimum" in json else []
    if json.get("type") == "boolean":
        return ["true", "false"]
    words = [*json.get("enum", ()), *json.get("examples", ()), *([json["const"]] if "const" in json else [])]
    parts = [*json.get("anyOf", ()), *([json["items"]] if "items" in json else [])]
    return [f'"{word}"' if isinstance(word, str) else "false" for word in words] + [
        text for part in parts for text in range_of(part)
    ]


@each_table
def test_the_page_has_every_key_and_no_other(heading: str) -> None:
    assert set(told(heading)) == set(TABLES[heading])


@each_table
def test_each_key_has_its_range(heading: str) -> None:
    for key, (value, *_) in told(heading).items():
        said = re.findall(r'"[^"]*"|-?\d[\d.]*|true|false', value)
        assert [text for text in range_of(TABLES[heading][key].read.json) if text not in said] == [], key


def test_the_tables_of_keys_name_more_than_a_hundred_ranges() -> None:
    found = [text for keys in TABLES.values() for key in keys.values() for text in range_of(key.read.json)]
    assert len(found) > 100


@each_table
def test_the_page_lists_the_required_keys(heading: str) -> None:
    needed = {key for key, cells in told(heading).items() if cells[1] == "needed"}
    assert needed == {key for key, each in TABLES[heading].items() if each.missing}


def test_the_page_has_every_unit() -> None:
    (sentence,) = re.findall(r"^Units: .*?\n\n", pages.text_of(PAGE), re.DOTALL | re.MULTILINE)
    named = {unit.replace("\u03bc", "\u00b5") for unit in re.findall(r"`([^`]+)`", sentence)}
    assert named == {unit.replace("\u03bc", "\u00b5") for unit in AXIS_UNITS}
