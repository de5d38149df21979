"""Tools for tests of programs: simulated machines with faults and time control, for pytest and without it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from axisbus.errors import ArgumentError, BusOff, NodeError, ScanError, StaleError, StateError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.sim.virtual_can import FrameFaults
from axisbus.testing import Simulation, simulate
from kit.cell import cell_file, cell_text

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "testing"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return cell_file(tmp_path, "xy")


def turning(simulation: Simulation) -> None:
    for axis in simulation.machine:
        axis.enable().wait(5)
        axis.move_velocity(60.0).wait(5)


def pytest_run(folder: Path) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(ROOT / "src"), *sys.path[1:]])
    return subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "-c",
            os.devnull,
            "--rootdir",
            ".",
            ".",
        ],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env=os.environ | {"PYTHONPATH": path},
    )


def test_the_example_passes_when_run_with_pytest() -> None:
    ran = pytest_run(EXAMPLE)
    assert ran.returncode == 0, ran.stdout
    assert "4 passed" in ran.stdout


def test_the_error_of_a_test_without_a_cell_file_has_the_remedy(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["axisbus.testing"]\n', "utf-8")
    (tmp_path / "test_it.py").write_text("def test_it(machine):\n    pass\n", "utf-8")
    ran = pytest_run(tmp_path)
    assert ran.returncode == 1
    assert 'mark the test with its cell file: @pytest.mark.cell("cell.toml")' in ran.stdout


def test_a_wrong_cell_file_fails_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["axisbus.testing"]\n', "utf-8")
    (tmp_path / "cell.toml").write_text("[bus]\ninterfase = 'sim'\n", "utf-8")
    test = 'import pytest\n@pytest.mark.cell("cell.toml")\ndef test_it(machine):\n    pass\n'
    (tmp_path / "test_it.py").write_text(test, "utf-8")
    ran = pytest_run(tmp_path)
    assert ran.returncode == 1
    assert "cell.toml:2" in ran.stdout


def test_the_position_of_the_motor_is_the_true_one_and_not_that_of_the_drive(file: Path) -> None:
    with simulate(file) as simulation:
        turning(simulation)
        simulation.machine.sleep(1.0)
        axis = simulation.machine["x"]
        assert simulation.position("x") == pytest.approx(
            axis.position, abs=1.5
        )  # the value is some cycles old
        simulation.drive_faults("x").feedback_delay = 0.1
        simulation.machine.sleep(1.0)
        assert simulation.position("x") - axis.position == pytest.approx(6.0, abs=1.5)


def test_actions_happen_at_their_times_in_their_order(file: Path) -> None:
    with simulate(file) as simulation:
        seen: list[tuple[float, str]] = []
        began = simulation.now
        for seconds, name in ((0.2, "c"), (0.1, "a"), (0.1, "b")):
            simulation.after(seconds, lambda name=name: seen.append((simulation.now - began, name)))
        simulation.machine.sleep(0.15)
        assert [name for _, name in seen] == ["a", "b"]
        simulation.machine.sleep(0.15)
        assert [(pytest.approx(at), name) for at, name in seen] == [(0.1, "a"), (0.1, "b"), (0.2, "c")]


def test_time_passes_after_the_scan_has_failed_and_the_drives_are_stopped_meanwhile(tmp_path: Path) -> None:
    path = cell_file(tmp_path, "xy", bus='sync_producer = "external"')
    machine = Machine.simulated(path)
    simulation = Simulation(machine)
    turning(simulation)
    simulation.after(0.1, lambda: simulation.wire_faults.by_id.update({0x80: FrameFaults(loss=1.0)}))
    began = simulation.now
    machine.sleep(1.0)
    assert simulation.now - began == pytest.approx(1.0, abs=0.01)
    assert isinstance(machine["x"].error, StaleError)
    assert all(abs(simulation.drive(name).velocity) < 1 for name in "xy")
    with pytest.raises(AssertionError, match="within 2 s"):
        simulation.until(lambda: False, limit=2.0)
    with pytest.raises(ScanError, match="SYNC"):
        machine.close()
    machine.sleep(1.0)  # of a closed machine: nothing more happens, and the call returns


@pytest.mark.parametrize("seconds", [-1, float("nan"), float("inf"), "soon"])
def test_an_invalid_time_is_refused(file: Path, seconds: float) -> None:
    with simulate(file) as simulation, pytest.raises(ArgumentError, match="not a number of seconds"):
        simulation.after(seconds, lambda: None)


def test_until_reports_how_long_it_took_and_gives_up(file: Path) -> None:
    with simulate(file) as simulation:
        turning(simulation)
        simulation.machine["x"].halt()
        assert 0.0 < simulation.until(lambda: simulation.machine["x"].state is AxisState.STANDSTILL) < 2.0
        with pytest.raises(AssertionError, match=r"not happened within 0\.5 s of virtual time"):
            simulation.until(lambda: False, limit=0.5)


def test_a_node_that_falls_silent_stops_the_others(file: Path) -> None:
    with simulate(file) as simulation:
        turning(simulation)
        simulation.node_faults("x").dead = True
        simulation.until(lambda: simulation.machine["x"].error is not None, limit=1.0)
        assert isinstance(simulation.machine["x"].error, NodeError)
        simulation.node_faults("x").dead = False
        simulation.machine.sleep(2.0)
        assert simulation.drive("y").velocity == 0


def test_a_controller_that_is_bus_off_is_reported_and_can_be_restarted(file: Path) -> None:
    with simulate(file) as simulation:
        turning(simulation)
        simulation.bus_off()
        simulation.until(lambda: simulation.machine["x"].error is not None, limit=1.0)
        assert isinstance(simulation.machine["x"].error, BusOff)
        simulation.bus_off(False)
        simulation.machine.sleep(2.0)


def test_an_unplugged_adapter_ends_the_scan_and_the_drives_stop(file: Path) -> None:
    simulation = Simulation(Machine.simulated(file))
    turning(simulation)
    drives = [simulation.drive(name) for name in "xy"]
    simulation.unplug_adapter()
    with pytest.raises(ScanError):
        simulation.machine["x"].halt().wait(1)
    with pytest.raises(ScanError, match="scan of the bus had failed"):
        simulation.machine.close()
    simulation._clock.sleep(3.0)  # no heartbeats any more
    assert [drive.velocity for drive in drives] == [0, 0]


@pytest.mark.parametrize("name", ["z", "master"])
def test_an_axis_without_a_drive_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(
        cell_text(
            "x",
            more="\n[axes.master]\nvirtual = true\nunit = 'deg'\nmax_velocity = 100.0\ndefaults.acceleration = 100.0\n",
        ),
        "utf-8",
    )
    with (
        simulate(path) as simulation,
        pytest.raises(ArgumentError, match="axes with a drive in this cell: x"),
    ):
        simulation.drive(name)


def test_a_machine_in_real_time_is_refused(file: Path) -> None:
    from types import SimpleNamespace

    with pytest.raises(StateError, match="not simulated in virtual time"):
        Simulation(SimpleNamespace(_core=SimpleNamespace()))  # type: ignore[arg-type]
