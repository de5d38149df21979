"""``axisbus gim6010 modbus`` and ``axisbus sim --modbus``: invalid arguments are reported before anything is sent or served."""

from __future__ import annotations

import sys

import pytest

from kit import command_line
from kit.modbus.on_terminal import module_on_terminal

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals"),
]


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        (("read", "speed"), 2, "'speed' is not a register"),
        (("read", "axis0.error"), 2, "--list"),
        (("write",), 2, "give NAME=VALUE"),
        (("write", "velocity_limit"), 2, "write NAME=VALUE"),
        (("write", "velocity_limit=fast"), 2, "not a value of type float32"),
        (("write", "velocity_limit=nan"), 2, "not a value of type float32"),
        (("write", "current_limit=51"), 2, "to 50 A"),
        (("write", "position_gain=5", "state_control=8"), 2, "axisbus move"),
        (("write", "node_id=5", "position_gain=5"), 2, "must be the only NAME=VALUE"),
        (("write", "node_id=0"), 2, "from 1"),
        (("zero",), 2, "--list"),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, tuple) else "",
)
def test_invalid_arguments_are_refused_before_anything_is_sent(
    monkeypatch, capsys, tmp_path, arguments, code, word
):
    monkeypatch.chdir(tmp_path)
    command, *rest = arguments
    with module_on_terminal(tmp_path) as line:
        run = command_line.runner(monkeypatch, capsys)
        result = run("gim6010", "modbus", command, "--port", line.path, "--node", 1, *rest)
        assert result.code == code
        assert word in result.err
        assert line.stations[0].frames == []


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((), "--can-simple or --modbus"),
        (("--modbus", "0"), "broadcast address"),
        (("--modbus", "64"), "is not a module"),
        (("--modbus", "1", "--modbus", "1"), "two modules have node ID 1"),
    ],
    ids=str,
)
def test_invalid_simulated_modules_are_refused(monkeypatch, capsys, arguments, word):
    code, _, err = command_line.runner(monkeypatch, capsys)("sim", *arguments, "--for", "0.01")
    assert code == 2
    assert word in err


def test_modules_on_rs485_are_served_for_a_time_beside_a_cell(monkeypatch, capsys):
    run = command_line.runner(monkeypatch, capsys)
    assert run("sim", "--modbus", "1", "--for", "0.01").code == 0
    code, out, _ = run("sim", "--modbus", "1", "--can-simple", "5", "--port", "0", "--for", "0.01")
    assert code == 0
    assert "on RS485" in out
    assert "node 5" in out
