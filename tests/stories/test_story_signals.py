"""Ctrl-C, SIGTERM, and a program that just ends: a process of its own, real signals, and the motor of its stand-in at rest."""

from __future__ import annotations

import functools
import os
import sys
from signal import SIGINT, SIGTERM

import pytest

from kit.stories import program as story_program

if sys.platform == "win32":
    pytest.skip("signals between processes are those of POSIX", allow_module_level=True)

LADDER = pytest.mark.nets("the stop ladder")
SLOW, QUICK = (
    67.5,
    45.0,
)  # degrees: what the ramp of a halt takes from 90 deg/s, and the most that a quick stop may
PLACES = ("sleeping", "waiting", "awaiting", "awaiting_inside")
TERM_PLACES = ("awaiting_inside", "waiting")
KEYBOARD, TERMINATED = "KeyboardInterrupt()", "SystemExit(143)"


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Play scenes, once for all tests that look at them."""

    @functools.cache
    def play(scenes, nets, **how):
        return story_program.play(tmp_path_factory.mktemp("program"), scenes, nets, **how)

    return lambda scenes, nets, **how: play(tuple(scenes), tuple(nets), **how)


def once(played, nets, number, places=PLACES):
    """One signal at every place where a program may be."""
    return played([(place, (number,)) for place in places], nets)


@pytest.mark.parametrize("place", PLACES)
@LADDER
def test_ctrl_c_stops_the_motor_on_the_usual_ramp_wherever_the_program_is(played, nets_cut, place):
    seen = once(played, nets_cut, SIGINT).scenes[PLACES.index(place)]
    seen.must_stand()
    assert seen.raised == KEYBOARD
    assert seen.notes == []


@LADDER
def test_ctrl_c_brakes_without_a_jolt(played, nets_cut):
    seen = once(played, nets_cut, SIGINT).scenes[0]
    seen.must_stand()
    assert 0.7 * SLOW < seen.way < 1.3 * SLOW


@pytest.mark.parametrize("place", TERM_PLACES)
def test_sigterm_stops_the_motor_in_the_same_way(played, place):
    seen = once(played, (), SIGTERM, TERM_PLACES).scenes[TERM_PLACES.index(place)]
    seen.must_stand()
    assert seen.raised == TERMINATED


@pytest.mark.parametrize(("number", "code"), [(SIGINT, -SIGINT), (SIGTERM, 143)], ids=["Ctrl-C", "SIGTERM"])
def test_the_exit_code_is_that_of_the_signal(played, number, code):
    ended = once(played, (), number, PLACES if number == SIGINT else TERM_PLACES)
    assert ended.code == code
    assert ("KeyboardInterrupt" in ended.errors) == (number == SIGINT)


TWICE = [("sleeping", (SIGINT, SIGINT)), ("leaving", (SIGINT, SIGINT)), ("sleeping", (SIGINT, SIGTERM))]


@pytest.mark.parametrize("scene", range(len(TWICE)), ids=["in sleep", "while leaving", "then SIGTERM"])
@LADDER
def test_a_second_signal_makes_it_a_quick_stop(played, nets_cut, scene):
    seen = played(TWICE, nets_cut, pause=0.2).scenes[scene]
    seen.must_stand()
    assert seen.way < QUICK
    assert seen.raised == KEYBOARD


WHILE_STOPPING = [("leaving", (SIGINT,)), ("leaving", (SIGTERM,)), ("closing", (SIGTERM,))]


@pytest.mark.parametrize("scene", range(len(WHILE_STOPPING)), ids=lambda number: str(WHILE_STOPPING[number]))
@LADDER
def test_a_signal_while_the_machine_closes_waits_until_all_stands(played, nets_cut, scene):
    seen = played(WHILE_STOPPING, nets_cut, before=0.3).scenes[scene]
    seen.must_stand()
    assert seen.way > 0.7 * SLOW  # it is being stopped already, and one signal does not make that harder
    assert seen.raised == (KEYBOARD if WHILE_STOPPING[scene][1] == (SIGINT,) else TERMINATED)


@LADDER
def test_two_signals_at_once_cannot_slip_past_the_stop(played, nets_cut):
    """The second is handled between the end of the block and the first line of what leaves it."""
    (seen,) = played([("sleeping", (SIGINT, SIGTERM))], nets_cut).scenes
    seen.must_stand()
    assert seen.way < QUICK
    assert seen.raised in (KEYBOARD, TERMINATED)


@pytest.mark.skipif(
    os.environ.get("AXISBUS_PROCESS") == "own",
    reason="the drives end with the core, and at a program's exit nobody is left who could look at them; see test_story_processes",
)
@LADDER
def test_a_program_that_ends_without_closing_the_machine_leaves_the_motor_at_rest(played, nets_cut):
    ended = played([("forgetting", ())], nets_cut)
    ended.scenes[0].must_stand()
    assert ended.code == 0
    assert ended.errors == ""
