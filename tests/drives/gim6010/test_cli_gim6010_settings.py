"""``axisbus gim6010 termination``, ``limits``, ``watchdog``, ``zero`` and ``set-bitrate`` on simulated modules."""

from __future__ import annotations

import json

import pytest

from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from kit import command_line
from kit.can_simple_bus import modules_on_bus

LIST = ("--list", "endpoints_0.5.13.json")
OFF = ("can.config.enable_r120", "axis0.config.enable_watchdog")


@pytest.fixture
def axisbus(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "endpoints_0.5.13.json").write_text(json.dumps(Module().json()), "utf-8")
    call = command_line.runner(monkeypatch, capsys)

    def run(channel, *words, listed=True):
        return call("gim6010", *words, "-i", "virtual", "-c", channel, "--node", 5, *(LIST if listed else ()))

    return run


def module(**more):
    return Module(5, dials=ModuleFaults(restart_time=0.2), **more)


def test_termination(axisbus):
    one = module()
    with modules_on_bus(one) as channel:
        assert "can.config.enable_r120 = true" in axisbus(channel, "termination").out
        code, out, _ = axisbus(channel, "termination", "off")
        assert (code, one.usb_read(OFF[0]), one.restarts) == (0, 0, 0)
        assert "in RAM only" in out
        assert "termination off -i virtual" in out
        code, out, _ = axisbus(channel, "termination", "off", "--save")
    assert (code, one.usb_read(OFF[0]), one.restarts) == (0, 0, 1)
    assert "60 Ω" in out


def test_limits_by_parameters_and_by_a_message(axisbus):
    one = module()
    with modules_on_bus(one) as channel:
        code, out, _ = axisbus(channel, "limits", "--velocity", 12.5, "--save")
        assert (code, "12.5 turns/s of the rotor are 1.5625 turns/s of the output at 8:1" in out) == (0, True)
        code, out, _ = axisbus(channel, "limits", "--velocity", 10, "--current", 8, listed=False)
        assert (code, "nothing confirms it" in out) == (0, True)
    assert [
        one.usb_read(p) for p in ("axis0.controller.config.vel_limit", "axis0.motor.config.current_lim")
    ] == [10, 8]
    for words in (("--velocity", 10), ("--velocity", 10, "--current", 8, "--save")):
        assert axisbus("nobody", "limits", *words, listed=False).code == 2
    for words in (("--current", 51), ("--velocity", 0), ("--velocity", "nan")):
        code, _, err = axisbus("nobody", "limits", *words)
        assert (code, "remedy" in err) == (2, True)


def test_the_watchdogs(axisbus):
    one = module()
    with modules_on_bus(one) as channel:
        code, out, _ = axisbus(channel, "watchdog", "--break-timeout", "500ms", "--axis-timeout", "0.25")
        assert code == 0
        assert "only set-points feed it" in out
        assert [one.usb_read(p) for p in ("can.config.break_timeout", OFF[1])] == [500, 1]
        assert "can.config.break_timeout = 500" in axisbus(channel, "watchdog").out
        assert one.axis.error == 0x100800  # no master sends set-points
        code, out, err = axisbus(channel, "watchdog", "--off")
        assert (code, "cleared" in out) == (0, True), err
    assert one.axis.error == 0
    assert axisbus("nobody", "watchdog", "--off", "--axis-timeout", "1s").code == 2


def test_the_watchdogs_leave_other_errors_alone(axisbus):
    one = module()
    one.dials.encoder_error = 4
    with modules_on_bus(one) as channel:
        code, out, _ = axisbus(channel, "watchdog", "--off")
    assert (code, "cleared" in out) == (0, False)
    assert one.axis.error == 0x100


def test_zero(axisbus):
    one = module()
    one.motor.position = 5000.0
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(channel, "zero")
        assert code == 0, err
        assert "its position is 0 here" in out
        assert "an eighth of a turn of the output" in out
        assert (one.restarts, round(one.shaft.estimate, 3)) == (1, 0.0)
        one.motor.position += 1000.0
        assert axisbus(channel, "zero", "--until-restart", listed=False).code == 0
        assert abs(one.shaft.shadow_count) <= 1


