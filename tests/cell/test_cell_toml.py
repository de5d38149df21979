"""TOML files: every entry has its line, and a file that cannot be read is reported with file, line and remedy."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from axisbus.errors import ConfigError
from axisbus.toml import document as toml

EVERYTHING = """\
# a comment with [brackets] and = signs
top = 1

[bus]  # a comment after a header
interface = "sim"
"quoted key" = "a # that is no comment"
'literal' = 'C:\\no\\escapes'
options.fd = true
options."data bitrate" = 2

[nodes.1]
eds = '''
[not.a.table]
not_a_key = 1
'''
after = \"\"\"one
two \\\"\"\" three
\"\"\"
map = [
  "6040",   # [ ] " '
  "607A:0", [1,
  2],
]
inline = { a = 1, b = { c = "}" }, d.e = [ 1 ] }

  [ axes . "x y" . homing ]
method = 35
[[list]]
a = 1
[[list]]
a = 2
[list.sub]
b = 3
"""

# Typed by hand, by counting lines.
LINES = {
    ("top",): 2,
    ("bus",): 4,
    ("bus", "interface"): 5,
    ("bus", "quoted key"): 6,
    ("bus", "literal"): 7,
    ("bus", "options"): 8,
    ("bus", "options", "fd"): 8,
    ("bus", "options", "data bitrate"): 9,
    ("nodes",): 11,
    ("nodes", "1"): 11,
    ("nodes", "1", "eds"): 12,
    ("nodes", "1", "after"): 16,
    ("nodes", "1", "map"): 19,
    ("nodes", "1", "map", 0): 20,
    ("nodes", "1", "map", 1): 21,
    ("nodes", "1", "map", 2): 21,
    ("nodes", "1", "map", 2, 1): 22,
    ("nodes", "1", "inline"): 24,
    ("nodes", "1", "inline", "b", "c"): 24,
    ("nodes", "1", "inline", "d", "e", 0): 24,
    ("axes", "x y", "homing"): 26,
    ("axes", "x y", "homing", "method"): 27,
    ("list", 0, "a"): 29,
    ("list", 1): 30,
    ("list", 1, "a"): 31,
    ("list", 1, "sub"): 32,
    ("list", 1, "sub", "b"): 33,
}


def test_every_table_key_and_element_has_its_line() -> None:
    document = toml.loads(EVERYTHING, "cell.toml")
    assert {path: document.lines.get(path) for path in LINES} == LINES
    assert document.data["nodes"]["1"]["after"] == 'one\ntwo """ three\n'


def test_lines_are_the_same_with_the_line_ends_of_windows() -> None:
    document = toml.loads(EVERYTHING.replace("\n", "\r\n"), "cell.toml")
    assert {path: document.lines.get(path) for path in LINES} == LINES


def test_a_path_without_a_line_has_that_of_its_table() -> None:
    document = toml.loads("a = 1\n[b]\nc = 2\n", "cell.toml")
    assert document.line(("b", "missing")) == 2
    assert document.line(("nowhere",)) == 1


def _values(path: tuple[str | int, ...], value: object) -> list[tuple[str | int, ...]]:
    """Every path of a TOML value that has a key or a number of its own."""
    below = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    found: list[tuple[str | int, ...]] = [path] if path else []
    for key, each in below:
        found += _values((*path, key), each)
    return found


BARE = st.text("abcXYZ019_-", min_size=1, max_size=6)
QUOTED = st.text("ab c.#[]={}\"\\'", max_size=6).map(
    lambda text: '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
)
SCALARS = st.sampled_from(
    ["1", "-2.5e3", "true", '"# ] }"', "'\\'", '"\\""', '"""a\n]"b"""', "'''\n'\n'''", "1979-05-27T07:32:00Z"]
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3).map(lambda parts: "[\n" + ",# x ]\n".join(parts) + "\n ]"),
    max_leaves=4,
)


@given(st.lists(st.tuples(BARE | QUOTED, VALUES, st.sampled_from(["", "\n", "# =\n\n"])), max_size=8))
@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # a busy computer is no failure
def test_in_any_text_each_key_has_its_line(pairs: list[tuple[str, str, str]]) -> None:
    text, written = "", {}
    for number, (key, value, gap) in enumerate(pairs):
        name = f'k{number}."' + (key[1:] if key.startswith('"') else f'{key}"')
        written[f"k{number}"] = text.count("\n") + 2  # under the header, which is line 1
        text += f"{name} = {value}\n{gap}"
    document = toml.loads("[t]\n" + text, "cell.toml")
    assert {key: document.line(("t", key)) for key in written} == written
    paths = _values((), document.data)
    assert [path for path in paths if path not in document.lines] == []


