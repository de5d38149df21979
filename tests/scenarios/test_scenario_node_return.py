"""A node that loses its supply and returns to a running machine: booted by a call or automatically, never energised unasked.

Everything is judged by the frames on the wire and by the simulated drives, not by the master's own view.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.errors import AxisbusError, BootError, DriveError, NodeError, NodeStateError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.motion.command_status import Status
from axisbus.motion.states import AxisState
from axisbus.record.load import load
from axisbus.sim.power import Effort
from axisbus.testing import Simulation, simulate
from kit.cell import cell_text

PERIOD = 0.01
MAPPINGS = [(0x1600 + table + number, sub) for table in (0, 0x400) for number in range(4) for sub in range(4)]
SYNC = 0x080
GROUP = '\n[groups.all]\naxes = ["x", "y"]\n'
HOMING = 'speed_switch = 20.0\nspeed_zero = 5.0\nacceleration = 100.0\ntimeout = "60s"\n'
GANTRY = '\n[gantries.beam]\naxes = ["x", "y"]\nmax_skew = 2.0\n'


class Witness:
    """Records the SYNCs on the wire, and whether a drive without a request of the program ever had power."""

    def __init__(self, simulation: Simulation, names: str) -> None:
        self.syncs: list[float] = []
        self.machine = simulation.machine
        self._drives = {name: simulation.drive(name) for name in names}
        self.energised: set[str] = set()
        self.machine.session.tap(self._hear, (SYNC,))

    def _hear(self, frames: tuple[CanFrame, ...]) -> None:
        self.syncs += [frame.time for frame in frames]
        self.energised |= {
            name for name, drive in self._drives.items() if drive.power.effort is not Effort.OFF
        }

    def begin(self) -> None:
        """Forget what was recorded so far."""
        self.energised.clear()

    @property
    def longest(self) -> float:
        """The longest time between two SYNCs."""
        return max(later - earlier for earlier, later in pairwise(self.syncs))


@contextmanager
def cell(folder: Path, names: str, more: str = "", **changes: str) -> Iterator[tuple[Simulation, Witness]]:
    """Simulate a cell in virtual time; errors of closing are only suppressed for axes that were lost."""
    file = folder / "cell.toml"
    text = cell_text(names, more=more, **changes)
    file.write_text(text.replace("method = 35\n", f"method = 35\n{HOMING}"), encoding="utf-8")
    with suppress(DriveError), simulate(file) as simulation:
        yield simulation, Witness(simulation, names)


def node_of(machine: Machine, name: str) -> int:
    """Return the node-ID of an axis."""
    return machine.cell.axes[name].node


def switch_off(machine: Machine, names: str) -> None:
    """Take the supply of the nodes of these axes away."""
    for name in names:
        machine.simulated_node(node_of(machine, name)).switch_off()


def switch_on(machine: Machine, names: str) -> None:
    """Give the supply back."""
    for name in names:
        machine.simulated_node(node_of(machine, name)).switch_on()


def enable(*axes: Axis) -> None:
    """Enable axes, and wait."""
    for axis in axes:
        axis.enable().wait(5)


def boot(machine: Machine, names: str) -> None:
    """Boot the nodes of these axes."""
    for name in names:
        assert machine.node(node_of(machine, name)).boot().ok


def assert_waits_for_reset(axis: Axis) -> None:
    """The axis has begun again: in ErrorStop, with the reason, not homed, without power."""
    assert axis.state is AxisState.ERRORSTOP
    assert isinstance(axis.error, NodeError)
    assert "was booted again" in axis.error.message
    assert not axis.homed
    with pytest.raises(StateError):
        axis.enable().wait(5)


def assert_usable(simulation: Simulation, axis: Axis) -> None:
    """The axis can be reset, is enabled without a jump, and moves as commanded."""
    axis.reset().wait(5)
    assert axis.state is AxisState.DISABLED
    before = simulation.position(axis.name)
    enable(axis)
    simulation.machine.sleep(0.5)
    assert simulation.position(axis.name) == pytest.approx(before, abs=0.05)
    axis.move_relative(3.0).wait(10)
    assert simulation.position(axis.name) == pytest.approx(before + 3.0, abs=0.05)


# -- what the axis was doing when its supply failed -----------------------------------------------------------------------


def idle(machine: Machine) -> list[Handle]:
    """Nothing: the axes are disabled."""
    return []


def enabled(machine: Machine) -> list[Handle]:
    """The axes are enabled and at standstill."""
    enable(machine["x"], machine["y"])
    return []


def profile_move(machine: Machine) -> list[Handle]:
    """A move in profile position mode."""
    enable(machine["x"])
    return [machine["x"].move_absolute(300.0, velocity=60.0)]


def group_line(machine: Machine) -> list[Handle]:
    """A straight line of both axes (csp)."""
    enable(machine["x"], machine["y"])
    return [machine.group("all").move_linear((200.0, 100.0), velocity=60.0)]


def gear_slave(machine: Machine) -> list[Handle]:
    """The axis follows another one by a gear."""
    enable(machine["x"], machine["y"])
    machine["x"].gear_in(machine["y"], 1.0).wait(5)
    return [machine["y"].move_velocity(60.0)]


def gear_master(machine: Machine) -> list[Handle]:
    """Another axis follows it by a gear."""
    enable(machine["x"], machine["y"])
    machine["y"].gear_in(machine["x"], 1.0).wait(5)
    return [machine["x"].move_velocity(60.0)]


def homing(machine: Machine) -> list[Handle]:
    """It is being homed."""
    enable(machine["x"])
    return [machine["x"].home(1)]


def trajectory(machine: Machine) -> list[Handle]:
    """The axis follows a function of time (csp)."""
    enable(machine["x"])
    return [machine["x"].follow(lambda t: 20.0 * (1.0 - math.cos(t)), duration=20.0)]


def stream(machine: Machine) -> list[Handle]:
    """Both axes follow points that the program sends."""
    enable(machine["x"], machine["y"])
    points = machine.group("all").stream(period=0.1)
    number = 0
    while points.try_push((0.5 * number, 0.25 * number)):
        number += 1
    return [points.handle]


def superimposed(machine: Machine) -> list[Handle]:
    """A superimposed distance on a velocity, with an override."""
    enable(machine["x"])
    machine["x"].set_override(0.5)
    return [machine["x"].move_velocity(60.0)]


@pytest.mark.parametrize(
    "doing",
    [
        idle,
        enabled,
        profile_move,
        group_line,
        gear_slave,
        gear_master,
        homing,
        trajectory,
        stream,
        superimposed,
    ],
    ids=lambda doing: doing.__name__,
)
@pytest.mark.parametrize("lost", ["x", "xy"])
def test_a_node_that_returns_is_booted_while_the_others_continue(
    tmp_path: Path, doing: Callable[[Machine], list[Handle]], lost: str
) -> None:
    with cell(tmp_path, "xyz", GROUP) as (simulation, witness):
        machine = simulation.machine
        enable(machine["z"])
        machine["z"].move_velocity(45.0).wait(5)
        handles = doing(machine)
        machine.sleep(1.0)
        switch_off(machine, lost)
        machine.sleep(4.0)
        assert all(handle.status in (Status.ERROR, Status.ABORTED, Status.DONE) for handle in handles)
        witness.begin()
        skipped = machine.cycle_jitter.skipped
        switch_on(machine, lost)
        machine.sleep(1.0)
        for name in lost:
            with pytest.raises(NodeStateError):
                machine[name].reset().wait(5)
        boot(machine, lost)
        machine.sleep(1.0)
        assert not witness.energised & set(lost)
        for name in lost:
            assert_waits_for_reset(machine[name])
            assert machine[name].override == 1.0
        assert machine["z"].state is AxisState.CONTINUOUS_MOTION
        assert simulation.drive("z").velocity == pytest.approx(4500, abs=20)
        assert machine.cycle_jitter.skipped == skipped
        assert witness.longest == pytest.approx(PERIOD, abs=1e-3)
        for name in lost:
            assert_usable(simulation, machine[name])
        other = machine["y"]
        if other.error is not None:
            other.reset().wait(5)
        enable(other)
        machine.group("all").move_linear((10.0, 10.0), velocity=30.0).wait(20)
        assert simulation.position("y") == pytest.approx(10.0, abs=0.1)


def test_a_node_that_returns_with_other_stored_mappings_gets_those_of_the_cell_again(tmp_path: Path) -> None:
    """A recording of an object that a PDO carries continues with its values at the new place."""
    pytest.importorskip("mcap")
    path = tmp_path / "over.mcap"
    with (
        cell(tmp_path, "xy") as (simulation, witness),
        simulation.machine.recording(path, objects=["x:607A"]),
    ):
        machine, device = simulation.machine, simulation.machine.simulated_node(1).device
        before = [device.read(*key) for key in MAPPINGS]
        for key in MAPPINGS:  # as another tool would have stored them
            device._stored[key[0] << 8 | key[1]] = 0
        device._stored[0x1A00_01], device._stored[0x1A00_00] = 0x1001_0008, 1
        machine.sleep(0.5)
        switch_off(machine, "x")
        machine.sleep(2.0)
        witness.begin()
        switch_on(machine, "x")
        machine.sleep(1.0)
        assert device.read(0x1A00, 1) == 0x1001_0008
        boot(machine, "x")
        assert device.read(0x1A00, 1) != 0x1001_0008
        assert [device.read(*key) for key in MAPPINGS] != before
        assert not witness.energised
        assert_waits_for_reset(machine["x"])
        assert_usable(simulation, machine["x"])
        machine.sleep(1.0)
        target = device.read(0x607A)
    values = load(path).objects["x:607A"].columns["value"]
    assert values[-1] == target
    assert max(values) == target
    assert min(values) == pytest.approx(0, abs=5)


@pytest.mark.parametrize("count", [1, 2, 4, 8])
def test_all_drives_lose_their_supply_and_return_in_any_order(tmp_path: Path, count: int) -> None:
    """The usual emergency stop: the machine is used again without being closed, one axis after the other."""
    names = "abcdefgh"[:count]
    with cell(tmp_path, names) as (simulation, witness):
        machine = simulation.machine
        for name in names:
            enable(machine[name])
            machine[name].move_velocity(60.0).wait(5)
        switch_off(machine, names)
        machine.sleep(6.0)
        witness.begin()
        for name in reversed(names):
            switch_on(machine, name)
            machine.sleep(0.7)
            boot(machine, name)
            assert_waits_for_reset(machine[name])
        assert not witness.energised
        for name in names:
            assert_usable(simulation, machine[name])
        assert witness.longest == pytest.approx(PERIOD, abs=1e-3)


def test_the_pair_of_a_gantry_is_square_as_found_after_one_side_has_returned(tmp_path: Path) -> None:
    with cell(tmp_path, "xy", GANTRY) as (simulation, _):
        machine = simulation.machine
        beam = machine.gantry("beam")
        beam.enable().wait(5)
        beam.move_absolute(50.0, velocity=40.0)
        machine.sleep(0.6)
        switch_off(machine, "y")
        machine.sleep(5.0)
        apart = simulation.position("y") - simulation.position("x")
        switch_on(machine, "y")
        machine.sleep(1.0)
        boot(machine, "y")
        machine.sleep(0.2)
        beam.reset().wait(5)
        beam.enable().wait(5)
        beam.move_relative(-5.0, velocity=20.0).wait(10)
        assert simulation.position("y") - simulation.position("x") == pytest.approx(apart, abs=0.3)


def test_a_boot_up_names_each_step_as_it_begins(tmp_path: Path) -> None:
    with cell(tmp_path, "x") as (simulation, _):
        machine, steps = simulation.machine, list[str]()
        assert machine.node(1).boot(steps.append).ok
        assert steps == [
            *("find", "identity", "state", "pre-operational", "program", "restore", "configuration"),
            *("error control", "completion", "start"),
        ]
        steps.clear()
        switch_off(machine, "x")
        machine.sleep(1.0)
        with pytest.raises(BootError):
            machine.node(1).boot(steps.append)
        assert steps == ["find"]


# -- boot-ups that fail, are repeated or refused --------------------------------------------------------------------------


def test_a_node_that_does_not_return_is_not_booted_and_the_error_says_so(tmp_path: Path) -> None:
    with cell(tmp_path, "xy") as (simulation, _):
        machine = simulation.machine
        switch_off(machine, "x")
        machine.sleep(1.0)
        with pytest.raises(BootError) as caught:
            machine.node(1).boot()
        assert caught.value.letter == "B"
        assert machine["x"].state is AxisState.ERRORSTOP
        assert machine["x"].error is not None
        assert machine["x"].error.message == caught.value.message
        switch_on(machine, "x")
        machine.sleep(1.0)
        boot(machine, "x")
        assert_usable(simulation, machine["x"])


def test_a_supply_that_fails_during_the_boot_up_lets_it_fail_and_be_repeated(tmp_path: Path) -> None:
    with cell(tmp_path, "xy") as (simulation, witness):
        machine = simulation.machine
        switch_off(machine, "x")
        machine.sleep(1.0)
        for delay in (0.02, 0.05, 0.08):
            switch_on(machine, "x")
            machine.sleep(1.0)
            simulation.after(delay, lambda: switch_off(machine, "x"))
            with pytest.raises(BootError):
                machine.node(1).boot()
            assert machine["x"].state is AxisState.ERRORSTOP
            with pytest.raises(NodeStateError):
                machine["x"].reset().wait(5)
        switch_on(machine, "x")
        machine.sleep(1.0)
        boot(machine, "x")
        assert not witness.energised
        assert_usable(simulation, machine["x"])


def test_a_node_that_falls_silent_while_its_identity_is_read_is_reported_as_silent(tmp_path: Path) -> None:
    with cell(tmp_path, "x") as (simulation, _):
        machine, steps = simulation.machine, set[str]()
        switch_off(machine, "x")
        machine.sleep(1.0)
        for delay in (0.010, 0.0105, 0.011, 0.0115):
            switch_on(machine, "x")
            machine.sleep(1.0)
            simulation.after(delay, lambda: switch_off(machine, "x"))
            with pytest.raises(BootError, match="answer") as caught:
                machine.node(1).boot()
            steps.add(caught.value.step)
            assert machine["x"].error is not None
            assert machine["x"].error.message == caught.value.message
        assert "identity" in steps
        switch_on(machine, "x")
        machine.sleep(1.0)
        boot(machine, "x")
        assert_usable(simulation, machine["x"])


def test_a_node_that_was_stopped_by_nmt_while_it_started_is_booted(tmp_path: Path) -> None:
    """It answers no SDO at first, so the stop sequence ends with an NMT stop; after that it sends neither heartbeat nor answers."""
    with cell(tmp_path, "x") as (simulation, witness):
        machine, node = simulation.machine, simulation.machine.simulated_node(1)
        enable(machine["x"])
        machine["x"].move_velocity(45.0).wait(5)
        switch_off(machine, "x")
        machine.sleep(1.0)
        node.device.dials.sdo_silent = True
        switch_on(machine, "x")
        machine.sleep(8.0)
        node.device.dials.sdo_silent = False
        machine.sleep(1.0)
        assert node.device.nmt is NmtState.STOPPED
        witness.begin()
        boot(machine, "x")
        assert_waits_for_reset(machine["x"])
        assert not witness.energised


def test_a_node_that_restarts_again_after_its_boot_up_is_lost_again(tmp_path: Path) -> None:
    with cell(tmp_path, "x") as (simulation, _):
        machine = simulation.machine
        for _ in range(3):
            switch_off(machine, "x")
            machine.sleep(1.0)
            switch_on(machine, "x")
            machine.sleep(1.0)
            boot(machine, "x")
            assert_usable(simulation, machine["x"])


def test_another_serial_number_is_refused_if_the_cell_file_names_one(tmp_path: Path) -> None:
    with cell(tmp_path, "x") as (simulation, _):
        machine = simulation.machine
        serial = machine.cell.nodes[1]
        object.__setattr__(serial, "serial", 0)
        switch_off(machine, "x")
        machine.sleep(1.0)
        machine.simulated_node(1).swap(4711)
        switch_on(machine, "x")
        machine.sleep(1.0)
        with pytest.raises(BootError) as caught:
            machine.node(1).boot()
        assert caught.value.letter == "O"
        assert simulation.device("x").nmt is NmtState.PRE_OPERATIONAL
        assert machine["x"].state is AxisState.ERRORSTOP


@pytest.mark.parametrize("state", ["enabled", "moving"])
def test_a_node_with_an_enabled_axis_is_not_booted(tmp_path: Path, state: str) -> None:
    with cell(tmp_path, "x") as (simulation, _):
        machine = simulation.machine
        enable(machine["x"])
        if state == "moving":
            machine["x"].move_velocity(30.0).wait(5)
        before = machine["x"].state
        with pytest.raises(StateError, match="node 1 cannot be booted now"):
            machine.node(1).boot()
        assert machine["x"].state is before
        machine["x"].disable().wait(5)
        boot(machine, "x")
        assert_usable(simulation, machine["x"])


def test_a_lost_node_whose_drive_has_power_is_not_booted(tmp_path: Path) -> None:
    """It is pre-operational, so no RPDO of the master reaches it, and another master has enabled it meanwhile."""
    with cell(tmp_path, "x") as (simulation, _):
        machine, device = simulation.machine, simulation.device("x")
        enable(machine["x"])
        device.nmt_command(NmtCommand.ENTER_PRE_OPERATIONAL)
        machine.sleep(8.0)
        mapping = device.read(0x1600, 0)
        device.drive.start_enabled()
        with pytest.raises(BootError, match="is not booted again: its drive is enabled") as caught:
            machine.node(1).boot()
        assert "TREAT x AS MOVING" in caught.value.remedy
        assert device.nmt is NmtState.PRE_OPERATIONAL
        assert device.read(0x1600, 0) == mapping


def test_closing_waits_for_a_boot_up_and_leaves_the_node_without_power(tmp_path: Path) -> None:
    with cell(tmp_path, "xy") as (simulation, witness):
        machine = simulation.machine
        enable(machine["y"])
        switch_off(machine, "x")
        machine.sleep(1.0)
        switch_on(machine, "x")
        machine.sleep(1.0)
        simulation.after(0.03, lambda: machine.session.request_stop("the test"))
        with pytest.raises(AxisbusError):
            machine.node(1).boot()
        machine.close()
        assert "x" not in witness.energised
        assert simulation.drive("y").power.effort is Effort.OFF


def test_an_axis_is_not_reset_while_its_node_is_booted(tmp_path: Path) -> None:
    """The node is fine and operational at first, so that only the boot-up is a reason."""
    with cell(tmp_path, "x") as (simulation, witness):
        machine, handles = simulation.machine, list[Handle]()
        for delay in (0.005, 0.02, 0.05, 0.08):
            simulation.after(delay, lambda: handles.append(machine["x"].reset()))
            boot(machine, "x")
            machine.sleep(0.1)
        errors = [handle.error for handle in handles]
        assert any(error is not None and "is being booted" in error.message for error in errors)
        assert not witness.energised


@pytest.mark.parametrize("restarted", [False, True])
@pytest.mark.parametrize("command", ["halt", "stop", "quick_stop", "disable", "coast", "reset", "group"])
def test_a_command_given_during_a_boot_up_ends(tmp_path: Path, command: str, restarted: bool) -> None:
    with cell(tmp_path, "xy", GROUP) as (simulation, witness):
        machine, handles = simulation.machine, list[Handle]()
        x = machine["x"]
        calls: dict[str, Callable[[], Handle]] = {
            "coast": partial(x.disable, coast=True),
            "group": machine.group("all").quick_stop,
        }
        call = calls.get(command) or getattr(x, command)
        for delay in (0.005, 0.02, 0.05, 0.08, 0.1, 0.12):
            if restarted:
                switch_off(machine, "x")
                machine.sleep(1.0)
                switch_on(machine, "x")
                machine.sleep(1.0)
            simulation.after(delay, lambda: handles.append(call()))
            with suppress(BootError):  # a stop may take the place of one of its transfers
                machine.node(1).boot()
        machine.sleep(2.0)
        assert len(handles) == 6
        assert not any(handle.busy for handle in handles)
        assert all(handle.done or handle.exception() for handle in handles)
        assert not witness.energised
        boot(machine, "x")
        assert_usable(simulation, machine["x"])


def test_an_aborted_boot_up_leaves_the_axis_in_error_stop_until_the_next_one(tmp_path: Path) -> None:
    def abort() -> None:
        raise KeyboardInterrupt

    with cell(tmp_path, "x") as (simulation, _):
        machine = simulation.machine
        node, before = machine.node(1), machine._core.runtime.link.boot
        machine._core.runtime.link.boot = lambda *_: abort()
        with pytest.raises(KeyboardInterrupt):
            node.boot()
        machine._core.runtime.link.boot = before
        machine.sleep(0.1)
        assert machine["x"].error is not None
        assert "was aborted" in machine["x"].error.message
        boot(machine, "x")
        assert_usable(simulation, machine["x"])


# -- automatically ---------------------------------------------------------------------------------------------------------


def rejoining(folder: Path, names: str) -> object:
    """Simulate a cell whose nodes are booted automatically."""
    text = cell_text(names, bus='on_lost_node = "report"').replace("\neds =", '\nrejoin = "automatic"\neds =')
    (folder / "cell.toml").write_text(text, encoding="utf-8")
    return simulate(folder / "cell.toml")


def test_a_node_with_rejoin_automatic_is_booted_and_waits_for_a_reset(tmp_path: Path) -> None:
    with rejoining(tmp_path, "xy") as simulation:
        machine, witness = simulation.machine, Witness(simulation, "xy")
        enable(machine["y"])
        machine["y"].move_velocity(30.0).wait(5)
        switch_off(machine, "x")
        machine.sleep(3.0)
        switch_on(machine, "x")
        machine.sleep(4.0)
        assert_waits_for_reset(machine["x"])
        assert "x" not in witness.energised
        assert machine["y"].state is AxisState.CONTINUOUS_MOTION
        assert_usable(simulation, machine["x"])


def test_a_node_is_booted_automatically_although_stops_have_cut_off_the_questions_whether_it_answers(
    tmp_path: Path,
) -> None:
    with rejoining(tmp_path, "x") as simulation:
        machine = simulation.machine
        enable(machine["x"])
        switch_off(machine, "x")
        machine.sleep(3.0)
        for _ in range(30):
            machine["x"].quick_stop()
            machine.sleep(0.07)
        switch_on(machine, "x")
        machine.sleep(5.0)
        assert_waits_for_reset(machine["x"])
        assert_usable(simulation, machine["x"])


def test_a_node_that_restarts_continuously_is_booted_three_times_only(tmp_path: Path) -> None:
    with rejoining(tmp_path, "x") as simulation:
        machine, device = simulation.machine, simulation.device("x")
        booted = 0
        for _ in range(5):
            switch_off(machine, "x")
            machine.sleep(1.0)
            switch_on(machine, "x")
            machine.sleep(4.0)
            booted += device.nmt is NmtState.OPERATIONAL
        assert booted == 3
        boot(machine, "x")
        assert_usable(simulation, machine["x"])


def swap(machine: Machine, serial: int, **what: int) -> None:
    """Put another drive in the place of that of node 1, while the supply is off."""
    switch_off(machine, "x")
    machine.sleep(2.0)
    machine.simulated_node(1).swap(serial, **what)
    switch_on(machine, "x")
    machine.sleep(6.0)


def assert_booted_automatically(machine: Machine) -> None:
    """Node 1 was booted without a command, and its axis waits for a reset."""
    assert machine.simulated_node(1).device.nmt is NmtState.OPERATIONAL
    assert_waits_for_reset(machine["x"])


@pytest.mark.parametrize(
    ("what", "letter", "differs"),
    [
        ({"serial": 4712}, "O", "its serial number is 0x1268 (4712), it was 0x1267 (4711)"),
        ({"serial": 4712, "revision": 9}, "N", "its serial number is 0x1268 (4712), it was 0x1267 (4711)"),
        ({"serial": 4711, "revision": 9}, "N", "its revision number is 0x9 (9), it was 0x10001 (65537)"),
        ({"serial": 4711, "product_code": 9}, "M", "its product code is 0x9 (9), it was 0x7 (7)"),
    ],
)
def test_another_drive_is_not_booted_automatically_in_the_place_of_the_one_before(
    tmp_path: Path, what: dict[str, int], letter: str, differs: str
) -> None:
    with rejoining(tmp_path, "xy") as simulation:
        machine, device = simulation.machine, simulation.device("x")
        device.swap(4711, revision=0x10001, product_code=7)
        machine.sleep(1.0)
        boot(machine, "x")
        swap(machine, **{"revision": 0x10001, "product_code": 7, **what})
        error = machine["x"].error
        assert isinstance(error, BootError)
        assert (error.letter, error.step) == (letter, "identity")
        assert "node 1 has returned as another device" in error.message
        assert differs in error.observed
        assert "axisbus replace CELL 1" in error.remedy
        assert "axisbus boot CELL --node 1" in error.remedy
        machine.sleep(5.0)
        assert device.nmt is NmtState.PRE_OPERATIONAL
        assert device.read(0x1017) == 0  # nothing was written
        with pytest.raises(NodeStateError):
            machine["x"].reset().wait(5)


def test_another_drive_that_was_booted_by_a_call_is_the_one_that_is_booted_automatically_from_then_on(
    tmp_path: Path,
) -> None:
    with rejoining(tmp_path, "x") as simulation:
        machine, device = simulation.machine, simulation.device("x")
        device.swap(4711)
        machine.sleep(1.0)
        boot(machine, "x")
        swap(machine, 4712)
        assert device.nmt is NmtState.PRE_OPERATIONAL
        boot(machine, "x")
        machine.sleep(2.0)
        switch_off(machine, "x")
        machine.sleep(2.0)
        switch_on(machine, "x")
        machine.sleep(4.0)
        assert_booted_automatically(machine)
        machine.sleep(60.0)  # the next boot-ups are not in a row with these
        swap(machine, 4711)
        assert device.nmt is NmtState.PRE_OPERATIONAL
        swap(machine, 4712)
        assert_booted_automatically(machine)
        assert_usable(simulation, machine["x"])


@pytest.mark.parametrize(("before", "now"), [(0, 4711), (4711, 0), (0, 0)])
def test_a_drive_without_a_serial_number_cannot_be_told_apart_and_is_booted_automatically(
    tmp_path: Path, before: int, now: int
) -> None:
    with rejoining(tmp_path, "x") as simulation:
        machine = simulation.machine
        machine.simulated_node(1).swap(before)
        machine.sleep(1.0)
        boot(machine, "x")
        swap(machine, now)
        assert_booted_automatically(machine)


# -- the position ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("absolute", [True, False])
def test_a_confirmed_position_stays_confirmed_only_on_a_drive_that_keeps_it(
    tmp_path: Path, absolute: bool
) -> None:
    text = cell_text("x")
    if absolute:
        text = text.replace("method = 35\n", "method = 35\nabsolute = true\n")
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    with simulate(tmp_path / "cell.toml") as simulation:
        machine = simulation.machine
        enable(machine["x"])
        machine["x"].move_relative(20.0).wait(10)
        machine["x"].set_position(7.0).wait(5)
        assert machine["x"].homed
        machine["x"].disable().wait(5)
        switch_off(machine, "x")
        machine.sleep(1.0)
        switch_on(machine, "x")
        machine.sleep(1.0)
        boot(machine, "x")
        machine["x"].reset().wait(5)
        assert machine["x"].homed is absolute
        assert machine["x"].position == pytest.approx(7.0 if absolute else 20.0, abs=0.05)


# -- the adapter -----------------------------------------------------------------------------------------------------------


def test_nodes_are_booted_after_a_bus_off_during_which_they_have_restarted(tmp_path: Path) -> None:
    with cell(tmp_path, "xy") as (simulation, witness):
        machine = simulation.machine
        enable(machine["x"], machine["y"])
        machine["x"].move_velocity(60.0).wait(5)
        simulation.bus_off(True)
        switch_off(machine, "xy")
        machine.sleep(6.0)
        switch_on(machine, "xy")
        machine.sleep(1.0)
        simulation.bus_off(False)
        machine.sleep(1.0)
        witness.begin()
        boot(machine, "xy")
        assert not witness.energised
        for name in "xy":
            assert_waits_for_reset(machine[name])
            assert_usable(simulation, machine[name])


def test_a_node_that_restarted_while_its_cable_was_cut_is_booted(tmp_path: Path) -> None:
    """The master has not heard its boot-up message, and no heartbeat comes, because 1017h is 0 again."""
    with cell(tmp_path, "xy") as (simulation, witness):
        machine, device = simulation.machine, simulation.device("x")
        enable(machine["x"])
        device.dials.dead = True
        machine.sleep(3.0)
        switch_off(machine, "x")
        machine.sleep(1.0)
        switch_on(machine, "x")
        machine.sleep(1.0)
        device.dials.dead = False
        machine.sleep(1.0)
        witness.begin()
        boot(machine, "x")
        assert not witness.energised
        assert_waits_for_reset(machine["x"])
        assert_usable(simulation, machine["x"])
