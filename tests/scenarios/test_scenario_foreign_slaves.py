"""Slaves of other CANopen stacks with their own EDS: boot, enable, pp, pv, homing, halt, quick stop, fault, disable, close.

The slaves are fakes (kit/foreign_slaves.py). The tests judge a motion by the state of the fake, never by the master's report. If a
slave cannot do a command, the command must fail with that reason, and the master must not report standstill while the
slave moves.
"""

from __future__ import annotations

import itertools
import math
import os
import re
import time
from pathlib import Path

import pytest

from axisbus.errors import (
    AxisbusError,
    ConfigError,
    DriveError,
    FollowingError,
    HomingError,
    LimitError,
    ModeError,
    NodeError,
    SetPointError,
    StaleError,
    StateError,
    UncommandedMotion,
)
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.foreign_slaves import (
    DRIVES,
    NODE,
    OPERATIONAL,
    PP,
    QUICK_STOP,
    REACHED,
    SLAVES,
    CanworksSlave,
    EdsTable,
    EsppSlave,
    ForeignSlave,
)

_CHANNELS = itertools.count(1)
SCALE = 1000  # increments per mm
CELL = """\
[bus]
interface = "virtual"
channel = "{channel}"
scan_period = "10ms"
heartbeat = "100ms"
[nodes.1]
eds = "{eds}"
{node}
[axes.x]
node = 1
unit = "mm"
scale = 1000
max_velocity = 20.0
max_acceleration = 50.0
{axis}
[axes.x.defaults]
velocity = 2.0
acceleration = 4.0
"""
HOMING = """\
[axes.x.homing]
method = 35
required = false
"""
# Lines of the cell file that a slave needs beside its EDS. ros2_canopen's own configuration writes these two objects, too.
ROS2_OBJECTS = '[nodes.1.objects]\n"6081" = 1000\n"6083" = 2000'
HOMING_LINES = {"canworks": "speed_switch = 1.0\nspeed_zero = 0.5\n"}
NODE_LINES = {"ros2_canopen": ROS2_OBJECTS}
AXIS_LINES = {"ros2_canopen": 'handshake = "on-change"'}
NO_HOMING = ("modm-canopen", "ZLAC8015D")  # 6098h is not in their EDS
MOVING = ("ros2_canopen", "espp", "canworks")
OBEYING = ("espp", "canworks")  # they halt and do a quick stop


class Bench:
    """A slave of another stack, and a machine with it as axis x."""

    def __init__(self, folder: Path, name: str, axis: str | None = None) -> None:
        """``axis``: lines for the table of the axis, instead of those that the slave needs."""
        kind = SLAVES[name]
        if not kind.eds_is_there():
            pytest.skip(f"no {kind.EDS} in the corpus")
        channel = f"axisbus-foreign-{os.getpid()}-{next(_CHANNELS)}"
        self.slave: ForeignSlave = kind(channel)
        text = CELL.format(
            channel=channel,
            eds=_eds_file(folder, kind),
            node=NODE_LINES.get(name, ""),
            axis=AXIS_LINES.get(name, "") if axis is None else axis,
        )
        self.file = folder / "cell.toml"
        homing = "" if name in NO_HOMING else HOMING + HOMING_LINES.get(name, "")
        self.file.write_text(text + homing, encoding="utf-8")
        self.machine: Machine

    def __enter__(self) -> Bench:
        self.slave.__enter__()
        try:
            self.machine = Machine.open(self.file)
        except BaseException:
            self.slave.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.machine.close()
        finally:
            self.slave.__exit__()

    @property
    def x(self) -> Axis:
        return self.machine["x"]

    @property
    def position(self) -> float:
        """The position of the slave in mm."""
        return self.slave.position / SCALE

    def enabled(self) -> Bench:
        """Enable the axis."""
        self.x.enable().wait(5)
        assert self.slave.energised
        return self

    def start_move(self, distance: float) -> Handle:
        """Begin a relative move and return in the middle of it."""
        handle = self.x.move_relative(distance)
        time.sleep(0.8)
        self.must_move()
        return handle

    def failure_of(self, handle: Handle, limit: float = 20.0) -> AxisbusError:
        """Return the error that ends a command."""
        with pytest.raises(AxisbusError) as caught:
            handle.wait(limit)
        return caught.value

    def span(self, seconds: float) -> float:
        """Let time pass; return in mm how far the slave went meanwhile."""
        began = len(self.slave.track)
        time.sleep(seconds)
        positions = [position for _, position, _ in self.slave.track[began:]]
        return (max(positions) - min(positions)) / SCALE

    def must_move(self) -> None:
        """Check that the slave moves."""
        assert self.span(0.1) > 0.01

    def must_be_still(self, at: float | None = None, *, energised: bool) -> None:
        """Check that the slave is at standstill, its position in mm (if given), and whether it has power."""
        assert self.span(0.4) <= 0.001
        assert self.slave.energised is energised
        assert at is None or self.position == pytest.approx(at, abs=0.002)

    def must_never_have_been_beyond(self, lowest: float, highest: float) -> None:
        """Check the positions since the slave began, in mm."""
        positions = [position / SCALE for _, position, _ in self.slave.track]
        assert lowest - 0.002 <= min(positions)
        assert max(positions) <= highest + 0.002