# -- unreadable files ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "remedy"),
    [
        ("[bus]\nscan_period = 4ms\n", 2, 'scan_period = "4ms"'),
        ("[bus]\na = 1\nb = 2\na = 3\nc = 4\n", 4, "given twice"),
        ("[nodes.1]\na = 1\n\n[nodes.1]\nb = 2\n", 4, "opened twice"),
        ("[bus\ninterface = 1\n", 1, "]"),
        ("[nodes.1.objects]\n607D:1 = 5\n", 2, '"607D:1" = 5'),
        ('[nodes.1]\neds = "C:\\drives\\x.eds"\n', 2, "single quotes"),
        ('a = 1\n[nodes.1]\neds = "open\n', 3, "quotation mark"),
        ("[axes.x]\nposition_limits = [1, 2\nscale = 3\n", 3, "close the list"),
        ("[axes.x]\nunit = deg\n", 2, "a text in quotes"),
        ("first\n", 1, "key = value"),
    ],
)
def test_invalid_toml_is_reported_with_its_line_and_remedy(text: str, line: int, remedy: str) -> None:
    with pytest.raises(ConfigError) as caught:
        toml.loads(text, "cell.toml")
    assert (caught.value.file, caught.value.line) == ("cell.toml", line), caught.value
    assert str(caught.value).startswith(f"cell.toml:{line}: this is not TOML")
    assert remedy in caught.value.remedy


def test_the_error_for_a_missing_file_names_the_toml_files_in_its_folder(tmp_path: Path) -> None:
    (tmp_path / "cells.toml").write_text("")
    (tmp_path / "other.eds").write_text("")
    with pytest.raises(ConfigError, match="does not exist") as caught:
        toml.load(tmp_path / "cell.toml")
    assert "cells.toml" in caught.value.remedy
    assert "other.eds" not in caught.value.remedy


def test_a_missing_folder_is_reported_as_one(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        toml.load(tmp_path / "nowhere" / "cell.toml")
    assert f"there is no folder {tmp_path / 'nowhere'}" in caught.value.remedy


def test_a_folder_is_no_cell_file(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text("")
    with pytest.raises(ConfigError, match="folder") as caught:
        toml.load(tmp_path)
    assert "cell.toml" in caught.value.remedy


@pytest.mark.parametrize(
    ("data", "line", "words"),
    [
        (b'# fine\nunit = "\xb0"\n', 2, "UTF-8"),
        ("a = 1".encode("utf-16"), 1, "UTF-8"),
        (b"a = " + b"[" * 5000, 0, "nested"),
        (b"a = " + b"1" * 5000, 0, "digits"),
        (b"#" * (2 << 20), 0, "too large"),
    ],
)
def test_the_error_for_other_data_names_its_type(tmp_path: Path, data: bytes, line: int, words: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError) as caught:
        toml.load(path)
    assert words in str(caught.value)
    assert caught.value.line == line
    assert caught.value.remedy


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_bytes(b"\xef\xbb\xbf[bus]\n")
    assert toml.load(path).line(("bus",)) == 1


@pytest.mark.parametrize(
    "path",
    [
        r"C:\drives\x.eds",
        r"C:\Users\me\x.eds",
        r"C:\ulm\x.eds",
        r"C:\new\faults.eds",
        r"\temp.eds",
        r"C:\bin\readme.eds",
        r"\\server\share\x.eds",
    ],
)
@pytest.mark.parametrize("line", ['eds = "{}"', 'eds = [\n  "a",\n  "{}",\n]'])
def test_a_path_with_backslashes_is_reported_with_its_line_and_the_valid_form(path, line):
    text = "[nodes.1]\n" + line.format(path) + "\n"
    with pytest.raises(ConfigError) as told:
        toml.loads(text, "cell.toml")
    assert told.value.line == (4 if "[\n" in line else 2)
    assert told.value.remedy == f"put a path with backslashes in single quotes: '{path}'"
    assert toml.loads(text.replace('"', "'"), "cell.toml").data["nodes"]["1"]["eds"] in (path, ["a", path])


def test_escapes_that_are_no_control_characters_and_texts_of_several_lines_are_read():
    data = toml.loads('a = "C:\\\\new \\u00e4"\nb = """x\ny"""\n', "cell.toml").data
    assert data == {"a": "C:\\new ä", "b": "x\ny"}
