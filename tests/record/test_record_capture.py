"""Captures: the cycles around a moment that a condition names, in virtual time."""

from __future__ import annotations

import time

import pytest

from axisbus import Machine
from axisbus.errors import ArgumentError, StateError
from axisbus.record.load import load
from kit.pages import ROOT

pytest.importorskip("mcap")

CELL = ROOT / "examples" / "cell.toml"
OVER_TEMPERATURE = 0x4310


@pytest.fixture
def cell():
    with Machine.simulated(CELL) as machine:
        x = machine["x"]
        x.enable().wait()
        x.home().wait()
        yield machine


def first(run, column, holds):
    """The time at which a value of x first holds."""
    track = run.tracks["x"]
    return next(time for time, value in zip(track.times, track.columns[column], strict=True) if holds(value))


@pytest.mark.parametrize(
    ("when", "column", "holds"),
    [
        ("x.velocity > 50", "velocity", lambda value: value > 50),
        ("x.velocity>=50.0", "velocity", lambda value: value >= 50),
        ("|x.velocity| > 50", "velocity", lambda value: abs(value) > 50),
        ("x.state = DiscreteMotion", "state", lambda value: value == "DiscreteMotion"),
        ("x.state == 'DiscreteMotion'", "state", lambda value: value == "DiscreteMotion"),
        ("x.mode = pp", "mode", lambda value: value == "pp"),
        ("x.position > 20", "position", lambda value: value > 20),
        (lambda values: values["x"]["position"] > 20, "position", lambda value: value > 20),
    ],
)
def test_a_capture_contains_the_moment_and_the_time_before_and_after_it(cell, tmp_path, when, column, holds):
    path = tmp_path / "moment.mcap"
    with cell.capture(path, when, before=0.1, after=0.2) as capture:
        cell.sleep(0.3)
        assert not capture.fired
        cell["x"].move_absolute(60.0).wait()
        assert capture.wait(1.0)
    assert (capture.failed, capture.fired, capture.done) == ("", True, True)
    run = load(path)
    assert first(run, column, holds) == pytest.approx(0.1, abs=0.005)
    assert run.seconds == pytest.approx(0.3, abs=0.01)
    given = any(event.where == "x.move_absolute(60 deg)" for event in run.events)
    assert given == (column in ("state", "mode"))  # else it was given before


def test_a_condition_that_is_true_from_the_beginning_writes_nothing(cell, tmp_path):
    path = tmp_path / "none.mcap"
    with cell.capture(path, "x.state = Standstill") as capture:
        cell.sleep(1.0)
    assert (capture.fired, capture.done, path.exists()) == (False, False, False)
    with cell.capture(path, "x.state = Standstill", after=0.1) as capture:
        cell["x"].move_absolute(1.0).wait()
        assert capture.wait(1.0)
    assert "DiscreteMotion" in load(path).tracks["x"].columns["state"]


def test_a_fault_of_any_axis_is_a_moment(cell, tmp_path):
    path = tmp_path / "fault.mcap"
    with cell.capture(path, "fault", before=1.0, after=0.2, axes=["y", "x"]) as capture:
        cell["y"].enable().wait()
        cell.sleep(1.5)
        cell.simulated_node(2).fault(OVER_TEMPERATURE)
        assert capture.wait(2.0)
    run = load(path)
    assert list(run.tracks) == ["y", "x"]
    assert any(event.sort == "emcy" and "0x4310" in event.text for event in run.events)
    assert run.seconds == pytest.approx(1.2, abs=0.02)


def test_the_block_may_end_before_the_time_after_the_moment(cell, tmp_path):
    path = tmp_path / "short.mcap"
    with cell.capture(path, "x.velocity > 10", before=0.1, after=30.0):
        cell["x"].move_absolute(20.0).wait()
    assert 0.1 < load(path).seconds < 2.0


def test_the_stop_after_an_error_of_the_program_may_be_the_moment(tmp_path):
    path = tmp_path / "stop.mcap"

    def program() -> None:
        with (
            Machine.simulated(CELL) as machine,
            machine.capture(path, "x.power = switch on disabled", before=1.0),
        ):
            machine["x"].enable().wait()
            machine["x"].move_velocity(60.0).wait()
            raise RuntimeError("a mistake of the program")

    with pytest.raises(RuntimeError):
        program()
    assert "Disabled" in load(path).tracks["x"].columns["state"]


def test_a_function_that_fails_and_a_file_that_cannot_be_made_end_the_capture_and_not_the_motion(
    cell, tmp_path
):
    with cell.capture(tmp_path / "a.mcap", lambda values: values["nobody"]) as capture:
        cell["x"].move_absolute(5.0).wait()
        assert capture.done
    assert "its condition failed: KeyError" in capture.failed
    with cell.capture("/dev/null/a.mcap", "x.position > 6", after=0.0) as capture:
        cell["x"].move_absolute(10.0).wait()
        assert capture.done
    assert "cannot be written" in capture.failed


@pytest.mark.parametrize(
    ("when", "text"),
    [
        ("", "is not a condition"),
        ("x", "is not a condition"),
        ("velocity > 3", "is not a condition"),
        ("w.velocity > 3", "there is no axis 'w'"),
        ("x.speed > 3", "there is no value 'speed'"),
        ("x.velocity > fast", "'fast' cannot be compared"),
        ("x.state > Standstill", "'Standstill' cannot be compared"),
        ("x.homed > true", "cannot be compared"),
    ],
)
def test_an_invalid_condition_is_refused_at_the_call(cell, tmp_path, when, text):
    with pytest.raises(ArgumentError, match=text):
        cell.capture(tmp_path / "a.mcap", when)


def test_invalid_times_and_axes_are_refused_at_the_call(cell, tmp_path):
    for times in ({"before": -1.0}, {"after": 61.0}, {"before": float("nan")}):
        with pytest.raises(ArgumentError, match="give seconds from 0 to 60"):
            cell.capture(tmp_path / "a.mcap", "fault", **times)
    with pytest.raises(StateError, match="no axis 'w'"):
        cell.capture(tmp_path / "a.mcap", "fault", axes=["w"])


def test_in_real_time_the_capture_is_written_outside_the_cycle(tmp_path):
    text = CELL.read_text(encoding="utf-8").replace(
        'scan_period = "4ms"', 'scan_period = "20ms"\nprocess = "thread"'
    )
    file, path = tmp_path / "cell.toml", tmp_path / "moment.mcap"
    file.write_text(text, encoding="utf-8")
    with Machine.open(file) as machine, machine.capture(path, "y.state = Standstill", after=0.1) as capture:
        machine["y"].enable().wait(20)
        assert capture.wait(10.0)
        until = time.monotonic() + 5.0
        while not path.exists() and time.monotonic() < until:
            time.sleep(0.01)
    assert "Standstill" in load(path).tracks["y"].columns["state"]
