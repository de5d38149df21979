"""The commands of ``axisbus gim6010`` over USB by --usb: odrive's own objects, and a simulated module behind them."""

from __future__ import annotations

import json

import pytest

from axisbus.drives.gim6010 import usb_parameters
from axisbus.drives.gim6010.sim.module import Module
from kit import command_line
from kit.usb_port import plugged_in

pytestmark = pytest.mark.timeout(60)
RAMP, LIMIT = "axis0.controller.config.vel_ramp_rate", "axis0.controller.config.vel_limit"
NODE, PROTOCOL = "axis0.config.can.node_id", "can.config.protocol"
SERIAL = 0x2053_1968_3238


@pytest.fixture
def module():
    made = Module(0, serial=SERIAL)
    made.usb_write(RAMP, 100.0)
    made.dials.restart_time = 0.3
    return made


@pytest.fixture
def over(monkeypatch, capsys, tmp_path, module):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(usb_parameters, "FIND", 0.5)
    monkeypatch.setattr(usb_parameters, "ALONE", 0.05)
    run = command_line.runner(monkeypatch, capsys)
    with plugged_in(monkeypatch, module):
        yield lambda *words: run("gim6010", *words, "--usb")


def test_parameters_are_read_written_and_saved_without_a_list(over, module):
    assert over("params", "get", f"odrv0.{RAMP}").out == f"odrv0.{RAMP} = 100\n"
    code, out, err = over("params", "set", f"{RAMP}=50")
    assert code == 0, err
    assert f"{RAMP} = 50 (was 100)" in out
    assert "save it: axisbus gim6010 params set ... --usb --save" in out
    assert (module.usb_read(RAMP), module.restarts) == (50.0, 0)
    code, out, err = over("params", "set", f"{RAMP}=40", "--save")
    assert (code, module.usb_read(RAMP), module.restarts) == (0, 40.0, 1), err
    assert f"module {SERIAL:X}h restarted, and has all written values" in out


def test_a_dump_over_usb_has_all_parameters_also_those_of_64_bits(over, module):
    code, out, err = over("params", "dump", "--json")
    assert code == 0, err
    told = json.loads(out)
    assert told["serial_number"] == SERIAL  # over CAN and Modbus 32 bits travel
    known = {each: kind for each, kind in odrive_kinds(module).items() if kind not in ("json", "function")}
    assert set(told) == set(known)


def odrive_kinds(module):
    found = {}

    def walk(nodes, prefix):
        for node in nodes:
            path = f"{prefix}{node['name']}"
            if node["type"] == "object":
                walk(node["members"], f"{path}.")
            else:
                found[path] = node["type"]

    walk(module.json(), "")
    return found


def test_a_backup_over_usb_is_one_of_the_whole_serial_number(over, module):
    code, _, err = over("params", "backup", "-o", "before.json")
    assert code == 0, err
    assert over("params", "diff", "before.json").out == "0 settings differ\n"
    module.usb_write(RAMP, 7.0)
    assert over("params", "diff", "before.json").code == 1
    code, _, err = over("params", "restore", "before.json")
    assert (code, module.usb_read(RAMP)) == (0, 100.0), err


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ("axis0.requested_state=8", "not written here"),
        (f"{NODE}=5", "set-id changes it"),
        ("axis0.controller.input_pos=3", "not written here"),
        ("error=0", "cannot be written"),
        ("serial_number=1", "cannot be written"),
        ("axis0.nothing=1", "there is no parameter"),
        (f"{LIMIT}=1e39", "beyond the range of float"),
    ],
)
def test_parameters_refused_over_can_are_refused_over_usb_too(over, module, what, why):
    code, _, err = over("params", "set", what)
    assert (code, why in err) == (2, True), err
    assert not module.energised


def test_only_an_idle_module_is_written_or_saved(over, module):
    module.usb_write("axis0.requested_state", 8)
    for words in (
        ("params", "set", f"{RAMP}=1"),
        ("limits", "--velocity", 5),
        ("set-id", 5),
        ("to-canopen",),
    ):
        code, _, err = over(*words)
        assert code == 1 or "not a node ID of CANopen" in err, (words, err)
        assert "only an idle module" in err or "not a node ID of CANopen" in err
    assert (module.usb_read(RAMP), module.restarts) == (100.0, 0)


def test_from_the_box_to_canopen_over_usb_alone(over, module):
    code, _, err = over("to-canopen")
    assert code == 1
    assert "0 is not a node ID of CANopen" in err
    code, out, err = over("set-id", 5)
    assert (code, module.usb_read(NODE), module.restarts) == (0, 5, 1), err
    assert "node ID 5 (was 0), in RAM" in out
    code, out, err = over("to-canopen")
    assert (code, module.usb_read(PROTOCOL), module.restarts) == (0, 2, 2), err
    assert "saved: it speaks CANopen\n" in out
    code, out, err = over("to-can-simple")
    assert (code, module.usb_read(PROTOCOL), module.restarts) == (0, 1, 3), err


def test_a_node_id_that_is_not_saved_is_lost_at_the_next_start(over, module):
    code, out, err = over("set-id", 5, "--no-save")
    assert (code, module.usb_read(NODE), module.restarts) == (0, 5, 0), err
    assert "save it: axisbus gim6010 set-id 5 --usb" in out
    module.restart()
    assert module.usb_read(NODE) == 0


