"""``axisbus gim6010 calibrate``: asks, follows, judges, and requests idle at every end."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import ExitStack

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.bus.run import run_guarded
from axisbus.drives.gim6010.calibration import Calibration, CalibrationKind
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from kit import command_line
from kit.can_simple_bus import modules_on_bus


@pytest.fixture
def axisbus(monkeypatch, capsys):
    run = command_line.runner(monkeypatch, capsys)
    return lambda channel, *words: run(
        "gim6010", "calibrate", *words, "-i", "virtual", "-c", channel, "--node", 5
    )


def module(**dials):
    return Module(5, dials=ModuleFaults(**{"calibration_time": 0.1, **dials}))


def test_calibration_without_a_terminal_needs_yes(axisbus):
    one = module()
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(channel, "full")
        time.sleep(0.2)
    assert (code, "--yes" in err) == (2, True)
    assert "the rotor turns slowly without a command" in out
    assert (one.position, one.energised) == (0.0, False)


def test_calibration_is_done_and_the_command_to_store_it_is_printed(axisbus):
    one = module()
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(channel, "full", "--yes")
    assert code == 0, err
    assert "full calibration was completed without an error; module 5 is idle" in out
    assert "axis0.encoder.config.pre_calibrated=true" in out
    assert (one.restarts, one.energised) == (0, False)


def test_a_failed_calibration_is_reported_with_its_error(axisbus):
    one = module(calibration_encoder_error=2)
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(channel, "encoder", "--yes")
    assert code == 1
    assert "encoder calibration FAILED" in err
    assert "counts per turn and pole pairs do not agree" in err
    assert "pre_calibrated" not in out


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_by_idle(axisbus, number, code):
    one = module(calibration_time=10.0)
    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)

    def interrupt():
        while one.axis.state == 1:
            time.sleep(0.01)
        os.kill(os.getpid(), number)

    with modules_on_bus(one) as channel:
        threading.Thread(target=interrupt, daemon=True).start()
        if number == signal.SIGINT:
            found = axisbus(channel, "encoder", "--yes")
            assert (found.code, "idle was sent" in found.err) == (code, True)
        else:
            with pytest.raises(SystemExit) as caught:
                axisbus(channel, "encoder", "--yes")
            assert caught.value.code == code
        assert not one.energised
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers


def guarded(one, tell):
    found = Calibration(5, CalibrationKind.ENCODER)
    with ExitStack() as stack:
        name = stack.enter_context(modules_on_bus(one))
        channel = Channel.open("virtual", name)
        stack.callback(channel.close)
        try:
            run_guarded(channel, found, lambda text: tell(text, channel))
        finally:
            time.sleep(0.2)
            assert not one.energised
    return found


def test_an_exception_while_printing_ends_calibration_by_idle():
    def tell(text, _):
        if text.startswith("encoder calibration,"):
            assert one.energised
            raise BrokenPipeError(text)

    one = module(calibration_time=10.0)
    with pytest.raises(BrokenPipeError):
        guarded(one, tell)
    assert one.axis.error == 0


def test_a_dialogue_that_is_broken_itself_leaves_by_its_parting_frames():
    one = module(calibration_time=10.0)

    def tell(text, _):
        if text.startswith("encoder calibration,"):
            Calibration.step = broken

    def broken(self, now):
        raise ZeroDivisionError

    step = Calibration.step
    try:
        with pytest.raises(ZeroDivisionError):
            guarded(one, tell)
    finally:
        Calibration.step = step


def test_a_signal_that_the_program_ignores_is_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        found = guarded(module(), lambda *_: os.kill(os.getpid(), signal.SIGHUP))
    finally:
        signal.signal(signal.SIGHUP, before)
    assert found.verdict.good


def test_a_bus_that_is_not_there_begins_nothing(axisbus):
    code, _, err = axisbus("nobody", "motor", "--yes")
    assert (code, "nothing was sent that moves it" in err) == (3, True)
