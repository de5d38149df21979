"""``axisbus probe``: each edge is printed, and nothing is energised."""

from __future__ import annotations

import threading

import pytest

from axisbus.cli import probe
from axisbus.machine.axis import Axis
from kit import command_line
from kit.cell import MODULE, cell_file

pytestmark = [pytest.mark.timeout(60)]


@pytest.fixture
def axisbus(monkeypatch, capsys) -> command_line.Run:
    monkeypatch.setattr(Axis, "enable", None)  # it energises nothing
    return command_line.runner(monkeypatch, capsys)


def cell(folder, **changes):
    return cell_file(folder, "x", period="20ms", heartbeat="1s", **changes)


@pytest.fixture
def touched(monkeypatch):
    """Let the sensor be touched and released half a second after the input was armed."""
    open_machine = probe.machine_of

    def opened(*given, **options):
        machine = open_machine(*given, **options)

        def touch() -> None:
            signal = machine.simulated_node(1).drive().touch_probe
            signal.set_input(1, True)
            signal.set_input(1, False)

        timer = threading.Timer(0.8, touch)
        timer.start()
        return machine

    monkeypatch.setattr(probe, "machine_of", opened)


def test_each_edge_of_the_touch_probe_is_printed(axisbus, tmp_path, touched):
    code, out, err = axisbus("probe", cell(tmp_path), "x", "--edge", "both", "--for", "2s")
    assert code == 0, err
    assert out.splitlines() == [
        "x: touch probe 1 is armed",
        "x: rising edge at 0.0000 deg",
        "x: falling edge at 0.0000 deg",
    ]


def test_without_an_edge_the_command_reports_so(axisbus, tmp_path):
    code, out, _ = axisbus("probe", cell(tmp_path), "x", "--zero-pulse", "--for", "0.2")
    assert code == 1
    assert out.splitlines()[-1] == "x: no edge"


def test_a_drive_without_a_touch_probe_is_refused_before_the_bus_is_opened(axisbus, tmp_path, monkeypatch):
    monkeypatch.setattr(probe, "machine_of", None)
    code, _, err = axisbus("probe", cell(tmp_path, eds=MODULE), "x")
    assert code != 0
    assert "60B8h" in err
    assert "gim6010-8.eds" in err
