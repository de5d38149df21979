"""Ctrl-C, SIGTERM, and a program that just ends: its own process, real signals, its simulated motor at standstill."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from signal import SIGINT, SIGTERM

import pytest

from kit.cell import cell_text
from kit.scenarios import program as scenario_program

if sys.platform == "win32":
    pytest.skip("signals between processes are those of POSIX", allow_module_level=True)
from signal import SIGHUP, SIGQUIT

STOP_SEQUENCE = pytest.mark.nets("the stop sequence")
SLOW, QUICK = (
    67.5,
    45.0,
)  # degrees: the distance of the ramp of a halt from 90 deg/s, and the largest of a quick stop
PLACES = ("sleeping", "waiting", "awaiting", "awaiting_inside")
TERM_PLACES = ("awaiting_inside", "waiting")
KEYBOARD, TERMINATED = "KeyboardInterrupt()", "SystemExit(143)"


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Play scenes, once for all tests that look at them."""

    @functools.cache
    def play(scenes, nets, **how):
        return scenario_program.play(tmp_path_factory.mktemp("program"), scenes, nets, **how)

    return lambda scenes, nets, **how: play(tuple(scenes), tuple(nets), **how)


def once(played, nets, number, places=PLACES):
    """One signal at every place where a program may be."""
    return played([(place, (number,)) for place in places], nets)


@pytest.mark.parametrize("place", PLACES)
@STOP_SEQUENCE
def test_ctrl_c_stops_the_motor_on_the_usual_ramp_wherever_in_the_program_it_arrives(played, nets_cut, place):
    seen = once(played, nets_cut, SIGINT).scenes[PLACES.index(place)]
    seen.must_be_still()
    assert seen.raised == KEYBOARD
    assert seen.notes == []


@STOP_SEQUENCE
def test_ctrl_c_brakes_without_a_jolt(played, nets_cut):
    seen = once(played, nets_cut, SIGINT).scenes[0]
    seen.must_be_still()
    assert 0.7 * SLOW < seen.way < 1.3 * SLOW


@pytest.mark.parametrize("place", TERM_PLACES)
def test_sigterm_stops_the_motor_on_the_usual_ramp(played, place):
    seen = once(played, (), SIGTERM, TERM_PLACES).scenes[TERM_PLACES.index(place)]
    seen.must_be_still()
    assert seen.raised == TERMINATED


@pytest.mark.parametrize(("number", "code"), [(SIGINT, -SIGINT), (SIGTERM, 143)], ids=["Ctrl-C", "SIGTERM"])
def test_the_exit_code_is_that_of_the_signal(played, number, code):
    ended = once(played, (), number, PLACES if number == SIGINT else TERM_PLACES)
    assert ended.code == code
    assert ("KeyboardInterrupt" in ended.errors) == (number == SIGINT)


@pytest.mark.parametrize("number", [SIGHUP, SIGQUIT])
def test_a_signal_that_ends_a_program_stops_the_motor_of_a_core_in_its_process(played, monkeypatch, number):
    monkeypatch.setenv("AXISBUS_PROCESS", "thread")
    ended = once(played, (), number, ("sleeping",))
    ended.scenes[0].must_be_still()
    assert ended.scenes[0].raised == f"SystemExit({128 + number})"
    assert ended.code == 128 + number


@pytest.mark.parametrize("before", ["ignored", "handled"])
def test_sighup_stops_nothing_if_the_program_ignores_or_handles_it(tmp_path, before):
    """As under nohup, or with a handler that reloads a file: the motor continues, and SIGTERM stops it."""
    text = f"""
import signal, sys, time
signal.signal(signal.SIGHUP, {"signal.SIG_IGN" if before == "ignored" else "lambda *_: None"})
from axisbus import Machine
with Machine.open({str(tmp_path / "cell.toml")!r}) as machine:
    machine["x"].enable().wait(30)
    machine["x"].move_velocity(90.0).wait(30)
    signal.raise_signal(signal.SIGHUP)
    time.sleep(0.3)
    print(machine["x"].velocity > 80.0, machine.session.leaving_because)
    signal.raise_signal(signal.SIGTERM)
"""
    (tmp_path / "cell.toml").write_text(
        cell_text("x", period="20ms", heartbeat="1s", bus='process = "thread"'), encoding="utf-8"
    )
    ended = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60)
    assert ended.stdout == "True None\n", ended.stderr
    assert ended.returncode == 143


