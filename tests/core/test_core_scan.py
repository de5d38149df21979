"""The scan: its grid, its order of things, the queue of commands, and how it ends."""

from __future__ import annotations

import pickle
import threading
from itertools import pairwise

import pytest

from axisbus.cia402.port import Inputs, Outputs, Sample, SdoReply, SdoRequest
from axisbus.core.lateness import Lateness
from axisbus.core.scan import Scan
from axisbus.errors import AdapterError, AxisbusError, ScanError, StaleError
from axisbus.machine.handle import NOBODY, Handle
from axisbus.motion import commands as c
from axisbus.motion.command_status import Status
from axisbus.motion.moves.follow import PathClock
from axisbus.motion.moves.homing import HomingJob
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from kit.motion.plant_recorder import ENABLED, Watch
from kit.motion.rig import PERIOD, dictionary_of, parameters, rig


class Bench:
    """A scan without axes on a clock that the test sets; ``log`` holds the calls of the cycle."""

    def __init__(self) -> None:
        self.time = 100.0
        self.log: list[tuple[str, float]] = []
        self.late: list[float] = []
        self.scan = Scan(self, {}, {}, PERIOD)

    def now(self) -> float:
        return self.time

    def wait_until(self, t: float) -> None:
        self.time = max(self.time, t) + (self.late.pop(0) if self.late else 0.0)
        self.log.append(("wait", self.time))

    def __getattr__(self, name: str):
        return lambda: self.log.append((name, self.time))

    @property
    def cycles(self) -> list[float]:
        return [t for name, t in self.log if name == "wait"]


# The grid.


def test_cycles_lie_on_an_absolute_grid():
    bench = Bench()
    for _ in range(1000):
        bench.scan.once()
        bench.time += 0.003  # the work of a cycle
    assert bench.cycles == pytest.approx([100.0 + k * PERIOD for k in range(1000)])
    assert bench.scan.lateness.skipped == 0
    assert bench.scan.lateness.cycles == 1000
    assert bench.scan.lateness.worst == pytest.approx(0.0, abs=1e-9)


def test_a_little_late_is_counted_and_the_grid_stays():
    bench = Bench()
    bench.late = [0.0, 0.004, 0.0, 0.0]
    for _ in range(4):
        bench.scan.once()
    assert bench.cycles == pytest.approx([100.0, 100.014, 100.02, 100.03])
    lateness = bench.scan.lateness
    total = lateness.report().mean * lateness.cycles
    assert (lateness.worst, total, lateness.last) == pytest.approx((0.004, 0.004, 0.0))
    assert lateness.skipped == 0


def test_missed_cycles_are_skipped_and_counted_never_caught_up_in_a_burst():
    bench = Bench()
    bench.late = [0.0, 0.0, 0.0347, 0.0, 0.0]
    for _ in range(5):
        bench.scan.once()
    # cycle 2 is done at 100.0547 instead of 100.02; those of 100.03, 100.04 and 100.05 are left out
    assert bench.cycles == pytest.approx([100.0, 100.01, 100.0547, 100.06, 100.07])
    assert bench.scan.lateness.skipped == 3
    assert bench.scan.lateness.worst == pytest.approx(0.0347)


def test_between_two_cycles_there_is_always_half_a_period():
    """Two SYNCs close together would make a drive interpolate over nothing."""
    bench = Bench()
    bench.late = [0.0, 0.0099, 0.0, 0.0051, 0.0, 0.0049, 0.0, 0.0249, 0.0]
    for _ in range(9):
        bench.scan.once()
    gaps = [b - a for a, b in pairwise(bench.cycles)]
    assert min(gaps) >= PERIOD / 2
    # the points at 0.02, 0.05 and (two of them) after 0.11 are left out
    assert bench.cycles == pytest.approx(
        [100.0, 100.0199, 100.03, 100.0451, 100.06, 100.0749, 100.08, 100.1149, 100.12]
    )
    assert bench.scan.lateness.skipped == 1 + 1 + 0 + 2


