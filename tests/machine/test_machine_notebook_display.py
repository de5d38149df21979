"""The display of a machine, an axis and a command in a notebook: escaped, in units, and never a traceback."""

from __future__ import annotations

import html.parser

import pytest

from axisbus import Machine
from axisbus.errors import StateError
from axisbus.machine.axis import Axis
from axisbus.markup import guarded, table, text
from kit.pages import ROOT

CELL = ROOT / "examples" / "cell.toml"
EVIL = "<script>alert('x')</script>"


class Table(html.parser.HTMLParser):
    """Reads the displayed table: rows of texts, and its elements."""

    def __init__(self, shown: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.elements: set[str] = set()
        self.open: list[str] = []
        self.feed(shown)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.add(tag)
        assert not any("color" in value or "background" in value for _, value in attrs)
        if tag != "br":
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


def shown(thing) -> dict[str, list[str]]:
    """The rows of the display of an object by their heads."""
    read = Table(thing._repr_html_())
    assert read.elements <= {"div", "p", "b", "table", "thead", "tbody", "tr", "th", "td", "br"}
    return {row[0]: row[1:] for row in read.rows}


@pytest.fixture
def cell():
    with Machine.simulated(CELL) as machine:
        yield machine


def test_a_machine_shows_each_axis_in_its_units(cell):
    x = cell["x"]
    x.enable().wait()
    x.home().wait()
    x.move_absolute(12.5).wait()
    rows = shown(cell)
    assert rows["x"][0] == "Standstill"
    assert rows["x"][1].startswith("12.")
    assert rows["x"][1].endswith(" deg")
    assert rows["x"][2].endswith(" deg/s")
    assert rows["x"][3].endswith(" N·m")
    assert rows["x"][4] == "yes"
    assert rows["z"] == ["Disabled", "0 deg", "0 deg/s", "0 N·m", "no"]


def test_an_axis_shows_its_target_and_its_distance_to_go(cell):
    x = cell["x"]
    x.enable().wait()
    x.home().wait()
    assert shown(x)["power"] == ["on"]
    x.move_absolute(90.0)
    cell.sleep(0.3)
    rows = shown(x)
    assert rows["state"] == ["DiscreteMotion"]
    assert rows["target"] == ["90 deg"]
    assert 0.0 < float(rows["distance to go"][0].removesuffix(" deg")) < 90.0


def test_an_unknown_value_is_shown_as_unknown(cell):
    cell["x"].enable().wait()
    cell.close()
    assert shown(cell)["x"] == ["Disabled", "unknown", "unknown", "unknown", "no"]
    assert "unknown because the machine is closed" in cell._repr_html_()
    rows = shown(cell["x"])
    assert rows["position"] == rows["following error"] == ["unknown"]


def test_an_error_is_reported_in_its_own_words(cell):
    x = cell["x"]
    x.enable().wait()
    cell.simulated_node(1).fault(0x4310)
    cell.sleep(1.0)
    told = shown(x)["error"][0]
    assert x.error.message in told
    assert x.error.remedy in told
    assert text(x.error) in cell._repr_html_()


def test_a_command_shows_its_status_and_its_error(cell):
    x = cell["x"]
    x.enable().wait()
    x.home().wait()
    move = x.move_absolute(90.0)
    assert shown(move)["status"] == ["busy"]
    cell.sleep(0.2)
    assert shown(move)["status"] == ["active"]
    x.halt().wait()
    assert shown(move)["status"] == ["aborted"]
    assert shown(move)["error"] == ["x.halt() was asked for"]


def test_texts_of_files_and_drives_are_escaped_in_html(cell, monkeypatch):
    cell["x"].name = EVIL
    error = StateError(f"{EVIL} is wrong", observed=EVIL, remedy=f"{EVIL}\nin two lines & more")
    monkeypatch.setattr(Axis, "error", property(lambda _: error))
    handle = cell["y"].halt()
    handle.name = handle.note = EVIL
    for thing in (cell, cell["x"], handle):
        shown(thing)
        assert EVIL not in thing._repr_html_()


def test_a_failure_while_displaying_a_cell_is_one_line_without_a_traceback(cell, monkeypatch):
    monkeypatch.setattr(Axis, "state", property(lambda _: 1 / 0))
    assert "cannot be displayed (ZeroDivisionError)" in cell._repr_html_()
    assert "cannot be displayed (ZeroDivisionError)" in cell["x"]._repr_html_()


def test_showing_sends_no_request_to_a_drive(cell, monkeypatch):
    asked = []
    monkeypatch.setattr(Axis, "_measure", lambda *what: asked.append(what), raising=False)
    monkeypatch.setattr(type(cell), "node", lambda *what: asked.append(what))
    for thing in (cell, *cell):
        shown(thing)
    assert asked == []


def test_a_table_of_nothing_is_a_table():
    assert Table(table("nothing", [])).rows == []
    assert guarded("what", lambda: "made") == "made"
