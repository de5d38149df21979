"""The boot-up keys of a cell file, and the findings about them."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.cell.reader import loads
from kit import cells

NODE = "[nodes.1]\n"


def node(*lines: str):
    text = "[bus]\ninterface = 'sim'\nscan_period = '4ms'\n[nodes.1]\neds = 'x.eds'\n" + "\n".join(lines)
    cell, problems = loads(text)
    return cell.nodes[1], [each for each in problems if "no axis" not in each.message]


def test_date_and_time_are_those_of_1020():
    """By hand: 1984 was a leap year, so 1985-01-01 is day 366; 01:02:03.004 is 3723004 ms after midnight."""
    made, problems = node("configuration_date = 1985-01-01", "configuration_time = 01:02:03.004")
    assert problems == []
    assert made.version == (366, 3_723_004)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('configuration_date = "2026-03-31"', "a date such as 2026-03-31"),
        ("configuration_date = 1983-12-31", "a date from 1984-01-01 to 2163-06-06"),
        ("configuration_date = 2026-03-31T10:00:00", "a date such as"),
        ("configuration_time = 14", "a time of day such as 14:30:00"),
        ("serial = -1", "a whole number from 0 to 4294967295"),
        ('serial = "A17"', "a whole number"),
        ('restore_defaults = "yes"', "true or false"),
    ],
)
def test_invalid_values_are_errors(line, words):
    _, problems = node(line)
    assert len(problems) == 1
    assert words in problems[0].observed


@pytest.mark.parametrize("word", ["group", "cell", "report"])
def test_the_axes_that_a_lost_node_stops_are_read(word):
    cell, _ = loads(
        f"[bus]\ninterface = 'sim'\nscan_period = '4ms'\non_lost_node = '{word}'\n[nodes.1]\neds = 'x.eds'\n"
    )
    assert cell.bus.on_lost_node == word


def test_an_unknown_word_is_reported_with_the_allowed_words():
    _, problems = loads(
        "[bus]\ninterface = 'sim'\nscan_period = '4ms'\non_lost_node = 'groups'\n[nodes.1]\neds = 'x.eds'\n"
    )
    problem = next(each for each in problems if "on_lost_node" in each.message)
    assert 'did you mean "group"?' in problem.remedy


def test_a_date_without_a_time(tmp_path: Path) -> None:
    path = cells.write(tmp_path, (NODE, NODE + "configuration_date = 2026-03-31\n"))
    problem = cells.only(path, "error", "configuration_date")
    assert "configuration_date is given without the other key" in problem.message


def test_a_drive_without_1020_is_configured_each_time(tmp_path: Path) -> None:
    lines = "configuration_date = 2026-03-31\nconfiguration_time = 14:30:00\n"
    problem = cells.only(cells.write(tmp_path, (NODE, NODE + lines)), "warning", "configuration_date")
    assert "lacks 1020h" in problem.observed


def test_a_drive_without_1011_cannot_restore_its_defaults(tmp_path: Path) -> None:
    path = cells.write(tmp_path, (NODE, NODE + "restore_defaults = true\n"))
    assert "1011h:01" in cells.only(path, "error", "restore_defaults").observed


def test_a_group_with_an_optional_node_is_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("[nodes.2]\n", "[nodes.2]\noptional = true\n"))
    assert cells.serious(path) == []
    assert "cannot be used while node 2 is not present" in cells.note(path, "cannot be used while").message