def test_a_cycle_does_its_work_in_this_order():
    bench = Bench()
    order = []
    bench.scan.observers.append(lambda *_: order.append("observe"))
    bench.scan.once()
    assert [name for name, _ in bench.log] == ["wait", "sync", "receive", "commit", "heartbeat"]
    assert order == ["observe"]


@pytest.mark.parametrize(("late", "first"), [(0.2, "sync"), (0.3, "commit")])
def test_after_a_delay_that_stops_the_axes_sync_is_sent_after_the_new_commands(late, first):
    r = rig().enabled()
    assert r.core.supervision.longest_gap == 0.25
    log = []
    for name in ("sync", "commit"):
        call = getattr(r.cycle, name)
        setattr(r.cycle, name, lambda name=name, call=call: log.append(name) or call())
    r.cycle.dials.wait_late = late
    r.run(0.001)
    assert log[0] == first
    assert sorted(log) == ["commit", "sync"]


@pytest.mark.parametrize("late", [0.03, 0.1, 0.2])
def test_a_delay_that_stops_nothing_leaves_out_no_target(late):
    r = rig().enabled()
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 50.0, 90.0, 400.0))
    r.run(0.35)
    targets = []
    latch = r.ports["x"].latch
    r.ports["x"].latch = lambda: (latch(), targets.append(r.drive.target_position))
    for delay in (0.0, late, 0.0, 0.0, late, 0.0):
        r.cycle.dials.wait_late = delay
        r.run(0.001)
    r.cycle.dials.wait_late = 0.0
    r.run(0.1)
    assert max(b - a for a, b in pairwise(targets)) <= 900 + 1  # 90 deg/s in 10 ms
    handle.wait(5)


def test_a_target_from_before_a_long_delay_does_not_move_the_axis_after_it():
    r = rig().enabled()
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 200.0, 90.0, 400.0))
    r.run(0.35)
    r.cycle.dials.wait_late = 1.0
    r.run(0.01)
    r.cycle.dials.wait_late = 0.0
    place = r.drive.position
    r.run(1.0)
    assert r.drive.position == place
    assert isinstance(handle.exception(), StaleError)


def test_axes_are_read_stepped_and_written_before_the_commit():
    r = rig("xy")
    log = []
    for name, port in r.ports.items():
        read, write = port.read, port.write
        port.read = lambda now, name=name, read=read: log.append(f"read {name}") or read(now)
        port.write = lambda outputs, name=name, write=write: log.append(f"write {name}") or write(outputs)
    commit = r.cycle.commit
    r.cycle.commit = lambda: log.append("commit") or commit()
    r.scan.once()
    assert log == ["read x", "write x", "read y", "write y", "commit"]


def test_a_late_axis_is_late_and_does_not_jump():
    clock = PathClock()
    for _ in range(50):
        clock.advance(PERIOD)
    assert clock.t == pytest.approx(0.5)


# Commands.


def test_commands_are_taken_in_the_order_in_which_they_were_given():
    r = rig().enabled()
    watch = Watch(r)
    for target in (10.0, 20.0, 30.0):
        r.axis.move_absolute(target)
    r.run(1.0)
    assert watch.targets[-1] == 30_000
    assert 10_000 not in watch.targets  # replaced before its set-point was offered


def test_many_threads_may_give_commands():
    r = rig().enabled()
    handles: list[Handle] = []

    def ask() -> None:
        handles.extend(r.axis.halt() for _ in range(50))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(handles) == 200
    r.run(0.5)
    assert all(handle.done for handle in handles)


def test_a_command_after_the_end_ends_at_once():
    r = rig().enabled()
    r.scan.end()
    handle = r.axis.move_absolute(5.0)
    assert handle.status is Status.ERROR
    assert isinstance(handle.exception(), ScanError)
    assert "the machine was closed" in str(handle.exception())


