"""``axisbus examples``: the list, and copies that never replace what the user has changed."""

from __future__ import annotations

import json

import pytest

from axisbus.cli import examples
from kit.pages import ROOT

NAMES = {path.relative_to(ROOT / "examples").as_posix() for path in examples._files()}


def test_the_list_says_what_each_program_and_cell_file_shows(axisbus):
    ran = axisbus("examples", "list", "--json")
    found = json.loads(ran.out)
    assert set(found) == NAMES
    assert {"cell.toml", "velocity.py", "testing/program.py", "zenoh/cell.json5"} <= NAMES
    silent = {name for name, text in found.items() if not text}
    assert {name.rpartition(".")[2] for name in silent} <= {"json", "json5", "png", "sh"}
    assert found["velocity.py"] == "Profile velocity and jogging: the axis turns until the next command"
    assert all(name in axisbus("examples", "list").out for name in NAMES)


def test_copies_have_the_same_contents_and_may_be_made_twice(axisbus, tmp_path):
    for _ in range(2):
        ran = axisbus("examples", "copy", str(tmp_path / "new" / "place"))
        assert ran.code == 0
        assert f"{len(NAMES)} files copied" in ran.out
    copied = {
        path.relative_to(tmp_path / "new" / "place").as_posix() for path in (tmp_path / "new").rglob("*.*")
    }
    assert copied == NAMES
    for name in NAMES:
        assert (tmp_path / "new" / "place" / name).read_bytes() == (ROOT / "examples" / name).read_bytes()


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_nothing_is_copied_over_a_file_that_was_changed(axisbus, tmp_path, kind):
    mine = tmp_path / "cell.toml"
    if kind == "file":
        mine.write_text("my own")
    else:
        mine.mkdir()
    ran = axisbus("examples", "copy", str(tmp_path))
    assert ran.code == 1
    assert "cell.toml already exists" in ran.err
    assert "nothing was copied" in ran.err
    assert list(tmp_path.iterdir()) == [mine]