def test_limits_termination_watchdogs_and_rate(over, module):
    code, _, err = over("limits", "--velocity", 12.5, "--save")
    assert (code, module.usb_read(LIMIT), module.restarts) == (0, 12.5, 1), err
    assert over("termination", "off").code == 0
    assert module.usb_read("can.config.enable_r120") == 0
    assert over("watchdog", "--break-timeout", "500ms").code == 0
    assert module.usb_read("can.config.break_timeout") == 500
    assert over("watchdog", "--off").code == 0
    assert module.usb_read("can.config.break_timeout") == 0
    code, _out, err = over("set-bitrate", 500000)
    assert (code, module.usb_read("can.config.baud_rate")) == (0, 500000), err


@pytest.mark.parametrize(
    ("typed", "repeated"),
    [
        (("limits", "--velocity", "12.50"), "limits --velocity 12.5"),
        (("watchdog", "--break-timeout", "500ms"), "watchdog --break-timeout 0.5s"),
        (("watchdog", "--off"), "watchdog --off"),
        (("termination", "on"), "termination on"),
        (("endstops", "--min", "on", "--max", "off"), "endstops --min on --max off"),
        (("brake-resistor", "--ohm", 2, "--ramp", 26, 27.5), "brake-resistor --ohm 2 --ramp 26 27.5"),
        (("brake-resistor", "--off"), "brake-resistor --off"),
    ],
)
def test_the_command_that_saves_a_setting_is_printed(over, typed, repeated):
    code, out, err = over(*typed)
    assert code == 0, err
    assert out.splitlines()[-1].endswith(f"save it: axisbus gim6010 {repeated} --usb --save")


def test_errors_are_printed_by_name(over, module):
    assert over("errors") == (0, "no error\n", "")
    module.dials.motor_error = 0x40
    code, out, _ = over("errors", "--json")
    assert (code, json.loads(out)["motor"]) == (1, 0x40)
    assert "motor" in over("errors").out


def test_a_module_that_is_not_there_and_one_of_several(over, module, monkeypatch):
    code, out, err = over("params", "get", RAMP, "--serial", f"{SERIAL:X}")
    assert (code, out) == (0, f"{RAMP} = 100\n"), err
    code, _, err = over("params", "get", RAMP, "--serial", "AB12")
    assert (code, "no module of serial number 00000000AB12 was found on USB" in err) == (3, True), err
    module.dials.restart_time = 5.0
    module.restart()
    code, _, err = over("errors")
    assert (code, "no module was found on USB" in err) == (3, True), err


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("params", "get", RAMP, "--node", 1), "--usb needs no --node"),
        (("params", "get", RAMP, "-i", "virtual", "-c", "c"), "--usb needs no -i and no -c"),
        (("params", "get", RAMP, "--list", "endpoints_0.5.13.json"), "--usb needs no --list"),
        (("params", "get", RAMP, "--serial", "xyz"), "hexadecimal"),
        (("zero", "--until-restart"), "cannot be done over --usb"),
        (("tune", "position", "--size", 0.1, "--yes"), ""),
    ],
)
def test_incompatible_options_are_refused(over, words, why):
    code, _, err = over(*words)
    assert (code, why in err) == (2, True), err


def test_of_several_one_has_to_be_named(monkeypatch, capsys, tmp_path, module):
    monkeypatch.chdir(tmp_path)
    run, other = command_line.runner(monkeypatch, capsys), Module(0, serial=0xAB12)
    with plugged_in(monkeypatch, module, other):
        code, _, err = run("gim6010", "set-id", 5, "--usb")
        assert (code, "several modules are on USB" in err, "00000000AB12" in err) == (1, True, True), err
        code, _, err = run("gim6010", "set-id", 5, "--no-save", "--usb", "--serial", "ab12")
        assert code == 0, err
    assert (module.usb_read(NODE), other.usb_read(NODE)) == (0, 5)


def test_a_port_that_another_program_uses_is_reported(over, monkeypatch):
    import odrive

    def claimed(**_):
        raise RuntimeError("the device is in use")

    monkeypatch.setattr(odrive, "find_sync", claimed)
    code, _, err = over("params", "get", RAMP)
    assert (code, "USB cannot be used" in err, "the device is in use" in err) == (3, True, True), err


def test_a_serial_number_is_accepted_with_usb_alone(monkeypatch, capsys):
    run = command_line.runner(monkeypatch, capsys)
    code, _, err = run("gim6010", "params", "get", RAMP, "--serial", "AB")
    assert (code, "--serial needs --usb" in err) == (2, True)


def test_a_module_that_does_not_restart_is_not_reported_as_saved(over, module, monkeypatch):
    from axisbus.drives.gim6010 import usb_parameters

    monkeypatch.setattr(usb_parameters, "RESTART_BEGINS", 0.2)
    monkeypatch.setattr(module, "usb_call", lambda _: None)
    code, _, err = over("params", "set", f"{RAMP}=100", "--save")
    assert (code, "does not restart" in err) == (3, True), err


def test_a_module_unplugged_during_the_command_is_reported(over, module, monkeypatch):
    reads = []
    real = module.usb_read

    def read(path):
        reads.append(path)
        if len(reads) == 6:
            module.restart()
        return real(path)

    monkeypatch.setattr(module, "usb_read", read)
    code, _, err = over("params", "dump")
    assert (code, "is no longer there" in err) == (3, True), err