def test_when_the_scan_ends_every_handle_ends():
    r = rig("xy")
    enable = r.axes["x"].enable()
    r.run(PERIOD)
    group = r.groups["all"].halt()
    queued = r.axes["y"].enable()
    r.scan.end()
    assert [handle.status for handle in (enable, group, queued)] == [Status.ERROR] * 3
    for handle in (enable, group, queued):
        with pytest.raises(ScanError, match="the machine was closed"):
            handle.wait()


def test_a_running_fault_diagnosis_ends_too():
    r = rig().enabled()
    move = r.axis.move_absolute(100.0)
    r.run(0.2)
    r.drive.fault(0x2310)
    while r.core._fault_diagnosis is None:
        r.run(PERIOD)
    assert move.busy
    r.scan.end()
    assert isinstance(move.exception(), ScanError)


# A scan that dies.


@pytest.mark.parametrize("call", ["read", "write", "commit", "sync", "heartbeat", "wait"])
def test_a_scan_that_dies_quick_stops_the_drives_and_ends_every_handle(call):
    r = rig("xy").enabled()
    moves = [axis.move_velocity(100.0) for axis in r.axes.values()]
    for move in moves:
        move.wait(2)
    long = r.axes["x"].move_absolute(350.0, velocity=10.0)
    r.run(0.1)
    setattr(r.cycle.dials, call, AdapterError("the adapter is gone"))
    with pytest.raises(ScanError) as caught:
        long.wait(5)
    assert "AdapterError: the adapter is gone" in caught.value.observed
    assert "a quick stop was sent to every drive" in caught.value.remedy
    assert r.scan.ended
    assert isinstance(r.scan.failure, AdapterError)
    setattr(r.cycle.dials, call, None)
    r.cycle.wait_until(r.cycle.now() + 1.0)
    for name in "xy":
        assert r.drive_of(name).power.stage != ENABLED
        assert abs(r.drive_of(name).axis.motor.velocity) < 1.0


def test_an_exception_of_the_library_ends_the_scan_and_is_raised_to_the_waiting_program():
    r = rig().enabled()
    handle = r.axis.move_absolute(50.0)
    r.run(0.1)
    r.core.step = None  # type: ignore[method-assign]
    with pytest.raises(TypeError):
        handle.wait(1)
    assert isinstance(handle.exception(), ScanError)
    assert r.scan.ended


def test_run_keeps_the_reason_for_its_end():
    r = rig().enabled()
    r.cycle.dials.commit = AdapterError("gone")
    r.scan.run()
    assert isinstance(r.scan.failure, AdapterError)
    assert r.scan.ended
    other = rig()
    other.scan.observers.append(lambda *_: other.scan.quit())
    other.scan.run()
    assert other.scan.failure is None
    assert other.scan.ended


# Stopping everything.


def test_a_stop_of_everything_stops_commanded_axes_and_no_others():
    r = rig("xyz", groups={})
    r.axes["x"].enable().wait(2)
    r.axes["x"].move_velocity(100.0).wait(2)
    r.drive_of("y").start_enabled(3)
    r.drive_of("y").target_velocity = 20_000
    r.run(0.5)
    watch = Watch(r, "y")
    r.scan.request_stop("the test")
    assert not r.scan.has_stopped
    r.until(lambda: r.scan.has_stopped, 5)
    assert r.drive_of("x").power.stage != ENABLED
    assert r.drive_of("y").power.stage == ENABLED
    assert watch.words == []
    assert r.drive_of("y").velocity == 20_000
    assert r.scan.stop_failures() == []


def test_a_second_request_is_a_quick_stop():
    r = rig().enabled()
    r.axis.move_velocity(100.0, deceleration=60.0, acceleration=1000.0).wait(3)
    r.scan.request_stop("first")
    r.run(0.1)
    watch = Watch(r)
    r.scan.request_stop("second", quick=True)
    r.until(lambda: r.scan.has_stopped, 5)
    assert 11 in watch.transitions
    assert r.drive.power.stage != ENABLED
    assert abs(r.drive.axis.motor.velocity) < 1.0


def test_an_ended_scan_has_stopped():
    r = rig().enabled()
    r.scan.request_stop("x")
    r.scan.end()
    assert r.scan.has_stopped


