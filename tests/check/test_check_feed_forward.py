"""Findings about a feed-forward that a drive cannot take, or that cannot be computed; each cell has one defect."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from axisbus.cell.problem import CellProblem
from axisbus.check.run import check
from axisbus.eds.builtin import resolve
from axisbus.eds.model import Severity
from kit.cell import GENERIC, cell_file, cell_text

ALL = "velocity = true\ninertia = 0.002\ntorque_offset = 1.0\n"
RATED = "rated_torque = 10.0\nmax_torque = 8.0\nmax_acceleration = 1000.0"


def found(
    folder: Path, table: str = ALL, *, axis: str = RATED, eds: str = GENERIC, **changes: str
) -> list[CellProblem]:
    """The errors and warnings of a cell that are about feed-forward."""
    path = folder / "cell.toml"
    more = f"[axes.x.feed_forward]\n{table}" + changes.pop("more", "")
    path.write_text(cell_text("x", eds=eds, axis=axis, more=more, **changes), encoding="utf-8")
    serious = [each for each in check(path) if each.severity is not Severity.NOTE]
    about = ("feed", "60B1h", "60B2h", "torque_offset", "velocities", "rated_torque")
    return [each for each in serious if any(word in each.message for word in about)]


def lacking(folder: Path, *, index: str, **keys: str) -> str:
    """The builtin EDS with one object that is another."""
    text = resolve(GENERIC, folder).read_text(encoding="utf-8")
    start = text.index(f"[{index}]")
    end = text.index("\n[", start)
    block = text[start:end]
    if not keys:
        text = text[:start] + text[end + 1 :]
        text = re.sub(rf"(?m)^\d+=0x{index}\n", lambda found: found[0].replace(index, "2FFF"), text)
        text += block.replace(f"[{index}]", "[2FFF]") + "\n"
    for key, value in keys.items():
        text = text.replace(block, re.sub(rf"(?m)^{key}=.*$", f"{key}={value}", block))
    (folder / "drive.eds").write_text(text, encoding="utf-8")
    return "drive.eds"


def test_a_valid_feed_forward_is_not_reported(tmp_path: Path) -> None:
    assert found(tmp_path) == []
    assert found(tmp_path, "torque_offset = 0.0\n") == []


@pytest.mark.parametrize(("index", "key"), [("60B1", "velocity"), ("60B2", "inertia")])
def test_an_object_that_is_missing(tmp_path: Path, index: str, key: str) -> None:
    (told,) = found(tmp_path, eds=lacking(tmp_path, index=index))
    assert told.severity is Severity.ERROR
    assert f"{index}h" in told.message
    assert "lacks it" in told.observed
    assert (tmp_path / "cell.toml").read_text().split("\n")[told.line - 1].startswith(key)


def test_an_object_that_no_rpdo_can_carry(tmp_path: Path) -> None:
    (told,) = found(tmp_path, eds=lacking(tmp_path, index="60B2", PDOMapping="0"))
    assert told.severity is Severity.ERROR
    assert "no RPDO contains it" in told.observed


def test_a_mapping_that_stays_as_it_is(tmp_path: Path) -> None:
    more = ""
    path = tmp_path / "cell.toml"
    text = cell_text("x", axis=RATED, more=f"[axes.x.feed_forward]\n{ALL}{more}")
    path.write_text(text.replace("[nodes.1]\n", '[nodes.1]\nremap = "never"\n'), encoding="utf-8")
    told = [each for each in check(path) if "feed-forward" in each.message]
    assert {each.severity for each in told} == {Severity.ERROR}
    assert len(told) == 2


def test_an_rpdo_that_does_not_wait_for_sync(tmp_path: Path) -> None:
    more = '[nodes.1.pdo.rpdo3]\nmap = ["60B1", "60B2"]\ntransmission = 255\n'
    told = found(tmp_path, more=more)
    assert [each.severity for each in told] == [Severity.ERROR] * 2
    assert all("its RPDO is event-driven" in each.observed for each in told)
    assert found(tmp_path, more=more.replace("255", "1")) == []


def test_a_bus_without_sync(tmp_path: Path) -> None:
    told = found(tmp_path, bus="sync = false")
    assert [each.severity for each in told] == [Severity.ERROR] * 2
    assert all("sync = false" in each.observed for each in told)


def test_torques_need_the_rated_one(tmp_path: Path) -> None:
    (told,) = found(tmp_path, "inertia = 0.1\n", axis="")
    assert "rated_torque" in told.message
    assert told.severity is Severity.ERROR


def test_a_torque_beyond_the_highest(tmp_path: Path) -> None:
    (told,) = found(tmp_path, "torque_offset = -8.5\n")
    assert (told.severity, "8 N·m" in told.observed) == (Severity.ERROR, True)
    (told,) = found(tmp_path, "inertia = 0.0081\n")
    assert (told.severity, "8.1 N·m" in told.message) == (Severity.WARNING, True)
    assert found(tmp_path, "inertia = 0.0079\n") == []


def test_a_feed_forward_table_that_sets_nothing_is_reported(tmp_path: Path) -> None:
    for table in ("", "velocity = false\n"):
        (told,) = found(tmp_path, table)
        assert "sets no feed-forward" in told.message or "feed_forward" in told.message


def test_an_offset_that_no_mode_adds(tmp_path: Path) -> None:
    told = found(tmp_path, axis=RATED + '\nmodes = ["pp", "csv"]')
    assert [("60B1h" in each.message, each.severity) for each in told] == [(True, Severity.WARNING)]
    assert len(found(tmp_path, axis=RATED + '\nmodes = ["pp"]')) == 2


def test_a_velocity_without_a_known_unit_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    text = cell_text("x", more="[axes.x.feed_forward]\nvelocity = true\n")
    text = text.replace('unit = "deg"\nscale = 100\n', 'unit = "increments"\n')
    path.write_text(text, encoding="utf-8")
    assert any("the unit of velocity of its drive" in each.message for each in check(path))
    path.write_text(text.replace('"increments"\n', '"increments"\nvelocity_scale = 1\n'), encoding="utf-8")
    assert not any("the unit of velocity of its drive" in each.message for each in check(path))


def test_the_load_of_the_bus_counts_its_rpdo(tmp_path: Path) -> None:
    def load(more: str) -> int:
        from axisbus.cell.pdo_plan import travelling
        from axisbus.cell.reader import load as read
        from axisbus.eds import load as eds_of
        from axisbus.eds.dictionary import Dictionary

        path = cell_file(tmp_path, "x", axis=RATED, more=more)
        cell = read(path)
        eds = eds_of(resolve(GENERIC, tmp_path))
        pdos = travelling(cell, cell.nodes[1], eds, Dictionary(eds, 1))
        return sum(receive for receive, _ in pdos)

    assert load(f"[axes.x.feed_forward]\n{ALL}") == load("") + 1
