"""The service file among the examples: systemd accepts it, and what it starts exists."""

from __future__ import annotations

import configparser
import shlex
import shutil
import subprocess
import sys

import pytest

from axisbus.cli.main import COMMANDS
from axisbus.motion.parameters import StopTimes
from kit.pages import ROOT

UNIT = ROOT / "examples" / "systemd" / "axisbus@.service"


@pytest.fixture
def unit():
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str
    parser.read(UNIT, encoding="utf-8")
    return parser


def test_the_commands_of_the_unit_exist(unit):
    service = unit["Service"]
    for key, name in (("ExecStartPre", "check"), ("ExecStart", "run")):
        program, command, cell = shlex.split(service[key])
        assert program.endswith("/bin/axisbus")
        assert command == name
        assert command in COMMANDS
        assert cell == "/etc/axisbus/%i.toml"


def test_the_unit_does_not_kill_a_machine_that_is_being_stopped(unit):
    service, times = unit["Service"], StopTimes()
    assert service["KillMode"] == "mixed"
    assert int(service["TimeoutStopSec"]) > 4 * (times.halt + times.quick_stop + times.disable)
    assert service["Restart"] == "no"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="there is no systemd here")
def test_systemd_accepts_the_unit(tmp_path):
    text = UNIT.read_text(encoding="utf-8").replace("/opt/axisbus/bin/axisbus", sys.executable)
    # An instance of the template, for a user that this computer has.
    copy = tmp_path / "axisbus@press.service"
    copy.write_text(text.replace("=axisbus\n", "=root\n"), encoding="utf-8")
    ran = subprocess.run(["systemd-analyze", "verify", copy], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert "axisbus@press" not in ran.stderr
    broken = tmp_path / "axisbus@broken.service"
    broken.write_text(text.replace("ExecStart=", "ExecStrat="), encoding="utf-8")
    assert subprocess.run(["systemd-analyze", "verify", broken], capture_output=True, check=False).returncode