def _eds_file(folder: Path, kind: type[ForeignSlave]) -> str:
    """Return the path of a slave's EDS: that of the corpus itself, or a generated file."""
    if not isinstance(kind.EDS, EdsTable):
        return str(kind.corpus_file())
    (folder / "slave.eds").write_text(kind.eds_text(), encoding="ascii")
    return "slave.eds"


each_slave = pytest.mark.parametrize("name", DRIVES)
each_moving = pytest.mark.parametrize("name", MOVING)
each_obeying = pytest.mark.parametrize("name", OBEYING)


# -- boot and power ----------------------------------------------------------------------------------------------------


@each_slave
def test_a_foreign_slave_boots_and_closes_without_power(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        assert bench.slave.nmt == OPERATIONAL
        assert bench.slave.get(0x1017) == 100
        bench.must_be_still(0.0, energised=False)
        assert bench.x.state is AxisState.DISABLED
    assert not bench.slave.energised
    assert not any(energised for _, _, energised in bench.slave.track)


class Counting(CanworksSlave):
    """A slave that misses our heartbeat from the write of 1016h on, as modm-canopen does after a first session."""

    EDS = EdsTable(
        CanworksSlave.EDS.vendor,
        CanworksSlave.EDS.product,
        CanworksSlave.EDS.rows
        + "1016   ARR -      -             Consumer heartbeat time\n"
        + "1016.0 U8  const  1             Number of entries\n"
        + "1016.1 U32 rw     0             Consumer heartbeat time 1\n",
    )

    def __init__(self, channel: str, node: int = NODE) -> None:
        super().__init__(channel, node)
        self.missed: list[float] = []  # when the consumer time had passed
        self.heard = math.inf

    def written(self, index: int, subindex: int) -> None:
        super().written(index, subindex)
        if index == 0x1016:
            self.heard = time.monotonic() if self.get(0x1016, 1) & 0xFFFF else math.inf

    def _take(self, can_id: int, data: bytes) -> None:
        if can_id == 0x77F and self.heard < math.inf:
            self.heard = time.monotonic()
        super()._take(can_id, data)

    def step(self, dt: float) -> None:
        super().step(dt)
        if time.monotonic() > self.heard + (self.get(0x1016, 1) & 0xFFFF) / 1000:
            self.missed.append(time.monotonic())
            self.emcy(0x8130, 0x10)
            self.heard = math.inf


def test_a_slave_that_counts_from_the_write_of_1016h_misses_no_heartbeat(tmp_path, monkeypatch):
    monkeypatch.setitem(SLAVES, "counting", Counting)
    beside = """
[nodes.2]
eds = "slave.eds"
optional = true
[axes.y]
node = 2
unit = "mm"
scale = 1000
"""  # it is not there, and waiting for it takes seconds
    bench = Bench(tmp_path, "counting")
    bench.file.write_text(bench.file.read_text() + beside)
    with bench:
        assert bench.slave.heard < math.inf
        bench.enabled().span(1.0)
    assert bench.slave.missed == []


@each_slave
def test_a_foreign_slave_is_enabled_disabled_and_enabled_again_without_a_motion(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        for _ in range(2):
            bench.enabled()
            bench.must_be_still(0.0, energised=True)
            bench.x.disable().wait(5)
            bench.must_be_still(0.0, energised=False)
        bench.enabled()
    assert not bench.slave.energised
    bench.must_never_have_been_beyond(0.0, 0.0)


@each_moving
def test_a_foreign_slave_has_no_power_after_the_machine_closed_at_the_end_of_a_move(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().x.move_absolute(1.0).wait(10)
    assert not bench.slave.energised
    assert bench.position == pytest.approx(1.0, abs=0.002)


def test_a_slave_with_its_axes_in_sub_indices_is_refused_before_the_first_frame(tmp_path):
    bench = Bench(tmp_path, "ZLAC8015D")
    with bench.slave as slave:
        with pytest.raises(ConfigError, match="several axes in the sub-indices of one object") as caught:
            Machine.open(bench.file)
        time.sleep(0.5)
        assert slave.heard == 0
    assert "6064h (position actual value)" in caught.value.observed


# -- profile position --------------------------------------------------------------------------------------------------


@each_moving
def test_a_foreign_slave_moves_to_positions_and_by_distances(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled()
        for command, goal in (
            (lambda: bench.x.move_absolute(3.0), 3.0),
            (lambda: bench.x.move_relative(-1.0), 2.0),
            (lambda: bench.x.move_relative(0.5), 2.5),
            (lambda: bench.x.move_absolute(-1.0), -1.0),
        ):
            command().wait(15)
            bench.must_be_still(goal, energised=True)
        bench.must_never_have_been_beyond(-1.0, 3.0)


@each_obeying
def test_a_move_that_replaces_another_ends_at_its_own_target(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().start_move(9.0)
        bench.x.move_absolute(-1.0).wait(15)
        bench.must_be_still(-1.0, energised=True)


def test_a_set_point_without_acknowledge_is_an_error_that_names_the_key_of_the_cell_file(tmp_path):
    with Bench(tmp_path, "ros2_canopen", axis="") as bench:
        failed = bench.failure_of(bench.enabled().x.move_absolute(3.0))
        assert isinstance(failed, SetPointError)
        assert 'handshake = "on-change"' in failed.remedy
        time.sleep(4.0)  # it goes to its target all the same
        bench.must_be_still(3.0, energised=True)


# -- profile velocity --------------------------------------------------------------------------------------------------


@each_obeying
def test_a_foreign_slave_moves_at_a_velocity_and_halts(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled()
        for velocity in (1.5, -1.0):
            bench.x.move_velocity(velocity).wait(10)
            began = bench.position
            time.sleep(1.0)
            assert bench.position - began == pytest.approx(velocity, rel=0.02)
        bench.x.halt().wait(10)
        bench.must_be_still(energised=True)


@each_obeying
def test_a_foreign_slave_moves_to_a_position_after_a_halt_in_pv(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().x.move_velocity(1.5).wait(10)
        bench.x.halt().wait(10)
        bench.x.move_absolute(0.0).wait(15)
        bench.must_be_still(0.0, energised=True)


def test_a_slave_that_moves_a_hundred_times_too_fast_in_pv_is_stopped(tmp_path):
    with Bench(tmp_path, "ros2_canopen") as bench:
        bench.enabled().x.move_velocity(1.0)
        assert bench.span(0.5) < 10.0  # it goes 100 mm/s
        bench.must_be_still(energised=True)
        assert isinstance(bench.x.error, LimitError | FollowingError)  # whichever is seen first


def test_a_slave_without_a_motor_does_not_follow_in_pv(tmp_path):
    with Bench(tmp_path, "modm-canopen") as bench:
        failed = bench.failure_of(bench.enabled().x.move_velocity(1.0))
        assert isinstance(failed, FollowingError)
        time.sleep(2.0)
        bench.must_be_still(0.0, energised=True)
        with pytest.raises(DriveError, match="could not be switched off"):  # quick stop leaves it with power
            bench.machine.close()


# -- homing ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [35, 37])
@each_moving
def test_a_foreign_slave_is_homed_in_place(tmp_path, name, method):
    with Bench(tmp_path, name) as bench:
        bench.enabled().x.home(method).wait(10)
        assert bench.slave.get(0x6098) == method
        assert bench.x.homed
        bench.must_be_still(0.0, energised=True)
        bench.x.move_absolute(1.0).wait(10)
        bench.must_be_still(1.0, energised=True)


@each_moving
def test_a_foreign_slave_is_homed_away_from_zero_and_moves_from_there(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().x.move_absolute(2.0).wait(10)
        bench.x.home().wait(10)
        bench.must_be_still(0.0, energised=True)
        bench.x.move_absolute(1.0).wait(10)
        bench.must_be_still(1.0, energised=True)


def test_a_homing_method_that_the_slave_does_not_have_is_an_error(tmp_path):
    with Bench(tmp_path, "canworks") as bench:
        failed = bench.failure_of(bench.enabled().x.home(1))
        assert isinstance(failed, HomingError)
        assert "bit 13" in failed.observed
        assert not bench.x.homed
        bench.must_be_still(0.0, energised=True)


# -- a drive without 6061h ---------------------------------------------------------------------------------------------


class Blind(CanworksSlave):
    """A slave without 6061h: nothing shows whether it has taken a mode."""

    EDS = EdsTable(
        CanworksSlave.EDS.vendor,
        CanworksSlave.EDS.product,
        "\n".join(row for row in CanworksSlave.EDS.rows.splitlines() if not row.startswith("6061"))
        .replace("1A00.0 U8 rw 2 ", "1A00.0 U8 rw 1 ")
        .replace("0x60610008", "0x00000000"),
    )


def test_a_drive_without_6061h_takes_no_command_that_needs_another_mode(tmp_path, monkeypatch):
    monkeypatch.setitem(SLAVES, "blind", Blind)
    with Bench(tmp_path, "blind") as bench:
        bench.enabled().x.move_absolute(1.0).wait(10)
        bench.must_be_still(1.0, energised=True)
        for command in (lambda: bench.x.home(35), lambda: bench.x.move_velocity(1.0)):
            failed = bench.failure_of(command())
            assert isinstance(failed, StateError)
            assert "6061h" in failed.observed
            bench.must_be_still(1.0, energised=True)
        assert not bench.x.homed
        assert bench.x.error is None
        assert any("6061h" in doubt for doubt in bench.machine.reports[0].text().splitlines())


def test_a_drive_without_6061h_runs_the_one_mode_that_the_cell_file_names(tmp_path, monkeypatch):
    monkeypatch.setitem(SLAVES, "blind", Blind)
    with Bench(tmp_path, "blind", axis='modes = ["pv"]') as bench:
        bench.enabled().x.move_velocity(1.5).wait(10)
        began = bench.position
        time.sleep(1.0)
        assert bench.position - began == pytest.approx(1.5, rel=0.02)
        bench.x.halt().wait(10)
        bench.must_be_still(energised=True)


# -- a drive that ignores writes of its COB-IDs -------------------------------------------------------------------------


class FixedCobIds(CanworksSlave):
    """A slave that acknowledges writes of its COB-IDs and ignores them; all its PDOs but the first are off."""

    EDS = EdsTable(
        CanworksSlave.EDS.vendor,
        CanworksSlave.EDS.product,
        re.sub(
            r"(1[48]0[123]\.1 U32 rw \$NODEID\+)(0x\w+)",
            lambda found: f"{found[1]}{int(found[2], 16) | 0x8000_0000:#x}",
            CanworksSlave.EDS.rows,
        ),
    )

    def _download(self, index: int, subindex: int, data: bytes) -> None:
        if index not in (*range(0x1400, 0x1404), *range(0x1800, 0x1804)) or subindex != 1:
            super()._download(index, subindex, data)


@pytest.mark.parametrize("node", ["", 'remap = "never"'], ids=["auto", "never"])
def test_a_drive_that_ignores_writes_of_its_cob_ids_is_used_with_the_pdos_that_are_on(
    tmp_path, monkeypatch, node
):
    monkeypatch.setitem(SLAVES, "fixed", FixedCobIds)
    monkeypatch.setitem(NODE_LINES, "fixed", node)
    with Bench(tmp_path, "fixed") as bench:
        bench.enabled().x.move_absolute(1.0).wait(10)
        bench.must_be_still(1.0, energised=True)
        bench.x.disable().wait(5)
        bench.must_be_still(energised=False)


# -- a drive that never reports its arrival -------------------------------------------------------------------------------


class NeverReached(CanworksSlave):
    """A slave that never sets bit 10 of the statusword."""

    def _status(self, word: int) -> int:
        return super()._status(word) & ~REACHED


def test_a_drive_that_does_not_report_its_arrival_is_named_and_not_a_blocked_axis(tmp_path, monkeypatch):
    monkeypatch.setitem(SLAVES, "unreported", NeverReached)
    with Bench(tmp_path, "unreported") as bench:
        failed = bench.failure_of(bench.enabled().x.move_absolute(1.0))
        bench.must_be_still(1.0, energised=True)
        assert "bit 10) is 0" in failed.observed
        assert "6067h" in failed.remedy
        assert "csp" in failed.remedy
        assert "blocked" not in failed.remedy


# -- a slow SDO server -------------------------------------------------------------------------------------------------


class SlowServer(CanworksSlave):
    """A slave whose SDO server needs 0.3 s for each answer; its PDOs are as fast as those of others."""

    def __init__(self, channel: str, node: int = NODE) -> None:
        super().__init__(channel, node)
        self.answers: list[tuple[float, bytes]] = []

    def _send(self, can_id: int, data: bytes) -> None:
        if can_id == 0x580 + self.node:
            self.answers.append((time.monotonic() + 0.3, data))
        else:
            super()._send(can_id, data)

    def _tick(self, now: float) -> None:
        while self.answers and self.answers[0][0] <= now:
            super()._send(0x580 + self.node, self.answers.pop(0)[1])
        super()._tick(now)


def test_a_drive_with_a_slow_sdo_server_is_moved_over_its_synchronous_pdos(tmp_path, monkeypatch):
    monkeypatch.setitem(SLAVES, "slow", SlowServer)
    with Bench(tmp_path, "slow") as bench:
        bench.enabled()
        for goal in (1.0, -1.0):
            bench.x.move_absolute(goal).wait(15)
            bench.must_be_still(goal, energised=True)
        bench.x.disable().wait(5)


# -- a drive without 1005h ---------------------------------------------------------------------------------------------


class WithoutSync(CanworksSlave):
    """A slave without 1005h that does not react to SYNC."""

    EDS = EdsTable(
        CanworksSlave.EDS.vendor,
        CanworksSlave.EDS.product,
        "\n".join(row for row in CanworksSlave.EDS.rows.splitlines() if not row.startswith("1005")),
    )

    def _sync(self) -> None:
        pass


def test_a_drive_without_1005h_gets_a_warning_whose_remedy_works(tmp_path, monkeypatch):
    monkeypatch.setitem(SLAVES, "without", WithoutSync)
    with Bench(tmp_path, "without") as bench:
        assert any("1005h" in each and "sync = false" in each for each in bench.machine.reports[0].warnings)
    bench = Bench(tmp_path, "without")
    text = bench.file.read_text().replace("[nodes.1]", "sync = false\n[nodes.1]")
    bench.file.write_text(text)
    with bench:
        assert not any("1005h" in each for each in bench.machine.reports[0].warnings)
        bench.enabled().x.move_absolute(1.0).wait(10)
        bench.must_be_still(1.0, energised=True)


# -- missing modes -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "lacks"),
    [
        (lambda x: x.move_absolute(1.0), "6081h"),
        (lambda x: x.move_relative(1.0), "6081h"),
        (lambda x: x.home(35), "6098h"),
    ],
    ids=["absolute", "relative", "homing"],
)
def test_a_mode_without_its_objects_is_refused_and_the_object_named(tmp_path, command, lacks):
    with Bench(tmp_path, "modm-canopen") as bench:
        failed = bench.failure_of(command(bench.enabled().x))
        assert isinstance(failed, StateError)
        assert f"its EDS lacks {lacks}" in failed.observed
        bench.must_be_still(0.0, energised=True)
        assert bench.x.error is None


def test_a_mode_that_the_cell_file_leaves_out_is_refused_and_named(tmp_path):
    with Bench(tmp_path, "canworks", axis='modes = ["pp", "pv", "hm"]') as bench:
        failed = bench.failure_of(bench.enabled().x.cyclic_velocity(1.0))
        assert isinstance(failed, StateError)
        assert "does not have csv" in failed.message
        assert bench.slave.mode == PP


# csv: its objects are in each EDS, and no 6502h claims it. The result if the cell file names it all the same:
UNCLAIMED = {
    "ros2_canopen": (FollowingError, "does not follow"),  # it shows the mode and does not move
    "espp": (StateError, "needs 6041h, 606Ch, 6064h and 60FFh in synchronous PDOs"),
    "canworks": (ModeError, "does not enter mode 9 (csv)"),
}


@pytest.mark.parametrize("name", UNCLAIMED)
def test_a_mode_that_6502h_does_not_claim_is_refused(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        failed = bench.failure_of(bench.enabled().x.cyclic_velocity(1.0))
        assert isinstance(failed, StateError)
        assert "does not have csv" in failed.message
        assert "6502h" in failed.observed
        assert "modes = [...]" in failed.remedy
        bench.must_be_still(0.0, energised=True)
        assert bench.x.error is None


@pytest.mark.parametrize("name", UNCLAIMED)
def test_a_mode_that_only_the_cell_file_has_ends_in_an_error_without_a_motion(tmp_path, name):
    kind, words = UNCLAIMED[name]
    named = 'modes = ["pp", "pv", "hm", "csv"]\n' + AXIS_LINES.get(name, "")
    with Bench(tmp_path, name, axis=named) as bench:
        failed = bench.failure_of(bench.enabled().x.cyclic_velocity(1.0))
        assert isinstance(failed, kind)
        assert words in failed.message
        bench.must_be_still(0.0, energised=True)


# -- halt --------------------------------------------------------------------------------------------------------------


@each_obeying
def test_a_foreign_slave_halts_in_the_middle_of_a_move(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().start_move(9.0)
        bench.x.halt().wait(10)
        bench.must_be_still(energised=True)
        assert 0.5 < bench.position < 3.0


@each_obeying
def test_a_halted_drive_has_its_own_position_as_target(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().start_move(9.0)
        bench.x.halt().wait(10)
        assert bench.slave.target == pytest.approx(bench.slave.position, abs=100)


@each_obeying
def test_a_foreign_slave_moves_again_after_a_halt(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().start_move(9.0)
        bench.x.halt().wait(10)
        halted = bench.position
        bench.x.move_relative(1.0).wait(10)
        bench.must_be_still(halted + 1.0, energised=True)


def test_a_halt_that_the_foreign_slave_ignores_ends_only_at_standstill(tmp_path):
    with Bench(tmp_path, "ros2_canopen") as bench:
        bench.enabled().start_move(1.0)
        bench.x.halt().wait(10)
        bench.must_be_still(1.0, energised=True)


def test_a_halt_that_the_slave_ignores_for_too_long_is_an_error(tmp_path):
    with Bench(tmp_path, "ros2_canopen") as bench:
        bench.enabled().start_move(9.0)
        failed = bench.failure_of(bench.x.halt())
        assert isinstance(failed, DriveError)
        assert "did not come to standstill on a halt in time" in failed.remedy
        bench.must_be_still(9.0, energised=False)


# -- quick stop, disable and close in the middle of a move -------------------------------------------------------------


@each_obeying
def test_a_foreign_slave_stops_quickly_in_the_middle_of_a_move(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().start_move(9.0)
        bench.x.quick_stop().wait(10)
        bench.must_be_still(energised=False)
        assert bench.position < 1.5


def test_a_quick_stop_that_the_slave_ignores_is_not_reported_as_standstill(tmp_path):
    with Bench(tmp_path, "ros2_canopen") as bench:
        bench.enabled().start_move(12.0)
        failed = bench.failure_of(bench.x.quick_stop())
        bench.must_move()
        assert isinstance(failed, DriveError)
        assert "the stop of the axis could not be confirmed" in failed.message
        time.sleep(4.0)
        bench.must_be_still(12.0, energised=False)


def test_after_a_quick_stop_it_is_enabled_again_and_moves(tmp_path):
    with Bench(tmp_path, "canworks") as bench:
        bench.enabled().start_move(9.0)
        bench.x.quick_stop().wait(10)
        stopped = bench.position
        bench.enabled()
        bench.must_be_still(stopped, energised=True)
        bench.x.move_absolute(0.0).wait(15)
        bench.must_be_still(0.0, energised=True)


def test_a_slave_that_continues_to_its_old_target_when_enabled_is_stopped(tmp_path):
    with Bench(tmp_path, "espp") as bench:
        bench.enabled().start_move(9.0)
        bench.x.quick_stop().wait(10)
        stopped = bench.position
        failed = bench.failure_of(bench.x.enable())
        assert isinstance(failed, UncommandedMotion)
        time.sleep(0.5)
        bench.must_be_still(energised=False)
        assert bench.position < stopped + 0.5  # of the 7.8 mm to its target


@each_obeying
def test_a_foreign_slave_is_disabled_in_the_middle_of_a_move(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().start_move(9.0)
        bench.x.disable().wait(10)
        bench.must_be_still(energised=False)
        assert bench.position < 3.0


@each_obeying
def test_a_foreign_slave_moves_after_it_was_disabled_in_the_middle_of_a_move(tmp_path, name):
    with Bench(tmp_path, name) as bench:
        bench.enabled().start_move(9.0)
        bench.x.disable().wait(10)
        bench.enabled()
        bench.x.move_absolute(0.0).wait(15)
        bench.must_be_still(0.0, energised=True)


@each_obeying
def test_closing_the_machine_in_the_middle_of_a_move_leaves_the_slave_at_standstill_without_power(
    tmp_path, name
):
    with Bench(tmp_path, name) as bench:
        bench.enabled().start_move(9.0)
        bench.machine.close()
        bench.must_be_still(energised=False)
        assert bench.position < 3.0


def test_closing_the_machine_reports_a_slave_that_does_not_stop(tmp_path):
    with Bench(tmp_path, "ros2_canopen") as bench:
        bench.enabled().start_move(12.0)
        with pytest.raises(DriveError, match="the stop of the axis could not be confirmed"):
            bench.machine.close()
        bench.must_move()


def test_a_slave_that_is_silent_until_its_move_has_ended_is_lost_and_not_at_standstill(tmp_path):
    with Bench(tmp_path, "ros2_canopen") as bench:
        bench.enabled().start_move(12.0)
        failed = bench.failure_of(
            bench.x.move_velocity(1.0)
        )  # another mode: the slave waits for the end of its move
        bench.must_move()
        assert isinstance(failed, NodeError | StaleError)  # whichever is seen first
        failed = bench.failure_of(bench.x.stop())
        assert "the stop of the axis could not be confirmed" in failed.message
        with pytest.raises(DriveError):
            bench.machine.close()


# -- quick stop active, faults, a second enable -------------------------------------------------------------------------


def test_a_slave_that_quick_stop_leaves_with_power_is_enabled_and_disabled(tmp_path):
    with Bench(tmp_path, "modm-canopen") as bench:
        bench.enabled().x.quick_stop().wait(10)
        assert bench.slave.state == QUICK_STOP
        assert bench.x.state is not AxisState.DISABLED
        bench.x.enable().wait(5)
        bench.x.disable().wait(5)
        bench.must_be_still(0.0, energised=False)


def test_a_slave_that_cannot_be_switched_off_is_reported_as_energised(tmp_path):
    with Bench(tmp_path, "modm-canopen") as bench:
        bench.enabled().x.quick_stop().wait(10)
        failed = bench.failure_of(bench.x.disable())  # it takes no disable voltage in quick stop active
        assert bench.slave.energised
        assert isinstance(failed, DriveError)
        assert "could not be switched off" in failed.message
        with pytest.raises(DriveError):
            bench.machine.close()


def test_after_a_fault_it_is_reset_and_enabled_and_moves(tmp_path):
    with Bench(tmp_path, "espp") as bench:
        bench.enabled().x.move_absolute(1.0).wait(10)
        bench.machine.node(1).sdo[0x2000] = 1
        time.sleep(0.5)
        bench.must_be_still(1.0, energised=False)
        assert isinstance(bench.x.error, DriveError)
        assert "0xFF00" in bench.x.error.observed
        failed = bench.failure_of(bench.x.enable())
        assert isinstance(failed, StateError)
        assert not bench.slave.energised
        bench.x.reset().wait(5)
        bench.must_be_still(1.0, energised=False)
        bench.enabled().x.move_absolute(2.0).wait(10)
        bench.must_be_still(2.0, energised=True)


def test_a_fault_in_the_middle_of_a_move_ends_the_move_and_stops_the_axis(tmp_path):
    with Bench(tmp_path, "espp") as bench:
        moving = bench.enabled().start_move(9.0)
        bench.machine.node(1).sdo[0x2000] = 1
        failed = bench.failure_of(moving)
        assert isinstance(failed, DriveError)
        bench.must_be_still(energised=False)
        assert bench.position < 1.5


def test_a_slave_that_moves_no_more_after_a_second_enable_is_reported(tmp_path):
    with Bench(tmp_path, "ros2_canopen") as bench:
        bench.enabled().x.move_absolute(1.0).wait(10)
        bench.x.disable().wait(5)
        failed = bench.failure_of(bench.enabled().x.move_absolute(2.0))
        assert isinstance(failed, SetPointError)
        assert "no sign that the drive has accepted the set-point" in failed.message
        bench.must_be_still(1.0, energised=True)
        with pytest.raises(DriveError, match="the axis was blocked"):  # the drive may still be led to 2 mm
            bench.machine.close()
        bench.must_be_still(1.0, energised=False)


# -- the fakes themselves ----------------------------------------------------------------------------------------------


@each_slave
def test_a_fake_has_the_objects_of_its_eds(tmp_path, name):
    kind = SLAVES[name]
    if not kind.eds_is_there():
        pytest.skip(f"no {kind.EDS} in the corpus")
    slave = kind(f"axisbus-foreign-{os.getpid()}-{next(_CHANNELS)}")
    slave._bus.shutdown()
    assert {(0x1000, 0), (0x1018, 4), (0x1400, 1), (0x6040, 0), (0x6041, 0), (0x6064, 0)} <= set(
        slave.entries
    )
    assert slave.get(0x1400, 1) & 0x7FF == 0x201
    assert slave.get(0x1A00) == len(list(slave._mapped(0x1800)))


def test_the_rpdo_of_espp_clears_bit_12(tmp_path):
    slave = EsppSlave(f"axisbus-foreign-{os.getpid()}-{next(_CHANNELS)}")
    slave._bus.shutdown()
    for word in (0x06, 0x07, 0x0F, 0x1F):
        slave.take_rpdo(0x1400, bytes([word, 0, 1]))
    slave.refresh()
    assert slave.get(0x6041) & 0x1000
    slave.take_rpdo(0x1400, bytes([0x1F, 0, 1]))
    slave.refresh()
    assert not slave.get(0x6041) & 0x1000
