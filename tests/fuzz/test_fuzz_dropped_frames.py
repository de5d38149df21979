"""Dropped frames are shown: in ``monitor`` at each refresh and at its end, once a second at most for each reason."""

from __future__ import annotations

import json

import can

from axisbus.cia301.dropped_frames import DropNews, DropReason, Drops, words
from axisbus.cli.monitor import axes as monitor
from kit.faulty_node import MadNode, close
from kit.scenarios.simulated_bus import Line, until


def test_the_same_reason_and_node_are_reported_once_in_a_second():
    drops, news = Drops(), DropNews()
    told = []
    for step in range(300):
        drops.note(DropReason.SHORT_PDO, 2, 0.01 * step, 0x182, b"\x37")
        told += [words([drop]) for drop in news.take(drops.found, 0.01 * step)]
    assert told == [
        "dropped: 1 PDO too short for its mapping (node 2)",
        "dropped: 101 PDOs too short for their mapping (node 2)",
        "dropped: 201 PDOs too short for their mapping (node 2)",
    ]
    drops.note(DropReason.EMCY, 5, 3.0, 0x85)
    assert [drop.node for drop in news.take(drops.found, 2.5)] == [5]
    assert [drop.node for drop in news.take(drops.found, 9.0)] == [2]
    assert news.take(drops.found, 20.0) == []


FRAMES = [
    can.Message(arbitration_id=0x082, data=b"\x11", is_extended_id=False),
    can.Message(arbitration_id=0x182, data=b"\x37", is_extended_id=False),
    can.Message(
        arbitration_id=0x185, data=b"\x37", is_extended_id=False
    ),  # of a node that the cell does not have
]


def test_monitor_prints_dropped_frames_at_each_refresh_and_at_its_end(tmp_path, axisbus):
    with Line(tmp_path, "xy") as line, MadNode(line.channel, FRAMES, 0.02):
        code, out, _ = axisbus("monitor", line.file, "--every", "0.2", "--count", "3")
    assert code == 0
    told = [each.strip() for each in out.splitlines() if "dropped:" in each]
    assert 2 <= len(told) <= 3
    for text in (told[0], told[-1]):
        assert "EMCYs without an error code (node 2)" in text
    assert "node 5" not in out
    assert out.splitlines()[-2] == told[-1]


def test_monitor_as_json_contains_dropped_frames(tmp_path, axisbus):
    with Line(tmp_path, "xy") as line, MadNode(line.channel, FRAMES, 0.02):
        _, out, _ = axisbus("monitor", line.file, "--every", "0.2", "--count", "1", "--json")
    axis, _ = json.loads(out)
    (drop,) = [each for each in axis["dropped"] if each["fault"] == "emcy"]
    assert (drop["node"], drop["cob_id"], drop["data"]) == (2, 0x082, "11")
    assert drop["count"] >= 1


def storm(count: int) -> list[can.Message]:
    data = bytes.fromhex("2043080000000000")
    return [can.Message(arbitration_id=0x082, data=data, is_extended_id=False)] * count


def test_a_storm_of_emergencies_does_not_fill_the_screen(tmp_path):
    with Line(tmp_path, "xy") as line:
        machine = line.open()
        try:
            with MadNode(line.channel, storm(1), 0.005):
                until(lambda: len(machine.node(2).incidents) > 8, 20)
            told: set[str] = set()
            lines = monitor.new_lines(machine, told)
            assert sum("node 2, incident" in each for each in lines) == 3
            assert any(" more incidents of node 2, before these:" in each for each in lines)
            assert len(told) < 100
            assert not [each for each in monitor.new_lines(machine, told) if "incident" in each]
        finally:
            close(machine)