def test_if_no_endpoint_is_answered_the_steps_over_usb_are_printed(axisbus):
    one = module()
    one.dials.endpoints = False
    with modules_on_bus(one) as channel:
        for words, step in (
            (("termination", "off"), "odrv0.can.config.enable_r120 = False"),
            (("watchdog", "--break-timeout", "500ms"), "odrv0.can.config.break_timeout = 500"),
            (("limits", "--current", "10"), "odrv0.axis0.motor.config.current_lim = 10.0"),
            (("zero",), "index_offset = the sum of both"),
        ):
            code, out, err = axisbus(channel, *words)
            assert (code, step in out) == (3, True), words
            assert "does not answer" in err
    assert (one.restarts, one.energised) == (0, False)


@pytest.mark.timeout(120)
def test_another_bit_rate(axisbus):
    one = module()
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(channel, "set-bitrate", 1_000_000)
        assert code == 0, err
        assert "module 5 is found at 1000000 bit/s" in out
    assert (one.usb_read("can.config.baud_rate"), one.restarts, one.energised) == (1_000_000, 1, False)
    assert axisbus("nobody", "set-bitrate", 300_000).code == 2


def test_the_limit_switches(axisbus):
    one = module()
    with modules_on_bus(one) as channel:
        assert "axis0.min_endstop.config.enabled = false" in axisbus(channel, "endstops").out
        code, out, err = axisbus(channel, "endstops", "--min", "on", "--max", "off", "--save")
        assert (code, "try it slowly" in out) == (0, True), err
        found = [one.usb_read(f"axis0.min_endstop.config.{name}") for name in ("gpio_num", "enabled")]
        assert (found, one.restarts) == ([1, 1], 1)
        one.parameters["hw_version_minor"] = 7
        code, _, err = axisbus(channel, "endstops", "--max", "on")
        assert (code, "hardware 3.7 has no limit switches" in err) == (1, True)
        assert one.usb_read("axis0.max_endstop.config.enabled") == 0


def test_the_braking_resistor(axisbus):
    one = module()
    with modules_on_bus(one) as channel:
        code, out, err = axisbus(channel, "brake-resistor", "--ohm", 2, "--ramp", 26, 28)
        assert (code, "392 W" in out) == (0, True), err
        assert "brake-resistor --ohm 2 --ramp 26 28 -i virtual" in out
        assert "config.brake_resistance = 2" in axisbus(channel, "brake-resistor").out
        assert one.usb_read("config.enable_brake_resistor") == 1
        code, _, err = axisbus(channel, "brake-resistor", "--ohm", 2, "--ramp", 26, 72)
        assert (code, "switches its motor off at 72 V" in err) == (1, True)
        assert one.usb_read("config.dc_bus_overvoltage_ramp_end") == 28.0
        code, out, _ = axisbus(channel, "brake-resistor", "--off")
        assert (code, one.usb_read("config.enable_brake_resistor")) == (0, 0)
    for words in (("--off", "--ohm", 2), ("--max-regen", 1), ("--ohm", 2), ("--ohm", 0, "--max-regen", 1)):
        assert axisbus("nobody", "brake-resistor", *words).code == 2


def test_the_result_of_pulses_is_computed_without_a_bus(monkeypatch, capsys):
    run = command_line.runner(monkeypatch, capsys)
    code, out, _ = run("gim6010", "pwm", "velocity", "-8", "8")
    assert (code, "1.50 ms: 0 turns/s of the rotor" in out) == (0, True)
    assert "odrv0.config.comm_intf_mux = 3" in out
    code, out, _ = run("gim6010", "pulses", "--per-turn", "1024", "--turns", "128", "--circular")
    assert (code, "8192 pulses" in out) == (0, True)
    assert run("gim6010", "pwm", "torque", "1", "1").code == 2
    assert run("gim6010", "pulses", "--per-turn", "0", "--turns", "1").code == 2
