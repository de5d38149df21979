"""``axisbus sim``: the drives of a cell in one terminal, and in another the commands as with hardware."""

from __future__ import annotations

import re
import shutil
import tomllib

import pytest

from axisbus import SimulationControl
from axisbus.cli.sim import with_bus
from axisbus.errors import AdapterError, UserError
from kit import command_line
from kit.cell import cell_file, cell_text
from kit.pages import ROOT

pytestmark = [pytest.mark.timeout(180)]
SLOW = {"period": "20ms", "heartbeat": "1s"}


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A served cell, the cell file of its clients, and the options that were printed for it."""
    folder = tmp_path_factory.mktemp("served")
    mine = folder / "mine.toml"
    with command_line.simulating(cell_file(folder, "xy", **SLOW), "-o", mine) as sim:
        lines = "".join(command_line.lines_before(sim, "or take"))
        options = re.search(r"axisbus scan (-i socketcand -c sim\d+ -O host=127\.0\.0\.1 -O port=\d+)", lines)
        yield mine, options[1].split()


def test_a_bus_served_by_sim_is_scanned_checked_and_booted(axisbus, served, tmp_path):
    mine, options = served
    code, out, err = axisbus("scan", *options)
    assert code == 0, err
    assert re.search(r"\b1\b.*\n(.*\n)*.*\b2\b", out)
    assert axisbus("check", mine).code == 0
    code, out, err = axisbus("boot", mine)
    assert code == 0, err
    assert axisbus("lss", "find", *options, "-b", "1000000").code in (0, 1)
    drawn = tmp_path / "drawn.toml"
    assert axisbus("init", *options, "-o", drawn).code in (0, 1)  # 1: there are drives without an EDS
    assert tomllib.loads(drawn.read_text(encoding="utf-8"))["bus"]["interface"] == "socketcand"


def test_the_axes_of_sim_are_homed_and_moved(axisbus, served):
    mine, _ = served
    code, out, err = axisbus("home", mine, "x")
    assert code == 0, err
    code, out, err = axisbus("move", mine, "x=10", "y=-5", "--home")
    assert code == 0, err
    at = {name: float(re.search(rf"{name}: at (-?[\d.]+) deg", out)[1]) for name in "xy"}
    assert at == pytest.approx({"x": 10.0, "y": -5.0}, abs=0.05)


def test_the_objects_of_sim_are_read_and_its_frames_traced(axisbus, served, tmp_path):
    mine, options = served
    assert axisbus("od", "read", "x:6041", "--cell", mine).code == 0
    assert axisbus("config", "backup", "x", "--cell", mine, "-o", tmp_path / "x.dcf").code == 0
    code, out, err = axisbus("monitor", mine, "--count", "2", "--every", "0.1")
    assert code == 0, err
    assert "Disabled" in out
    code, _, err = axisbus("trace", *options, "--seconds", "1")
    assert code == 0, err
    assert axisbus("load", *options, "-b", "1000000", "--seconds", "1").code in (0, 1)


def test_an_output_that_would_not_find_its_files_is_refused(axisbus, tmp_path):
    text = cell_text("x", **SLOW)
    eds = tomllib.loads(text)["nodes"]["1"]["eds"]
    own = tmp_path / "own.eds"
    shutil.copy(ROOT / "eds" / "generic-cia402.eds", own)
    (tmp_path / "cell.toml").write_text(text.replace(eds, "own.eds"), encoding="utf-8")
    (tmp_path / "other").mkdir()
    code, _, err = axisbus(
        "sim", tmp_path / "cell.toml", "--port", "0", "-o", tmp_path / "other" / "mine.toml"
    )
    assert code in (1, 2)
    assert "would not find own.eds" in err
    # in another process, because it takes priority
    with command_line.started("sim", tmp_path / "cell.toml", "--port", "0", "--for", "200ms") as sim:
        out, err = sim.communicate(timeout=60)
    assert sim.returncode == 0, err
    assert "1 simulated node of" in out


FAULTS = """
[short_circuit]
axis = "x"
when = "x.position > 20"
fault = 0x2310

[jam]
axis = "y"
when = "y.state = operation enabled"
for = "100ms"
blocked = true
"""


def test_faults_occur_as_planned_and_a_test_can_observe_the_plant(axisbus, tmp_path):
    mine, faults, control = (tmp_path / name for name in ("mine.toml", "faults.toml", "c"))
    faults.write_text(FAULTS, encoding="utf-8")
    options = ("-o", mine, "--faults", faults, "--control", control)
    with command_line.simulating(cell_file(tmp_path, "xy", **SLOW), *options) as sim:
        command_line.lines_before(sim, "or take")
        with SimulationControl(control) as plant:
            assert plant.nodes == (1, 2)
            began = plant.simulated_node(1).drive().position
            code, _, err = axisbus("move", mine, "x=50", "--home", "--velocity", "30")
            assert code == 3
            assert "0x2310" in err
            assert plant.simulated_node(1).drive().position > began
            assert plant.simulated_node(1).drive().error_code == 0x2310
            assert re.search(r"\d s  short_circuit: axis = x, fault = 2310h", sim.stdout.readline())
            assert axisbus("move", mine, "y=5", "--home").code in (0, 3)
            assert re.search(r"jam: axis = y, blocked = true", sim.stdout.readline())
            assert re.search(r"jam is over", sim.stdout.readline())
    with pytest.raises(AdapterError, match="no simulated drives are served"):
        SimulationControl(control)


def test_only_the_bus_is_replaced():
    bus = '[bus]\ninterface = "sim"   # a\nscan_period = "4ms"\n[bus.options]\nhistory = "a"\n'
    source = f'# mine\n{bus}\n[nodes.1]\neds = "a.eds"\n'
    changed = with_bus(source, ['interface = "socketcand"', 'channel = "sim1"', "options = { port = 1 }"])
    assert tomllib.loads(changed) == {
        "bus": {"interface": "socketcand", "channel": "sim1", "options": {"port": 1}, "scan_period": "4ms"},
        "nodes": {"1": {"eds": "a.eds"}},
    }
    assert changed.startswith("# mine\n")
    with pytest.raises(UserError, match=r"no line \[bus\]"):
        with_bus('bus.interface = "sim"\n', [])


def test_modules_that_are_served_are_found_although_this_protocol_has_no_remote_frames(axisbus):
    with command_line.simulating("--can-simple", "0", "--can-simple", "5") as sim:
        *_, line = command_line.lines_before(sim, "axisbus trace")
        code, out, _ = axisbus("gim6010", "find", *line.split()[2:])
    assert code == 0
    assert "node 0: CAN Simple" in out
    assert "node 5: CAN Simple" in out
    assert out.count("supply:    24.0 V") == 2
    assert "no remote frames, by which alone they are asked, of CAN Simple: 1 to 4, 6 to 63" in out
