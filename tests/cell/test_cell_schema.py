"""The JSON Schema of cell files accepts the values that the reader accepts, and refuses errors that an editor can know."""

from __future__ import annotations

import datetime as dt
import json
import math
import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.cell import key_descriptions, reader, schema
from axisbus.cell.json_schema import schema_of_cells
from axisbus.eds.model import Severity
from axisbus.toml import value_readers
from kit import cells, pages
from kit.cells.mistakes import MINIMAL, SLIPS

ROOT = Path(__file__).parents[2]
SCHEMA = schema_of_cells()
FAULTS_FILE = "new_drive.toml"
EXAMPLES = [path for path in (ROOT / "examples").glob("*.toml") if path.name != FAULTS_FILE]
CELLS = sorted([*EXAMPLES, cells.HERE / "clean.toml"])
WHOLE = [tomllib.loads(path.read_text(encoding="utf-8")) for path in CELLS]
VALIDATOR = jsonschema.Draft7Validator(SCHEMA)
TABLES = {
    "BUS": schema.BUS,
    "NODE": schema.node_keys(),
    "PROGRAM": schema.PROGRAM,
    "PDO": schema.PDO,
    "AXIS": schema.AXIS,
    "DEFAULTS": schema.DEFAULTS,
    "HOMING": schema.HOMING,
    "STOP": schema.STOP,
    "FEED_FORWARD": schema.FEED_FORWARD,
    "GROUP": schema.GROUP,
    "KINEMATICS": schema.KINEMATICS,
}
# Rules that the schema does not express: the larger of two numbers, the bounds of a time and of a ratio, a key of other protocols.
BEYOND = re.compile(
    r"exchange or correct them|units are us, ms, s and min|is the (?:shortest|longest)|both an axis and a group|speaks CANopen, and"
)


