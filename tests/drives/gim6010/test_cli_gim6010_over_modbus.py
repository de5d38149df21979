"""The commands of ``axisbus gim6010`` that else go over CAN, over RS485 by --modbus, on a simulated module."""

from __future__ import annotations

import json
import sys

import pytest

from kit import command_line
from kit.modbus.on_terminal import LISTED, module_on_terminal

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals"),
]
LIST = ("--list", LISTED)
RAMP, LIMIT, CURRENT = (
    "axis0.controller.config.vel_ramp_rate",
    "axis0.controller.config.vel_limit",
    "axis0.motor.config.current_lim",
)


class Over:
    """``axisbus gim6010 ... --modbus``, and a look into the module."""

    def __init__(self, run, terminal):
        self.station, self.path = terminal.stations[0], terminal.path
        self._run, self._lock = run, terminal.lock

    def __call__(self, *words, node=1):
        return self._run("gim6010", *words, "--modbus", self.path, "--node", node)

    def value(self, path):
        with self._lock:
            return self.station.module.usb_read(path)

    def put(self, path, value):
        with self._lock:
            self.station.module.usb_write(path, value)

    @property
    def restarts(self):
        return self.station.module.restarts


@pytest.fixture
def over(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    with module_on_terminal(tmp_path) as terminal:
        yield Over(command_line.runner(monkeypatch, capsys), terminal)


def test_parameters_are_read_written_and_saved(over):
    assert over("params", "get", RAMP, *LIST).out == f"{RAMP} = 100\n"
    code, out, err = over("params", "set", f"{RAMP}=50", *LIST)
    assert code == 0, err
    assert f"{RAMP} = 50 (was 100)" in out
    assert (
        f"save it: axisbus gim6010 params set ... --modbus {over.path} --node 1 --list {LISTED} --save" in out
    )
    assert (over.value(RAMP), over.restarts) == (50.0, 0)
    code, out, _ = over("params", "set", f"{RAMP}=40", *LIST, "--save")
    assert (code, over.value(RAMP), over.restarts) == (0, 40.0, 1)
    assert "restarted, and has all written values" in out
    values = json.loads(over("params", "dump", "axis0.controller.config", *LIST, "--json").out)
    assert values[RAMP] == 40.0
    code, _, err = over("params", "set", "axis0.requested_state=8", *LIST)
    assert (code, "not written here" in err) == (2, True)


def test_a_backup_is_taken_compared_and_restored(over, tmp_path):
    code, out, err = over("params", "backup", "-o", "before.json", *LIST)
    assert code == 0, err
    assert f"axisbus gim6010 params diff before.json --modbus {over.path} --node 1 --list {LISTED}" in out
    assert over("params", "diff", "before.json", *LIST).out == "0 settings differ\n"
    over.put(RAMP, 7.0)
    code, out, _ = over("params", "diff", "before.json", *LIST)
    assert (code, RAMP in out) == (1, True)
    assert over("params", "restore", "before.json", *LIST).code == 0
    assert over.value(RAMP) == 100.0
    code, _, err = over("params", "diff", "before.json", "before.json", *LIST)
    assert (code, "or --modbus" in err) == (2, True)


def test_the_limits_by_registers_and_by_parameters(over):
    code, out, err = over("limits", "--velocity", 12.5)
    assert code == 0, err
    assert "velocity_limit = 12.5 turns/s (rotor) (was 30 turns/s (rotor))" in out
    assert f"axisbus gim6010 limits --velocity 12.5 --modbus {over.path} --node 1 --save" in out
    assert (over.value(LIMIT), over.restarts) == (12.5, 0)
    code, out, _ = over("limits", "--current", 8, "--save")
    assert (code, over.value(CURRENT), over.restarts) == (0, 8.0, 1)
    code, out, _ = over("limits", *LIST, "--velocity", 11)
    assert (code, f"{LIMIT} = 11 (was 12.5)" in out) == (0, True)
    over.put("axis0.requested_state", 8)
    for words in ((), LIST):
        code, _, err = over("limits", "--velocity", 9, *words)
        assert (code, ("only an idle module" if words else "only in idle") in err) == (1, True)
    assert over.value(LIMIT) == 11.0


def test_termination_watchdogs_and_the_zero(over):
    code, _, err = over("termination", "off", *LIST, "--save")
    assert (code, over.value("can.config.enable_r120"), over.restarts) == (0, 0, 1), err
    code, out, _ = over("watchdog", "--break-timeout", "500ms", *LIST)
    assert (code, over.value("can.config.break_timeout")) == (0, 500)
    code, out, err = over("watchdog", "--off", *LIST)
    assert code == 0, err
    assert over.station.module.axis.error == 0
    with over._lock:
        over.station.module.motor.position = 0.3 * 16384
    code, out, err = over("zero", *LIST)
    assert (code, "its position is 0 here" in out) == (0, True), err
    assert over.value("axis0.encoder.config.index_offset") == pytest.approx(0.3, abs=1e-3)


def test_errors_and_another_node_id(over):
    assert over("errors") == (0, "no error\n", "")
    with over._lock:
        over.station.module.axis.estop()
    code, out, _ = over("errors")
    assert (code, "ESTOP_REQUESTED" in out) == (1, True)
    assert json.loads(over("errors", "--json").out)["axis"] == 0x4000
    code, out, err = over("set-id", 5)
    assert code == 0, err
    assert "module 1 is now module 5, saved" in out
    assert over("errors", node=5).code == 0  # its restart has cleared them


def test_canopen_and_a_bit_rate_are_set_for_when_can_is_its_interface(over):
    code, out, err = over("set-bitrate", "1000000", *LIST)
    assert (code, over.value("can.config.baud_rate"), over.restarts) == (0, 1_000_000, 1), err
    code, out, err = over("to-canopen", *LIST)
    assert (code, over.value("can.config.protocol"), over.restarts) == (0, 2, 2), err
    assert f"params set config.comm_intf_mux=0 --save --modbus {over.path}" in out


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("params", "get", RAMP), 2, "--list"),
        (("params", "get", RAMP, *LIST, "-i", "virtual", "-c", "x"), 2, "not both"),
        (("params", "get", RAMP, *LIST, "-b", "500000"), 2, "give one of 9600"),
        (("zero", "--until-restart"), 2, "message of CAN Simple"),
        (("termination", "on"), 2, "--list"),
        (("tune", "velocity", "--step", "1", "--for", "1", "--yes"), 2, "over CAN"),
        (("limits", "--current", "51"), 2, "remedy"),
        (("set-id", "0"), 2, "from 1"),
    ],
    ids=str,
)
def test_invalid_commands_over_modbus_are_refused_before_anything_is_sent(over, words, code, said):
    result = over(*words)
    assert (result.code, said in result.err) == (code, True), result.err
    assert over.station.frames == []


def test_a_missing_module_or_port_is_reported(over, monkeypatch, capsys):
    code, _, err = over("params", "get", RAMP, *LIST, node=9)
    assert (code, "module 9 does not answer" in err) == (3, True)
    over.path = "/dev/none"
    assert over("errors").code == 3
    code, _, err = over("params", "get", RAMP, *LIST, "--parity", "even", node=0)
    assert (code, "1 or above" in err) == (2, True)
    run = command_line.runner(monkeypatch, capsys)
    code, _, err = run("gim6010", "errors", "--parity", "even", "--node", 1)
    assert (code, "--parity needs --modbus" in err) == (2, True)