# Transfer between threads and processes.


@pytest.mark.parametrize(
    "command",
    [
        c.EnableCommand(),
        c.Disable(True),
        c.ResetCommand(),
        c.Halt(),
        c.Stop(),
        c.Release(),
        c.QuickStop(),
        c.Move(c.TargetReference.ADDITIVE, 5, MoveProfile(1, 2, 3, 4.0, 5.0, 6.0)),
        c.MoveVelocity(MoveProfile(-1, 2, 3, None, None), 0.2),
        c.TorqueControl(100, None, 2.0),
        c.Home(HomingJob(35, 1, 2, None, 3.0)),
        c.SetPosition(7),
        c.FollowTrajectory(TrapezoidalTrajectory(0.0, 1.0, 2.0, 3.0)),
        c.FollowTrajectory(SampledTrajectory((0.0, 1.0, 1.0), 0.1)),
        c.Shutdown("bye", True),
        c.PolicyStop("x failed"),
    ],
    ids=lambda command: type(command).__name__,
)
def test_commands_can_be_pickled(command):
    assert pickle.loads(pickle.dumps(command)) == command


def test_inputs_outputs_snapshots_and_errors_can_be_pickled():
    inputs = Inputs(
        1.0, True, Sample(0x27, 1.0), None, None, None, None, None, (), (SdoReply(1, 2, None),), 5
    )
    outputs = Outputs(0x0F, 1, 5, sdo=(SdoRequest(1, 0x6081, 0, 100),))
    r = rig().enabled()
    r.drive.fault(0x2310)
    r.run(0.6)
    for value in (inputs, outputs, r.scan.snapshots["x"]._replace(error=None)):
        assert pickle.loads(pickle.dumps(value)) == value
    error = pickle.loads(pickle.dumps(r.axis.error))
    assert str(error) == str(r.axis.error)
    assert (type(error), error.code, error.axis) == (type(r.axis.error), 0x2310, "x")


def test_snapshots_are_one_consistent_set_per_cycle():
    r = rig().enabled()
    seen = []
    r.scan.observers.append(lambda now, snapshots: seen.append((now, snapshots["x"])))
    r.axis.move_absolute(10.0).wait(3)
    assert all(snapshot.now == now for now, snapshot in seen)
    assert seen[-1][1].state is AxisState.STANDSTILL
    assert seen[-1][1].target == 10_000
    assert {snapshot.state for _, snapshot in seen} == {AxisState.STANDSTILL, AxisState.DISCRETE_MOTION}


def test_lateness_is_a_handful_of_numbers():
    lateness = Lateness()
    for late in (0.001, 0.003, 0.002):
        lateness.note(late)
    assert (lateness.cycles, lateness.worst, lateness.last) == (3, 0.003, 0.002)
    assert lateness.report().mean == pytest.approx(0.002)


def test_parameters_of_a_cell_can_be_pickled():
    value = parameters("x", dictionary_of(__import__("kit.motion.rig", fromlist=["GENERIC"]).GENERIC))
    assert pickle.loads(pickle.dumps(value)).name == "x"


def test_a_handle_without_a_scan_never_blocks():
    handle = Handle("x", NOBODY)
    with pytest.raises(TimeoutError):
        handle.wait(0)
    handle._finish(Status.ERROR, AxisbusError("x"))
    with pytest.raises(AxisbusError):
        handle.wait()


def test_a_waiting_thread_wakes_in_the_cycle_in_which_a_command_ends_and_in_no_other():
    made = rig().enabled()

    class Woken:
        times = 0

        def notify(self) -> None:
            self.times += 1

    made.scan.waiter, handle, cycles = Woken(), made.axis.disable(), 0
    while handle.active or handle.busy:
        assert not made.scan.waiter.times
        made.scan.once()
        cycles += 1
        assert cycles < 1000
    assert made.scan.waiter.times == 1
    made.scan.once()
    assert made.scan.waiter.times == 1