def plain(value: Any) -> Any:
    """Return TOML as JSON: dates and times are texts."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list):
        return [plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None  # JSON has no such number
    return value.isoformat() if isinstance(value, (dt.date, dt.time)) else value


def refused(text: str) -> list[str]:
    return [error.message for error in VALIDATOR.iter_errors(plain(tomllib.loads(text)))]


def wrong(text: str) -> list[str]:
    """The errors that the reader finds in a text that is TOML."""
    _, problems = reader.loads(text)
    return [f"{each.message}; {each.remedy}" for each in problems if each.severity is Severity.ERROR]


# The clean cell with each defect that the tests of the reader plant in it.
PLANTED = [(old, new) for old, new, *_ in SLIPS]


def test_the_schema_of_the_cell_file_is_a_valid_json_schema() -> None:
    jsonschema.Draft7Validator.check_schema(SCHEMA)
    json.dumps(SCHEMA, allow_nan=False)


@pytest.mark.parametrize("path", CELLS, ids=lambda path: path.name)
def test_good_cells_are_good(path: Path) -> None:
    assert refused(path.read_text(encoding="utf-8")) == []


def test_the_excerpts_on_the_pages_are_good() -> None:
    found = [text for text in pages.cell_excerpts() if "CONFIRM" not in text]
    assert len(found) > 8
    assert [refused(pages.whole_cell(text)) for text in found] == [[]] * len(found)


def test_there_are_planted_mistakes() -> None:
    assert len(PLANTED) > 30


@pytest.mark.parametrize(("old", "new"), PLANTED, ids=[new[:40] for _, new in PLANTED])
def test_a_planted_mistake_is_refused_by_both(old: str, new: str) -> None:
    text = cells.changed(cells.CLEAN, (old, new))
    found = wrong(text)
    assert found
    if not all(BEYOND.search(each) for each in found):
        assert refused(text), found


@pytest.mark.parametrize(
    "text",
    [
        MINIMAL.replace('unit = "deg"', 'unit = "banana"'),
        MINIMAL.replace("scale = 364.0888888888889\n", ""),
        MINIMAL.replace('eds = "builtin:gim6010-8"', ""),
        MINIMAL.replace("scan_period", "period"),
        MINIMAL + "[nodes.1.program]\ndownload = true\n",
        MINIMAL + '[axes."a.b"]\nnode = 1\nunit = "increments"\n',
        MINIMAL + "[nodes.1.pdo.rpdo513]\n",
        MINIMAL + "[nodes.0]\neds = 'x'\n",
        MINIMAL + "[[groups]]\naxes = ['x']\n",
        "",
    ],
    ids=["unit", "scale", "eds", "period", "program", "name", "pdo", "node", "brackets", "empty"],
)
def test_structure(text: str) -> None:
    assert wrong(text)
    assert refused(text)


@pytest.mark.parametrize("name", ["x", "X-1_y", "é", "\u03b1", "9", "x" * 64])
def test_names_of_any_language_are_taken(name: str) -> None:
    text = MINIMAL.replace("[axes.x]", f'[axes."{name}"]')
    assert wrong(text) == refused(text) == []


@pytest.mark.parametrize("table", TABLES)
def test_each_key_has_its_words(table: str) -> None:
    assert list(getattr(key_descriptions, table)) == list(TABLES[table])
    assert all(getattr(key_descriptions, table).values())


# -- each key alone ------------------------------------------------------------------------------------------------------------

KEYS = [(table, key) for table, keys in TABLES.items() for key in keys]
texts = st.one_of(
    st.sampled_from(
        ("4ms", " 2.5 s ", "500 µs", "1min", "4", "1e3ms", "131072/360", "2.5 / 0.1", "1/0", "", " ")
    ),
    st.sampled_from(("deg", "ramp", "pp", "brake", "off", "external", "auto", "on-change", "cell")),
    st.text(max_size=8),
)
numbers = st.one_of(
    st.integers(-300, 300), st.integers(), st.floats(), st.sampled_from([0x7FF, 1_000_000, 10**15, 10**16])
)
single = st.one_of(texts, numbers, st.booleans(), st.dates(), st.times(), st.datetimes())
anything = st.one_of(single, st.lists(single, max_size=3), st.dictionaries(texts, single, max_size=2))


def taken(read: value_readers.ValueReader, value: Any) -> bool:
    try:
        read(value)
    except value_readers.InvalidValue:
        return False
    return True


@cache
def validator(table: str, key: str) -> jsonschema.Draft7Validator:
    """The schema of one key alone."""
    return jsonschema.Draft7Validator(dict(TABLES[table][key].read.json))


@cache
def good_ones(key: str) -> list[Any]:
    """Values of the clean cell and the examples under a key of this name."""
    found = []

    def walk(value: Any) -> None:
        for name, each in value.items() if isinstance(value, dict) else ():
            found.extend([each] * (name == key))
            walk(each)

    for cell in WHOLE:
        walk(cell)
    return found


@pytest.mark.parametrize(("table", "key"), KEYS, ids=[f"{table}-{key}" for table, key in KEYS])
@given(data=st.data())
def test_no_value_that_the_reader_accepts_is_refused_by_the_schema(
    table: str, key: str, data: st.DataObject
) -> None:
    read = TABLES[table][key].read
    good = good_ones(key)
    value = data.draw(st.one_of(anything, st.sampled_from(good)) if good else anything)
    valid = validator(table, key).is_valid(plain(value))
    if taken(read, value):
        assert valid


@pytest.mark.parametrize(("table", "key"), KEYS, ids=[f"{table}-{key}" for table, key in KEYS])
@given(value=anything)
def test_a_value_of_another_kind_is_refused(table: str, key: str, value: Any) -> None:
    """Beyond a schema are bounds of times and ratios, the order of two numbers, 1.0 for 1, infinity, and a date in quotes."""
    read = TABLES[table][key].read
    if taken(read, value) or isinstance(value, (dt.date, dt.time, float)):
        return
    valid = validator(table, key).is_valid(plain(value))
    told = json.dumps(dict(read.json))
    if valid and isinstance(value, str):
        assert '"pattern"' in told or '"format"' in told
    elif valid:
        assert isinstance(value, list)
        assert read is value_readers.interval or any(
            isinstance(each, (float, dt.date, dt.time)) for each in value
        )
