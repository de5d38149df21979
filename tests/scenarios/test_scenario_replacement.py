"""A drive is replaced while the machine runs: the other axes go on, nothing is energised, and the axis waits for a reset."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from itertools import pairwise
from pathlib import Path

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.configuration.dcf_backup import backup
from axisbus.configuration.nameplate import read_nameplate
from axisbus.configuration.replacement_order import ReplacementOutcome, ReplacementStep
from axisbus.configuration.replacement_plan import NodeToReplace, ReplacementPlan, plan
from axisbus.eds import dcf, writer
from axisbus.eds.io import reader
from axisbus.errors import AxisbusError, BusError, DriveError, NodeError, StateError
from axisbus.machine.machine_node import MachineNode
from axisbus.motion.states import AxisState
from axisbus.sim.power import Effort
from axisbus.testing import Simulation, simulate
from kit.cell import cell_text, with_identity

PERIOD, SYNC = 0.01, 0x080
NODE, OLD, NEW = 1, 4711, 4712
VENDOR, PRODUCT = 0x123, 7
VELOCITY = 123_456  # 6081h, which no cell file sets
GROUP = '\n[groups.all]\naxes = ["x", "y"]\n'
WAYS = {"same node-ID": {}, "another node-ID": {"node_id": 9}, "no node-ID": {"node_id": 255}}


class Bench:
    """A machine whose node 1 has a nameplate and a backup; records SYNC, and whether the drive x had power."""

    def __init__(self, folder: Path, simulation: Simulation) -> None:
        self.simulation = simulation
        self.machine = machine = simulation.machine
        self.file = folder / "x.dcf"
        self.syncs: list[float] = []
        self.energised = False
        device = simulation.device("x")
        device.swap(OLD)
        machine.sleep(1.0)
        device.write(0x6081, 0, VELOCITY)
        node = machine.node(NODE)
        reading = reader.read(with_identity(VENDOR, PRODUCT).encode(), "drive.eds")
        self.file.write_bytes(writer.dumps(backup(node.parts.objects, reading, dcf.Settings(NODE)).reading))
        self.was = read_nameplate(MachineNode(node), machine.cell)
        node.boot()
        machine["x"].reset().wait(5)

    def watch(self) -> None:
        """Record from now on."""
        self.machine.session.tap(self._hear, (SYNC,))

    def _hear(self, frames: tuple[CanFrame, ...]) -> None:
        self.syncs += [frame.time for frame in frames]
        self.energised |= self.simulation.drive("x").power.effort is not Effort.OFF

    def swap(self, **what: int) -> None:
        """The drive loses its supply, and a new one is there."""
        drive = self.machine.simulated_node(NODE)
        drive.switch_off()
        self.machine.sleep(3.0)
        drive.device.swap(NEW, **what)
        self.watch()
        drive.switch_on()
        self.machine.sleep(1.0)

    def plan(self) -> ReplacementPlan:
        """The plan as the command makes it."""
        known = NodeToReplace(
            NODE, "cell.toml", VENDOR, PRODUCT, 0, was=self.was, configuration=str(self.file), running=True
        )
        return plan(known, self.machine.node(NODE).find_replacement())

    def replace(self) -> ReplacementOutcome:
        """Replace the drive."""
        return self.machine.node(NODE).replace_drive(self.plan().order)


@contextmanager
def bench(folder: Path, names: str = "xyz", more: str = "", *, absolute: bool = False) -> Iterator[Bench]:
    """A machine in virtual time; errors of closing are only suppressed for axes that were lost."""
    (folder / "drive.eds").write_text(with_identity(VENDOR, PRODUCT), encoding="utf-8")
    file = folder / "cell.toml"
    text = cell_text(names, eds="drive.eds", more=more)
    if absolute:
        text = text.replace("method = 35", "method = 35\nabsolute = true")
    file.write_text(text, encoding="utf-8")
    with suppress(DriveError), simulate(file) as simulation:
        yield Bench(folder, simulation)


@pytest.mark.parametrize("way", WAYS.values(), ids=list(WAYS))
def test_a_drive_is_replaced_while_the_other_axes_go_on(tmp_path: Path, way: dict[str, int]) -> None:
    with bench(tmp_path, more=GROUP) as rig:
        machine = rig.machine
        for name in "yz":
            machine[name].enable().wait(5)
        machine["z"].move_velocity(45.0).wait(5)
        rig.swap(**way)
        skipped = machine.cycle_jitter.skipped
        machine["y"].reset().wait(5)
        machine["y"].enable().wait(5)
        machine["y"].move_velocity(30.0).wait(5)  # a member of the group of the lost axis
        outcome = rig.replace()
        machine.sleep(0.5)
        assert outcome.written > 0
        assert not outcome.not_stored
        assert not rig.energised
        assert machine["x"].state is AxisState.ERRORSTOP
        assert isinstance(machine["x"].error, NodeError)
        assert "was booted again" in machine["x"].error.message
        for name in "yz":
            assert machine[name].state is AxisState.CONTINUOUS_MOTION
        assert machine.cycle_jitter.skipped == skipped
        longest = max(later - earlier for earlier, later in pairwise(rig.syncs))
        assert longest == pytest.approx(PERIOD, abs=1e-3)
        device = rig.simulation.device("x")
        assert (device.node_id, device.read(0x1018, 4), device.read(0x6081)) == (NODE, NEW, VELOCITY)
        machine["x"].reset().wait(5)
        before = rig.simulation.position("x")
        machine["x"].enable().wait(5)
        machine.sleep(0.5)
        assert rig.simulation.position("x") == pytest.approx(before, abs=0.05)
        machine["x"].move_relative(3.0).wait(10)
        assert rig.simulation.position("x") == pytest.approx(before + 3.0, abs=0.05)


@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize("serials", [(OLD, NEW), (0, 0)])
def test_a_replaced_drive_is_not_homed_even_if_it_keeps_its_position_and_has_no_serial_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, serials: tuple[int, int], fails: bool
) -> None:
    """``fails``: the supply fails when the new drive is to be booted, so that it is booted by another command."""
    for name, serial in zip(("OLD", "NEW"), serials, strict=True):
        monkeypatch.setattr(sys.modules[__name__], name, serial)
    with bench(tmp_path, "xy", absolute=True) as rig:
        machine, node = rig.machine, rig.machine.node(NODE)
        machine["x"].enable().wait(5)
        machine["x"].home().wait(5)
        machine["x"].disable().wait(5)
        rig.swap()
        progress = (
            (lambda step: step is ReplacementStep.BOOT and machine.simulated_node(NODE).switch_off())
            if fails
            else lambda _: None
        )
        with pytest.raises(AxisbusError) if fails else nullcontext():
            node.replace_drive(rig.plan().order, progress)
        if fails:
            machine.simulated_node(NODE).switch_on()
            machine.sleep(1.0)
            node.boot()
        assert not machine["x"].homed
        machine["x"].reset().wait(5)
        assert not machine["x"].homed


def test_an_axis_with_power_is_not_replaced(tmp_path: Path) -> None:
    with bench(tmp_path, "xy") as rig:
        rig.swap()
        order = rig.plan().order
        rig.machine.node(NODE).boot()
        rig.machine["x"].reset().wait(5)
        rig.machine["x"].enable().wait(5)
        with pytest.raises(StateError):
            rig.machine.node(NODE).replace_drive(order)
        assert rig.machine["x"].state is AxisState.STANDSTILL
        assert rig.simulation.device("x").read(0x6081) != VELOCITY


def test_a_drive_that_is_neither_lost_nor_another_one_is_not_replaced(tmp_path: Path) -> None:
    with bench(tmp_path, "xy") as rig:
        rig.was = None
        order = rig.plan().order
        with pytest.raises(StateError, match="cannot be booted now") as caught:
            rig.machine.node(NODE).replace_drive(order)
        assert "it is operational" in caught.value.observed
        assert rig.machine["x"].state is AxisState.DISABLED
        rig.machine["x"].enable().wait(5)


def test_another_drive_that_was_booted_already_is_replaced_before_its_axis_is_enabled(tmp_path: Path) -> None:
    """As after an automatic boot-up: the new drive is operational, with factory parameters."""
    with bench(tmp_path, more=GROUP) as rig:
        machine = rig.machine
        machine["z"].enable().wait(5)
        machine["z"].move_velocity(45.0).wait(5)
        rig.swap()
        machine.node(NODE).boot()
        machine["x"].reset().wait(5)
        assert machine["x"].state is AxisState.DISABLED
        rig.replace()
        assert rig.simulation.device("x").read(0x6081) == VELOCITY
        assert machine["z"].state is AxisState.CONTINUOUS_MOTION
        assert not rig.energised
        machine["x"].reset().wait(5)
        machine["x"].enable().wait(5)


def test_a_replacement_that_fails_leaves_the_axis_in_error_stop_and_is_repeated(tmp_path: Path) -> None:
    with bench(tmp_path, more=GROUP) as rig:
        machine, device = rig.machine, rig.simulation.device("x")
        machine["z"].enable().wait(5)
        machine["z"].move_velocity(45.0).wait(5)
        rig.swap()
        device.dials.sdo_write_aborts[0x6081, 0] = 0x0609_0030
        with pytest.raises(NodeError, match="rejects 1 value"):
            rig.replace()
        machine.sleep(0.2)
        assert machine["x"].state is AxisState.ERRORSTOP
        assert machine["x"].error is not None
        assert "rejects 1 value" in machine["x"].error.message
        with pytest.raises(StateError):
            machine["x"].enable().wait(5)
        device.dials.sdo_write_aborts.clear()
        rig.replace()
        machine["x"].reset().wait(5)
        machine["x"].enable().wait(5)
        assert machine["z"].state is AxisState.CONTINUOUS_MOTION


def test_a_supply_that_fails_during_the_replacement_lets_it_fail_and_be_repeated(tmp_path: Path) -> None:
    with bench(tmp_path, "xy") as rig:
        drive, machine = rig.machine.simulated_node(NODE), rig.machine
        for delay in (0.05, 0.2, 0.6, 1.0):
            rig.swap(node_id=255)
            order = rig.plan().order
            rig.simulation.after(delay, drive.switch_off)
            with pytest.raises(BusError):
                machine.node(NODE).replace_drive(order)
            machine.sleep(1.0)
            drive.switch_on()
            machine.sleep(1.0)
        assert not rig.energised
        rig.replace()
        machine["x"].reset().wait(5)
        machine["x"].enable().wait(5)


def test_closing_while_a_drive_is_replaced_energises_nothing(tmp_path: Path) -> None:
    with bench(tmp_path, "xy") as rig:
        rig.swap()
        order = rig.plan().order
        rig.simulation.after(0.1, lambda: rig.machine.session.request_stop("the test"))
        with suppress(StateError, NodeError):
            rig.machine.node(NODE).replace_drive(order)
        rig.machine.close()
        assert not rig.energised
