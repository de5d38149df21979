"""``axisbus jitter``: a cell of its own, and a machine that runs."""

from __future__ import annotations

import json
import re

import pytest

from axisbus.machine.machine import Machine
from kit.cell import cell_file
from kit.scenarios.core_process import OWN_PROCESS, own_cell, turns, under_way

pytestmark = [pytest.mark.timeout(120)]


@pytest.fixture
def cell(tmp_path):
    return cell_file(tmp_path, "xy", period="20ms", heartbeat="1s")


def test_a_cycle_is_measured_and_drawn(axisbus, cell, tmp_path):
    pytest.importorskip("matplotlib")
    code, out, err = axisbus("jitter", cell, "--for", "1s", "-o", tmp_path / "j.png")
    assert code in (0, 1), err  # 1: a busy computer has left cycles out
    assert int(re.search(r"^(\d+) cycles of 20 ms, \d+ missing", out, re.MULTILINE)[1]) > 20
    assert re.search(r"last TPDO after its SYNC: \d+ to \d+ µs, half of them up to \d+, 99 % up to \d+", out)
    assert re.search(r"^ +-?\d+ to +-?\d+ +\d+ #+$", out, re.MULTILINE)
    assert (tmp_path / "j.png").read_bytes().startswith(b"\x89PNG")


@OWN_PROCESS
def test_jitter_next_to_a_program_that_moves_an_axis_shows_its_commands_as_well(axisbus, tmp_path):
    path = own_cell(tmp_path, "xy")
    with Machine.open(path) as machine:
        machine["x"].enable().wait(20)
        handle = under_way(machine["x"])
        code, out, err = axisbus("jitter", path, "--for", "1s", "--json")
        assert code in (0, 1), err
        assert "joined the running machine" in err
        found = json.loads(out)
        assert found["cycles"] > 20
        assert 0 < found["last_tpdo"]["p50"] < 0.02
        assert 0 < found["last_rpdo"]["p50"] < 0.02
        assert found["skew"]["p50"] < 0.02
        assert handle.active
        assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)


def test_a_cell_without_sync_has_no_cycle_to_be_measured(axisbus, tmp_path):
    path = cell_file(tmp_path, "x", period="20ms", heartbeat="1s", bus="sync = false")
    code, _, err = axisbus("jitter", path, "--for", "200ms")
    assert code == 1
    assert "no SYNC was seen" in err
