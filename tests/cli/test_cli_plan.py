"""``axisbus plan``: the timetable of a cell as lines, as JSON and as a picture, with nothing opened."""

from __future__ import annotations

import json
import re

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.machine.machine import Machine
from kit import command_line


@pytest.fixture
def axisbus(monkeypatch, capsys) -> command_line.Run:
    for opened in ((Machine, "open"), (Channel, "open")):
        monkeypatch.setattr(*opened, lambda *_, **__: pytest.fail("it was opened"))
    return command_line.runner(monkeypatch, capsys)


def test_the_frames_of_a_cycle_are_printed_in_the_order_of_the_bus(axisbus):
    code, out, _ = axisbus("plan", command_line.CELL)
    assert code == 0
    rows = re.findall(
        r"^ +(\d+) +(\d+)  ([0-9A-F]{3})h  (\S*) +(SYNC|[TR]PDO\d|heartbeat)", out, re.MULTILINE
    )
    assert len(rows) > 10
    assert [row[2] for row in rows] == sorted(row[2] for row in rows)
    assert all(int(begin) < int(end) for begin, end, *_ in rows)
    assert [int(row[0]) for row in rows[1:]] == [int(row[1]) for row in rows[:-1]]
    assert re.search(r"181h  x +TPDO1 +Statusword, .*Position actual value", out)
    assert re.search(r'the shortest scan_period that the wire allows: "[\d.]+ms"', out)


def test_json_has_the_same(axisbus):
    code, out, _ = axisbus("plan", command_line.CELL, "--json")
    assert code == 0
    found = json.loads(out)
    assert found["fits"] is True
    assert found["slots"][0]["kind"] == "SYNC"
    assert found["slots"][-1]["end"] == found["fullest"] < found["period"]
    assert found["shortest"] < found["period"]


def test_an_overloaded_cycle_is_reported_and_ends_with_1(axisbus):
    code, out, _ = axisbus("plan", command_line.CELL, "-b", "125000")
    assert code == 1
    assert "IT DOES NOT FIT" in out
    assert re.search(r'"[\d.]+ms" with bitrate = 1_000_000', out)


def test_a_picture_is_drawn(axisbus, tmp_path):
    pytest.importorskip("matplotlib")
    for name, begin in (("plan.png", b"\x89PNG"), ("plan.svg", b"<?xml")):
        code, out, _ = axisbus("plan", command_line.CELL, "-o", tmp_path / name)
        assert code == 0
        assert f"written: {tmp_path / name}" in out
        data = (tmp_path / name).read_bytes()
        assert data.startswith(begin)
        assert len(data) > 10_000
    code, _, err = axisbus("plan", command_line.CELL, "-o", tmp_path / "plan.png")
    assert code == 1
    assert "already exists" in err


@pytest.mark.parametrize("command", ["plan", "jitter"])
def test_an_unknown_picture_format_is_refused_before_any_work(axisbus, tmp_path, command):
    code, _, said = axisbus(command, command_line.CELL, "-o", str(tmp_path / "x.bin"))
    assert code == 1
    assert "x.bin is not a picture that can be drawn" in said
    assert not (tmp_path / "x.bin").exists()
