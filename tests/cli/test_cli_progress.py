"""The progress on a terminal while axes move; without a terminal it is not shown."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from axisbus.cli.shared import progress
from axisbus.cli.shared.progress import MoverProgress
from axisbus.errors import StaleError
from axisbus.machine.machine import Machine
from kit import command_line


@dataclass
class FakeAxis:
    """An axis with values of our own; None is unknown."""

    position_: float | None = 0.0
    velocity_: float | None = 0.0
    distance_to_go: float | None = None
    name: str = "x"
    unit: str = "deg"

    @property
    def position(self) -> float:
        return self._known(self.position_)

    @property
    def velocity(self) -> float:
        return self._known(self.velocity_)

    def _known(self, value: float | None) -> float:
        if value is None:
            raise StaleError("unknown", axis="x")
        return value


@dataclass
class FakeHandle:
    busy: bool = True


@pytest.mark.parametrize(
    ("axis", "whole", "text"),
    [
        (FakeAxis(0.0, 0.0, 90.0), 0.0, "x 0.000 deg, 0%, 90.000 deg left"),
        (FakeAxis(45.0, 30.0, 45.0), 90.0, "x 45.000 deg, 50%, 45.000 deg and 1.5 s left"),
        (FakeAxis(-45.0, -30.0, -45.0), 90.0, "x -45.000 deg, 50%, 45.000 deg and 1.5 s left"),
        (FakeAxis(89.9, 0.0, 0.1), 90.0, "x 89.900 deg, 100%, 0.100 deg left"),
        (FakeAxis(45.0, None, 45.0), 90.0, "x 45.000 deg, 50%, 45.000 deg left"),
        (FakeAxis(5.0, 3.0, None), 0.0, "x 5.000 deg"),  # homing
        (FakeAxis(7.0, 0.0, 0.0), 0.0, "x 7.000 deg, 100%, 0.000 deg left"),  # it is there already
        (FakeAxis(None, None, None), 0.0, "x position unknown"),
    ],
)
def test_the_text_of_the_progress_of_a_move(axis, whole, text):
    assert MoverProgress(axis, FakeHandle(), whole).text() == text


def test_an_axis_that_has_arrived_shows_its_position():
    assert MoverProgress(FakeAxis(90.0, 0.0, 0.001), FakeHandle(busy=False), 90.0).text() == "x 90.000 deg"


def test_a_move_on_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr(progress, "is_terminal", lambda: True)
    monkeypatch.setenv("COLUMNS", "200")
    code, out, err = command_line.runner(monkeypatch, capsys)(
        "move", command_line.CELL, "x=60", "y=-30", "--home", "--velocity", "60"
    )
    assert code == 0
    drawn = err.split("\r")
    shares = [int(found[1]) for line in drawn if (found := re.search(r"x \S+ deg, (\d+)%", line))]
    assert len(shares) >= 5
    assert shares == sorted(shares)
    assert (shares[0] < 20, shares[-1] > 60) == (True, True)
    assert any(re.search(r"; y -\S+ deg, \d+%, \S+ deg and \S+ s left", line) for line in drawn)
    assert drawn[-1] == ""
    assert "%" not in out
    assert "x: at 60.0" in out or "x: at 59.9" in out


def test_elsewhere_nothing_is_drawn(monkeypatch, capsys):
    code, _, err = command_line.runner(monkeypatch, capsys)("home", command_line.CELL, "x")
    assert (code, err) == (0, "")


def test_closing_the_terminal_of_a_command_does_not_end_the_motion(monkeypatch):
    def gone(*_, **__):
        raise BrokenPipeError

    monkeypatch.setattr(progress, "is_terminal", lambda: True)
    monkeypatch.setattr(progress.click, "echo", gone)
    with Machine.simulated(command_line.CELL) as cell:
        x = cell["x"]
        x.enable().wait()
        x.home().wait()
        assert x.distance_to_go is None
        handle = x.move_absolute(20.0)
        progress.follow(cell, [MoverProgress(x, handle)])
        assert handle.done
        assert x.distance_to_go == pytest.approx(0.0, abs=0.5)


def test_a_failure_is_raised_behind_the_line(monkeypatch, capsys):
    monkeypatch.setattr(progress, "is_terminal", lambda: True)
    with Machine.simulated(command_line.CELL) as cell:
        x = cell["x"]
        x.enable().wait()
        x.home().wait()
        handle = x.move_absolute(90.0)
        cell.sleep(0.3)
        cell.simulated_node(1).fault(0x4310, 0)
        with pytest.raises(ExceptionGroup):
            progress.follow(cell, [MoverProgress(x, handle)])
    assert capsys.readouterr().err.endswith("\r")