@pytest.mark.parametrize("process", ["own", "thread"])
def test_ignored_ctrl_c_is_reported_and_sigterm_stops_the_motor(tmp_path, process):
    text = f"""
import signal, sys, time
from axisbus import Machine
with Machine.open({str(tmp_path / "cell.toml")!r}) as machine:
    machine["x"].enable().wait(30)
    machine["x"].move_velocity(90.0).wait(30)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.raise_signal(signal.SIGINT)
    time.sleep(1.5)
    print(machine["x"].velocity > 80.0, machine.session.leaving_because)
    signal.raise_signal(signal.SIGTERM)
"""
    (tmp_path / "cell.toml").write_text(
        cell_text("x", period="20ms", heartbeat="1s", bus=f'process = "{process}"'), encoding="utf-8"
    )
    ended = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60)
    assert ended.stdout == "True None\n", ended.stderr
    assert ended.stderr.count("this program now ignores Ctrl-C") == 1
    assert ended.returncode == 143


def test_ctrl_c_that_was_ignored_at_the_start_of_the_program_stops_its_motor(tmp_path):
    """As of a job that a shell has put into the background."""
    text = f"""
import signal, time
from axisbus import Machine
signal.signal(signal.SIGINT, signal.SIG_IGN)
with Machine.open({str(tmp_path / "cell.toml")!r}) as machine:
    machine["x"].enable().wait(30)
    try:
        machine["x"].move_velocity(90.0).wait(30)
        signal.raise_signal(signal.SIGINT)
        time.sleep(10)
    except KeyboardInterrupt:
        print(machine.session.leaving_because)
print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)
"""
    (tmp_path / "cell.toml").write_text(cell_text("x", period="20ms", heartbeat="1s"), encoding="utf-8")
    ended = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60)
    assert ended.stdout == "Ctrl-C\nTrue\n", ended.stderr


TWICE = [("sleeping", (SIGINT, SIGINT)), ("leaving", (SIGINT, SIGINT)), ("sleeping", (SIGINT, SIGTERM))]


@pytest.mark.parametrize("scene", range(len(TWICE)), ids=["in sleep", "while leaving", "then SIGTERM"])
@STOP_SEQUENCE
def test_a_second_signal_makes_it_a_quick_stop(played, nets_cut, scene):
    seen = played(TWICE, nets_cut, pause=0.2).scenes[scene]
    seen.must_be_still()
    assert seen.way < QUICK
    assert seen.raised == KEYBOARD


WHILE_STOPPING = [("leaving", (SIGINT,)), ("leaving", (SIGTERM,)), ("closing", (SIGTERM,))]


@pytest.mark.parametrize("scene", range(len(WHILE_STOPPING)), ids=lambda number: str(WHILE_STOPPING[number]))
@STOP_SEQUENCE
def test_a_signal_while_the_machine_closes_is_raised_after_the_stop(played, nets_cut, scene):
    seen = played(WHILE_STOPPING, nets_cut, before=0.3).scenes[scene]
    seen.must_be_still()
    assert seen.way > 0.7 * SLOW  # it is being stopped already, and one signal does not make that harder
    assert seen.raised == (KEYBOARD if WHILE_STOPPING[scene][1] == (SIGINT,) else TERMINATED)


@STOP_SEQUENCE
def test_two_signals_at_once_cannot_slip_past_the_stop(played, nets_cut):
    """The second is handled between the end of the block and the first line of its exit."""
    (seen,) = played([("sleeping", (SIGINT, SIGTERM))], nets_cut).scenes
    seen.must_be_still()
    assert seen.way < QUICK
    assert seen.raised in (KEYBOARD, TERMINATED)


@pytest.mark.skipif(
    os.environ.get("AXISBUS_PROCESS") == "own",
    reason="the drives end with the core: at a program's exit nobody is left who could look at them; see test_scenario_processes",
)
@STOP_SEQUENCE
def test_a_program_that_ends_without_closing_the_machine_leaves_the_motor_at_standstill(played, nets_cut):
    ended = played([("forgetting", ())], nets_cut)
    ended.scenes[0].must_be_still()
    assert ended.code == 0
    assert ended.errors == ""
