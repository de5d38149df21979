"""``axisbus gim6010 tune``: asks, makes its step, reports the response, and leaves the module idle with its gains printed."""

from __future__ import annotations

import json
import os
import re
import signal
import threading
import time

import pytest

from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from kit import command_line
from kit.can_simple_bus import modules_on_bus

POSITION = ("position", "--step", 1, "--velocity", 10, "--acceleration", 80, "--for", "0.5s")
LIST = ("--list", "endpoints_0.5.13.json")
GAIN = "axis0.controller.config.pos_gain"


@pytest.fixture
def axisbus(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "endpoints_0.5.13.json").write_text(json.dumps(Module().json()), "utf-8")
    run = command_line.runner(monkeypatch, capsys)
    return lambda channel, *words: run("gim6010", "tune", *words, "-i", "virtual", "-c", channel, "--node", 5)


def test_a_step_is_measured_and_the_gains_are_printed(axisbus):
    one = Module(5, dials=ModuleFaults())
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(channel, *POSITION, "--pos-gain", 26, *LIST, "--yes")
    assert code == 0, err
    assert out.count("settled after") == 2
    assert f"{GAIN}: 20 before, 26 now" in out
    assert f"params set {GAIN}=20 -i virtual" in out
    assert re.search(
        r"next: it .*pos_gain .* to (33\.8|22\.1) until", out
    )  # a busy computer makes a rough step
    assert (one.restarts, one.energised, one.usb_read(GAIN)) == (0, False, 26)


def test_gains_that_are_not_accepted_are_reported(axisbus):
    one = Module(5)
    one._talk._commands.pop(0x1A)
    with modules_on_bus(one) as channel:
        code, _, err = axisbus(channel, *POSITION, "--pos-gain", 26, *LIST, "--yes")
    assert (code, f"has not accepted {GAIN}" in err) == (3, True)


def test_tuning_without_a_terminal_needs_yes_and_guesses_no_argument(axisbus):
    one = Module(5)
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(channel, *POSITION, "--pos-gain", 26)
        assert (code, "--yes" in err, "which enables it and turns it" in out) == (2, True, True)
        time.sleep(0.1)
    assert one.usb_read(GAIN) == 20
    for words in (
        ("position", "--step", 1, "--for", "1s"),
        ("position", "--step", 1, "--velocity", 10, "--for", "1s"),
        ("velocity", "--step", 0, "--for", "1s"),
        ("velocity", "--for", "1s"),
        ("velocity", "--step", 1),
        ("velocity", "--step", 1, "--for", "1s", "--vel-gain", 0.1),
    ):
        assert axisbus("nobody", *words, "--yes").code == 2, words
    assert one.position == 0.0


def test_ctrl_c_during_a_tuning_move_brakes_the_module_and_switches_it_off(axisbus):
    one = Module(5, vel_ramp_rate=20.0)

    def interrupt():
        while one.shaft.speed < 1.0:
            time.sleep(0.005)
        os.kill(os.getpid(), signal.SIGINT)

    with modules_on_bus(one) as channel:
        threading.Thread(target=interrupt, daemon=True).start()
        code, _, err = axisbus(channel, "velocity", "--step", 3, "--for", "10s", "--yes")
        assert (code, "Ctrl-C" in err, "idle was sent" in err) == (130, True, True)
        assert "trial was not completed" in err
        assert not one.energised
        assert abs(one.shaft.speed) < 0.3


def test_the_method_of_the_manual_finds_a_smooth_gain(axisbus):
    """A gain with a low maximum: two trials, the second of which is the last that is allowed."""
    one = Module(5, dials=ModuleFaults())
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(
            channel, *POSITION, "--pos-gain", 4, "--raise-to", 5.3, *LIST, "--yes", "--step", 0.5
        )
    assert "pos_gain 4:" in out
    assert re.search(r"4 trials|smooth with pos_gain (4|5.2), ", out) or code == 1, (out, err)
    assert f"{GAIN}: 20 before, {one.usb_read(GAIN):.6g} now" in out
    assert (one.energised, one.restarts) == (False, 0)


def test_the_method_of_the_manual_needs_its_bounds(axisbus):
    one = Module(5)
    with modules_on_bus(one) as channel:
        code, _, err = axisbus(channel, *POSITION, "--raise-to", 40, "--yes")
        assert (code, "give --pos-gain" in err) == (2, True)
        code, _, err = axisbus(channel, *POSITION, "--pos-gain", 41, "--raise-to", 40, "--yes")
        assert (code, "pos_gain: gains from 41" in err) == (2, True)
        code, out, err = axisbus(channel, *POSITION, "--pos-gain", 26, "--raise-to", 40)
        assert (code, "--yes" in err, "IT IS RAISED UNTIL" in out) == (2, True, True)
    assert one.usb_read(GAIN) == 20


def test_an_interrupted_search_names_the_gain_in_the_module(axisbus):
    one = Module(5, dials=ModuleFaults())

    def interrupt():
        while one.shaft.speed < 1.0:
            time.sleep(0.005)
        os.kill(os.getpid(), signal.SIGINT)

    with modules_on_bus(one) as channel:
        threading.Thread(target=interrupt, daemon=True).start()
        code, _, err = axisbus(channel, *POSITION, "--pos-gain", 26, "--raise-to", 40, "--yes")
        assert (code, "the search ends here, with pos_gain 26 in its RAM" in err) == (130, True)
        assert not one.energised
