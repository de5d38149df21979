"""``MitControl`` on a simulated module in real time: commanded by a loop, and in idle after every end of the block."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from contextlib import contextmanager

import pytest

from axisbus.drives.gim6010 import MitCommand, MitControl, MitRanges, MitSettings, read_mit_ranges
from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import ArgumentError, NodeError, StateError, UserError
from kit.can_simple_bus import modules_on_bus

SETTINGS = MitSettings(
    5, MitRanges(12.5, 65.0, 500.0, 5.0, 50.0), gear=8.0, damping=1.0, period=0.04, command_timeout=1.0
)
SPIN = MitCommand(0.0, 4.0, 0.0, 3.0, 0.0)


@contextmanager
def led(module):
    with modules_on_bus(module) as name:
        with MitControl.open("virtual", name, SETTINGS) as control:
            yield control
        assert not module.energised


def spin(control, seconds=0.2):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        cycle = control.command(SPIN)
    return cycle


def test_a_loop_commands_the_module_and_the_end_of_the_block_switches_it_off():
    module = Module(5)
    with led(module) as control:
        with pytest.raises(StateError, match="not answered"):
            control.feedback  # noqa: B018  # a property
        with pytest.raises(StateError, match="enable it first"):
            control.command(SPIN)
        here = control.enable()
        assert (control.is_active, module.energised) == (True, True)
        assert here.position == pytest.approx(module.position * 0.7854, abs=0.02)
        begun = time.monotonic()
        cycles = [control.command(SPIN) for _ in range(20)]
        assert 0.7 < time.monotonic() - begun < 4.0
        assert [each.time for each in cycles] == sorted({each.time for each in cycles})
        assert cycles[-1].feedback.velocity > 2.0
        assert [str(each) for each in control.command(MitCommand(0, 0, 0, 1, 80)).saturated] == [
            "torque 50 instead of 80"
        ]
        _, age = control.feedback
        assert age < 0.5
        with pytest.raises(ArgumentError, match="not a command of MIT control"):
            control.command((0.0, 0.0, 0.0, 1.0, 0.0))
        with pytest.raises(StateError, match="under MIT control already"):
            control.enable()
        assert "idle according to its heartbeat" in control.stop()
        assert not control.is_active
        assert control.stop() == control._leader.left
    assert module.axis.error == 0


def test_the_module_can_be_commanded_again_after_a_stop():
    module = Module(5)
    with led(module) as control:
        for _ in range(2):
            control.enable()
            spin(control)
            control.stop()
            assert not module.energised


def test_outside_the_block_nothing_is_enabled():
    module = Module(5)
    with modules_on_bus(module) as name:
        control = MitControl.open("virtual", name, SETTINGS)
        with pytest.raises(StateError, match="with block"):
            control.enable()
        with control:
            pass
    assert not module.energised


def lead(module, act):
    """Enable it, let it turn, and do something within the block."""
    with modules_on_bus(module) as name, MitControl.open("virtual", name, SETTINGS) as control:
        control.enable()
        spin(control)
        act(control)


def fail(_):
    raise ZeroDivisionError


def test_an_exception_of_the_program_switches_the_module_off_and_reports_its_final_state():
    module = Module(5)
    with pytest.raises(ZeroDivisionError) as caught:
        lead(module, fail)
    assert any("idle according to its heartbeat" in note for note in caught.value.__notes__)
    assert not module.energised


@pytest.mark.parametrize(
    ("number", "raised"),
    [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, SystemExit), (signal.SIGTSTP, SystemExit)],
    ids=["Ctrl-C", "SIGTERM", "Ctrl-Z"],
)
def test_a_signal_switches_the_module_off(number, raised):
    module, before = Module(5), [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]

    def interrupted(control):
        threading.Timer(0.2, os.kill, (os.getpid(), number)).start()
        spin(control, 5.0)

    with pytest.raises(raised):
        lead(module, interrupted)
    assert [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)] == before
    assert (module.axis.error, module.energised) == (0, False)


def test_a_program_that_gives_no_command_lets_the_module_lose_its_power_and_its_next_command_raises():
    module = Module(5)
    with led(module) as control:
        control.enable()
        spin(control)
        time.sleep(3.0)
        assert not module.energised
        with pytest.raises(NodeError, match="gave no command"):
            control.command(SPIN)


def test_a_lost_module_is_reported_as_not_answering_and_not_as_stopped():
    module = Module(5)

    def lose(control):
        module.dials.dead = True
        spin(control, 5.0)

    with pytest.raises(NodeError, match="not answered") as caught:
        lead(module, lose)
    assert "it is not known whether module" in str(caught.value)


def test_if_the_control_function_fails_damping_and_idle_are_sent(monkeypatch):
    module = Module(5)
    monkeypatch.setattr(threading, "excepthook", lambda _: None)

    def break_it(control):
        control._leader.step = None
        spin(control, 5.0)

    with pytest.raises(NodeError, match="thread of this program has failed"):
        lead(module, break_it)
    assert not module.energised


def test_a_module_that_must_not_be_commanded_is_reported_with_the_reason():
    module = Module(5)
    module.dials.encoder_error = 4
    with led(module) as control, pytest.raises(NodeError, match="ENCODER_FAILED"):
        control.enable()


def test_the_mit_ranges_are_read_by_the_endpoint_list_of_the_firmware(tmp_path):
    module = Module(5, firmware=Firmware(0, 6, 0), mit_max_torque=11.0)
    file = tmp_path / "list.json"
    file.write_text(json.dumps(module.json()), "utf-8")
    with modules_on_bus(module) as name:
        assert read_mit_ranges("virtual", name, 5, file, made_for="0.6.0") == MitRanges(
            12.5, 65.0, 500.0, 5.0, 11.0
        )
        with pytest.raises(ArgumentError, match="made for firmware"):
            read_mit_ranges("virtual", name, 5, file, made_for="0.5.13")
    with pytest.raises(UserError, match="cannot be read"):
        read_mit_ranges("virtual", "nobody", 5, tmp_path / "none.json", made_for="0.6.0")
