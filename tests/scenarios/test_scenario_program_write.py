"""The program of a node is written while the machine runs: the other axes continue, and the node is never energised unasked.

Everything is judged by the frames on the wire and by the simulated drives, not by the master's own view.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.cia301.nmt import NmtCommand
from axisbus.errors import DriveError, NodeError, NodeStateError, StateError
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode
from axisbus.machine.node_access import NodeAccess
from axisbus.motion.states import AxisState
from axisbus.sim.boot_loader import ProgramLoader
from axisbus.sim.power import Effort
from axisbus.testing import Simulation, simulate
from kit.cell import SCALE, cell_file, cell_text
from kit.eds.loader import loader_eds, program

NEW = (15_400, 43_200_000)
IMAGE = program(NEW)
PERIOD = 0.01
SYNC = 0x080
Y = 2  # its node


class Witness:
    """Records the SYNCs on the wire, and whether the drive of y ever had power."""

    def __init__(self, simulation: Simulation) -> None:
        self.syncs: list[float] = []
        self.energised = False
        self._drive = simulation.drive("y")
        simulation.machine.session.tap(self._hear, (SYNC,))

    def _hear(self, frames: tuple[CanFrame, ...]) -> None:
        self.syncs += [frame.time for frame in frames]
        self.energised |= self._drive.power.effort is not Effort.OFF

    @property
    def longest(self) -> float:
        """The longest time between two SYNCs."""
        return max(later - earlier for earlier, later in pairwise(self.syncs))


@contextmanager
def cell(
    folder: Path, more: str = "", *, absolute: bool = False, **changes: str
) -> Iterator[tuple[Simulation, Witness]]:
    """Simulate x and y in virtual time, both with a boot loader; x turns."""
    file = cell_file(folder, "xy", eds=loader_eds(folder), more=more, **changes)
    if absolute:
        file.write_text(file.read_text().replace("method = 35", "method = 35\nabsolute = true"))
    with suppress(DriveError), simulate(file) as simulation:
        witness = Witness(simulation)
        simulation.machine["x"].enable().wait(5)
        simulation.machine["x"].move_velocity(45.0).wait(5)
        yield simulation, witness


def loader(machine: Machine) -> ProgramLoader:
    """The boot loader of y."""
    found = machine.simulated_node(Y).device.loader
    assert found is not None
    return found


def assert_x_turned(simulation: Simulation, witness: Witness, skipped: int) -> None:
    """x has continued in the same cycles."""
    assert simulation.drive("x").axis.motor.velocity / SCALE == pytest.approx(45.0, abs=1.0)
    assert simulation.machine["x"].error is None
    assert simulation.machine.cycle_jitter.skipped == skipped
    assert witness.longest == pytest.approx(PERIOD, abs=1e-6)


def assert_usable_after_a_boot(simulation: Simulation) -> None:
    """y is refused until it is booted and reset, and then moves as commanded."""
    machine, y = simulation.machine, simulation.machine["y"]
    assert y.state is AxisState.ERRORSTOP
    with pytest.raises(StateError):
        y.enable().wait(5)
    with pytest.raises(NodeStateError):
        y.reset().wait(5)
    assert machine.node(Y).boot().ok
    y.reset().wait(5)
    y.enable().wait(5)
    before = simulation.position("y")
    y.move_relative(3.0).wait(10)
    assert simulation.position("y") == pytest.approx(before + 3.0, abs=0.05)


def _assert_undisturbed(node: NodeAccess) -> None:
    """Neither a write nor an NMT command is sent: the node would lose its program, or run a part of it."""
    with pytest.raises(StateError, match="reset node was not sent"):
        node.command(NmtCommand.RESET_NODE)
    for write in (
        lambda: node.sdo.__setitem__((0x1F51, 1), 1),
        lambda: MachineNode(node).sdo.download(0x1F51, 1, b"\1"),
    ):
        with pytest.raises(StateError, match="the value of 1F51h:01 was not sent"):
            write()


@pytest.mark.parametrize("restarts", [False, True], ids=["stays", "restarts"])
def test_a_program_is_written_while_another_axis_turns(tmp_path, restarts):
    with cell(tmp_path) as (simulation, witness):
        machine = simulation.machine
        dials = machine.simulated_node(Y).device.dials
        dials.program.stop_restarts = dials.program.few_objects = restarts
        dials.program.clear_time, dials.program.flash_time = 5.0, 3.0
        skipped, seen = machine.cycle_jitter.skipped, list[str]()

        def meanwhile(done: int, _total: int | None) -> None:
            if done and not seen:
                error = machine["y"].error
                assert error is not None
                seen.append(error.message)
                for refused in (machine["y"].enable, machine["y"].reset):
                    with pytest.raises(StateError):
                        refused().wait(5)
                with pytest.raises(StateError, match="node 2 cannot be booted now"):
                    machine.node(Y).boot()
                with pytest.raises(StateError, match="the program of node 2 cannot be written now"):
                    machine.node(Y).write_program(IMAGE)
                _assert_undisturbed(machine.node(Y))

        written = machine.node(Y).write_program(IMAGE, progress=meanwhile)
        assert seen == ["the program of node 2 is being written"]
        assert loader(machine).program == IMAGE
        assert written.after.version == NEW
        assert "node 2 has a new program" in str(machine["y"].error)
        assert not witness.energised
        assert_x_turned(simulation, witness, skipped)
        assert_usable_after_a_boot(simulation)
        assert_x_turned(simulation, witness, skipped)


def test_a_node_that_remains_operational_needs_a_boot_too(tmp_path):
    """It starts its new program without a restart."""
    with cell(tmp_path) as (simulation, witness):
        machine = simulation.machine
        machine.simulated_node(Y).device.loader._restart = lambda: None
        machine.node(Y).write_program(IMAGE)
        assert machine.simulated_node(Y).device.operational
        machine.sleep(1.0)
        assert not witness.energised
        assert_usable_after_a_boot(simulation)


def test_an_axis_with_a_new_program_is_not_homed_even_if_its_drive_keeps_the_position(tmp_path):
    with cell(tmp_path, absolute=True) as (simulation, _):
        machine, y = simulation.machine, simulation.machine["y"]
        y.enable().wait(5)
        y.home().wait(5)
        y.disable().wait(5)
        assert machine.node(Y).boot().ok
        assert y.homed
        machine.node(Y).write_program(IMAGE)
        assert machine.node(Y).boot().ok
        assert not y.homed
        y.reset().wait(5)
        assert not y.homed


def enabled(machine: Machine) -> None:
    machine["y"].enable().wait(5)


def moving(machine: Machine) -> None:
    enabled(machine)
    machine["y"].move_velocity(10.0).wait(5)


@pytest.mark.parametrize("doing", [enabled, moving], ids=lambda doing: doing.__name__)
def test_the_program_of_an_enabled_axis_is_not_written(tmp_path, doing: Callable[[Machine], None]):
    with cell(tmp_path) as (simulation, _):
        machine = simulation.machine
        doing(machine)
        with pytest.raises(StateError) as caught:
            machine.node(Y).write_program(IMAGE)
        assert "the program of node 2 cannot be written now" in caught.value.message
        assert loader(machine).orders == []
        assert machine["y"].error is None
        machine["y"].move_relative(1.0).wait(10)


def test_a_node_in_errorstop_gets_its_program(tmp_path):
    with cell(tmp_path) as (simulation, _):
        machine = simulation.machine
        machine["y"].enable().wait(5)
        simulation.drive("y").fault(0x2310)
        machine.sleep(1.0)
        assert machine["y"].state is AxisState.ERRORSTOP
        machine.node(Y).write_program(IMAGE)
        assert loader(machine).program == IMAGE
        assert_usable_after_a_boot(simulation)


def test_a_node_without_the_objects_is_refused_and_its_axis_is_left_as_it_is(tmp_path):
    with cell(tmp_path) as (simulation, witness):
        machine = simulation.machine
        machine.simulated_node(Y).device.dials.sdo_aborts = {
            (0x1F51, 1): 0x0602_0000,
            (0x1F50, 0): 0x0602_0000,
        }
        with pytest.raises(StateError, match="cannot be written over CANopen; nothing was sent"):
            machine.node(Y).write_program(IMAGE)
        assert not witness.energised
        machine["y"].enable().wait(5)
        machine["y"].move_relative(1.0).wait(10)


@pytest.mark.parametrize("after", [0, 500, 2000], ids=lambda after: f"after {after} bytes")
def test_a_supply_that_fails_in_mid_write_is_explained_and_the_next_write_succeeds(tmp_path, after):
    with cell(tmp_path) as (simulation, witness):
        machine = simulation.machine
        machine.simulated_node(Y).device.dials.sdo_block = False
        skipped = machine.cycle_jitter.skipped

        def fail(done: int, _total: int | None) -> None:
            if done >= after:
                machine.simulated_node(Y).switch_off()

        with pytest.raises(NodeError) as caught:
            machine.node(Y).write_program(IMAGE, deadline=2.0, progress=fail)
        assert "the old program is cleared, the new one incomplete" in caught.value.observed
        assert "loss of its supply" in caught.value.remedy
        assert "the program of node 2 could not be written" in str(machine["y"].error)
        machine.simulated_node(Y).switch_on()
        machine.sleep(2.0)
        machine.node(Y).write_program(IMAGE)
        assert loader(machine).program == IMAGE
        assert not witness.energised
        assert_x_turned(simulation, witness, skipped)
        assert_usable_after_a_boot(simulation)


def test_ctrl_c_leaves_the_axis_in_errorstop_with_the_reason(tmp_path):
    def interrupt(done: int, _total: int | None) -> None:
        if done:
            raise KeyboardInterrupt

    with cell(tmp_path) as (simulation, witness):
        machine = simulation.machine
        with pytest.raises(KeyboardInterrupt):
            machine.node(Y).write_program(IMAGE, progress=interrupt)
        assert "could not be written" in str(machine["y"].error)
        machine.node(Y).write_program(IMAGE)
        assert not witness.energised
        assert_usable_after_a_boot(simulation)


def test_a_node_that_rejoins_automatically_is_not_booted_while_its_program_is_written(tmp_path):
    file = tmp_path / "cell.toml"
    text = cell_text("xy", eds=loader_eds(tmp_path))
    file.write_text(text.replace("[nodes.2]\n", '[nodes.2]\nrejoin = "automatic"\n'), encoding="utf-8")
    with suppress(DriveError), simulate(file) as simulation:
        machine = simulation.machine
        dials = machine.simulated_node(Y).device.dials
        dials.program.stop_restarts = True
        dials.program.clear_time = dials.program.flash_time = 4.0
        reports = len(machine.reports)
        machine.node(Y).write_program(IMAGE)
        assert len(machine.reports) == reports
        assert loader(machine).orders == [0, 3, 1]
        assert loader(machine).program == IMAGE
        machine.sleep(5.0)
        assert "was booted again" in str(machine["y"].error)
        machine["y"].reset().wait(5)
        machine["y"].enable().wait(5)
