"""The last motion, drawn without having been asked for a recording; in virtual time."""

from __future__ import annotations

import gc
import sys

import pytest

from axisbus import Machine, wait
from axisbus.errors import ArgumentError, StateError
from axisbus.record import last_motion
from kit.pages import ROOT

pytest.importorskip("matplotlib")
CELL = ROOT / "examples" / "cell.toml"


@pytest.fixture
def typed(monkeypatch):
    monkeypatch.setattr(sys, "ps1", ">>> ", raising=False)


@pytest.fixture
def cell(typed):
    with Machine.simulated(CELL) as machine:
        wait(axis.enable() for axis in machine)
        wait(machine["x"].home(), machine["y"].home())
        yield machine


def states(picture, axis):
    return list(dict.fromkeys(picture.recorded.tracks[axis].columns["state"]))


def test_outside_an_interactive_session_the_last_motion_is_not_stored():
    with (
        Machine.simulated(CELL) as machine,
        pytest.raises(StateError, match="only in an interactive session") as raised,
    ):
        machine.plot_last()
    assert "begin a recording" in raised.value.remedy


def test_the_last_move_is_drawn_from_before_it_until_after_its_end(cell):
    x = cell["x"]
    x.move_absolute(60.0).wait()
    x.move_absolute(20.0).wait()
    cell.sleep(3.0)
    picture = cell.plot_last()
    track = picture.recorded.tracks["x"]
    assert list(picture.recorded.tracks) == ["x"]
    assert track.columns["position"][0] == pytest.approx(60.0, abs=0.1)
    assert track.columns["position"][-1] == pytest.approx(20.0, abs=0.1)
    assert states(picture, "x") == ["Standstill", "DiscreteMotion"]
    assert picture.title == "x.move_absolute(20 deg)"
    assert 0.7 < picture.recorded.seconds < 1.5
    assert picture._repr_png_().startswith(b"\x89PNG")
    assert len(picture._repr_png_()) > 20_000


def test_a_motion_that_has_not_ended_is_drawn_until_now(cell):
    cell["x"].move_velocity(30.0)
    cell.sleep(1.0)
    track = cell.plot_last().recorded.tracks["x"]
    assert track.columns["state"][-1] == "ContinuousMotion"
    assert track.times[-1] == pytest.approx(1.0, abs=0.3)


def test_moves_that_run_together_are_drawn_together(cell):
    wait(cell["x"].move_absolute(20.0), cell["y"].move_absolute(60.0))
    assert list(cell.plot_last().recorded.tracks) == ["x", "y"]
    assert list(cell.plot_last(axes=["y"]).recorded.tracks) == ["y"]


def test_a_move_that_took_over_is_drawn_with_the_one_before(cell):
    cell["x"].move_absolute(60.0)
    cell.sleep(0.3)
    cell["x"].move_absolute(-10.0).wait()
    assert cell.plot_last().recorded.tracks["x"].columns["position"][0] == pytest.approx(0.0, abs=0.1)


def test_the_given_number_of_seconds_is_drawn(cell):
    cell["x"].move_absolute(20.0).wait()
    cell.sleep(5.0)
    picture = cell.plot_last(2.0)
    assert list(picture.recorded.tracks) == ["x", "y", "z"]  # none of them has moved
    assert picture.recorded.seconds == pytest.approx(2.0, abs=0.01)


def test_after_the_machine_was_closed_the_last_motion_is_there(cell):
    cell["x"].move_absolute(20.0).wait()
    cell.close()
    picture = cell.plot_last()
    assert picture.recorded.tracks["x"].columns["position"][0] == pytest.approx(0.0, abs=0.1)


def test_without_a_motion_an_error_is_raised(typed):
    with Machine.simulated(CELL) as machine:
        with pytest.raises(StateError, match="no axis has moved"):
            machine.plot_last()
        machine["z"].enable().wait()
        with pytest.raises(StateError, match="no axis has moved"):
            machine.plot_last()


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), "two"])
def test_no_such_time_and_no_such_axis(cell, seconds):
    with pytest.raises(ArgumentError, match="seconds="):
        cell.plot_last(seconds)
    cell["x"].move_absolute(2.0).wait()
    with pytest.raises(StateError, match="no axis"):
        cell.plot_last(axes=["nothing"])


def test_a_plot_of_the_last_motion_can_be_saved(cell, tmp_path):
    cell["x"].move_absolute(20.0).wait()
    picture = cell.plot_last()
    assert picture.save(tmp_path / "new" / "last.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in picture.save(tmp_path / "last.svg").read_bytes()


def test_only_the_last_minute_is_kept_and_the_collector_has_nothing_to_look_at(typed, monkeypatch):
    monkeypatch.setattr(last_motion, "HISTORY_SECONDS", 1.0)
    with Machine.simulated(CELL) as machine:
        machine["z"].enable().wait()
        machine["z"].move_relative(5.0).wait()
        gc.collect()
        before = len(gc.get_objects())
        machine.sleep(60.0)
        gc.collect()
        assert len(gc.get_objects()) - before < 500
        with pytest.raises(StateError, match="no axis has moved"):
            machine.plot_last()


def test_the_program_s_own_pictures_are_left_alone(cell):
    import matplotlib

    before = matplotlib.get_backend()
    cell["x"].move_absolute(20.0).wait()
    cell.plot_last()
    assert matplotlib.get_backend() == before
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()
