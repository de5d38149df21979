"""Every stop command × every state of the node × mode: the axis comes to standstill, or is reported as not confirmed.

Each cell is judged on the plant. The motor must stop, because every state here leaves a path to the drive that works (RPDO
with SYNC, SDO, NMT stop); the drive's own watchdog is switched off, so that nothing else stops it. Success may be reported only
when the motor is at standstill. The table of ``docs/stopping.md`` lists the reports.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import can
import pytest

from axisbus import eds
from axisbus.boot.configure import DriveMonitoringSetup
from axisbus.boot.stop_report import NO_WATCHDOG
from axisbus.cell import reader
from axisbus.cia301.nmt import NmtCommand
from axisbus.eds.builtin import resolve
from axisbus.errors import AxisbusError, SecondMasterError
from axisbus.machine.machine import Machine
from axisbus.machine.stop_external import stop_on_bus
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit.scenarios.simulated_bus import Line, enable, until

TIMES = 'halt_time = "600ms"\nquick_stop_time = "600ms"\ndisable_time = "600ms"'
AT_REST = 0.5  # degrees per second
ENDS = 12.0  # seconds that a stop may take on a busy computer until it has an end
SPEED = 90.0  # degrees per second


class Bench(Line):
    """One axis that moves, with the frames that another device sends, and the second device that may come."""

    stack: ExitStack

    def frame(self, can_id: int, data: bytes) -> None:
        """Send a frame that is not the master's."""
        with can.Bus(interface="virtual", channel=self.channel) as bus:
            bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    @property
    def speed(self) -> float:
        """How fast the motor turns, without the sign."""
        with self.lock:
            return abs(self.drive().axis.motor.velocity) / self.scale_of("x")

    @property
    def dials(self):
        return self.devices["x"].dials


# The motion by mode. Each is long enough for the whole test.
MODES: dict[str, Callable[[Machine], object]] = {
    "pv": lambda machine: machine["x"].move_velocity(SPEED),
    "pp": lambda machine: machine["x"].move_relative(20_000.0, velocity=SPEED),
    "csp": lambda machine: machine["x"].follow(
        TrapezoidalTrajectory(machine["x"].position, 20_000.0, SPEED, 500.0)
    ),
    "csv": lambda machine: machine["x"].cyclic_velocity(SPEED),
    "tq": lambda machine: machine["x"].torque_control(0.5, slope=5.0),
    "cst": lambda machine: machine["x"].cyclic_torque(0.5, slope=5.0),
}


def _twin(bench: Bench) -> None:
    device = device_from_eds(eds.load(resolve("builtin:generic-cia402", Path())), 1, seed=9)
    bench.stack.enter_context(SimulatedNetwork(bench.channel, [device]))


def _ignore_rpdos(bench: Bench) -> None:
    with bench.lock:
        for number in range(8):
            with suppress(Exception):  # it has not so many
                index = 0x1400 + number
                bench.devices["x"].write(index, 1, bench.devices["x"].read(index, 1) | 1 << 31)


def _stop_tpdos(bench: Bench) -> None:
    bench.dials.tpdos_stop = frozenset(range(1, 9))


def _restart(bench: Bench) -> None:
    with bench.lock:
        bench.devices["x"].nmt_command(NmtCommand.RESET_NODE)


# The state of the node while it moves.
STATES: dict[str, Callable[[Bench], None]] = {
    "operational": lambda _: None,
    "pre-operational": lambda bench: bench.frame(0x000, b"\x80\x01"),
    "boot-up message only": lambda bench: bench.frame(0x701, b"\x00"),
    "restarted": _restart,
    "second device": _twin,
    "heartbeat lost": lambda bench: setattr(bench.dials, "heartbeat_stops", True),
    "SDO silent": lambda bench: setattr(bench.dials, "sdo_silent", True),
    "TPDOs lost": _stop_tpdos,
    "RPDOs ignored": _ignore_rpdos,
    "in fault": lambda bench: bench.drive().fault(0x7500),
}


# How a stop is asked for; each returns whether success was reported, and raises or returns False else.
def _command(name: str) -> Callable[[Bench, Machine], bool]:
    def ask(bench: Bench, machine: Machine) -> bool:
        getattr(machine["x"], name)().wait(ENDS)
        return True

    return ask


def _halt_twice(bench: Bench, machine: Machine) -> bool:
    """The axis is halted already, and still brakes, when it is asked for once more."""
    machine["x"].halt()
    return _command("halt")(bench, machine)


def _close(bench: Bench, machine: Machine) -> bool:
    return not machine._close("the test asks for it")


def _beside(bench: Bench, machine: Machine) -> bool:
    return all(result.ok for result in stop_on_bus(reader.load(bench.file)))


def _scan_fails(bench: Bench, machine: Machine) -> bool:
    machine._core.scan.fail(RuntimeError("a fault of the test"))
    told = " ".join(str(error) for error in machine._close("the test asks for it"))
    return "NOT CONFIRMED" not in told


WAYS: dict[str, Callable[[Bench, Machine], bool]] = {
    "quick_stop": _command("quick_stop"),
    "halt": _command("halt"),
    "halt while halted": _halt_twice,
    "stop": _command("stop"),
    "disable": _command("disable"),
    "close": _close,
    "axisbus stop": _beside,
    "scan failed": _scan_fails,
}


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr(DriveMonitoringSetup, "arm", lambda *_: NO_WATCHDOG)
    monkeypatch.setattr(DriveMonitoringSetup, "arm_deadlines", lambda *_: NO_WATCHDOG)
    with ExitStack() as stack, Bench(tmp_path, stop=TIMES, axis="rated_torque = 5.0") as bench:
        bench.stack = stack
        yield bench


def judged(bench: Bench, mode: str, state: str, way: str, *, at_once: bool) -> None:
    """Move, let the node come into its state, ask for the stop, and look at the motor. ``at_once``: before it can be noticed."""
    machine = bench.open()
    try:
        enable(machine["x"])
        MODES[mode](machine)
        until(lambda: bench.speed > 0.9 * SPEED)
        STATES[state](bench)
        if not at_once:
            time.sleep(0.1)
        try:
            success = WAYS[way](bench, machine)
        except TimeoutError:
            raise
        except AxisbusError:
            success = False
        speed = bench.speed
        assert not success or speed < AT_REST, f"success was reported at {speed:.1f} deg/s"
        until(lambda: bench.speed < AT_REST)
        time.sleep(0.3)
        assert bench.speed < AT_REST, "it moves again"
    finally:
        machine._close("the test ends")


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("state", STATES)
def test_each_kind_of_stop_reaches_the_axis_in_each_state_of_its_node(
    bench: Bench, state: str, way: str
) -> None:
    judged(bench, "pv", state, way, at_once=way.startswith("halt"))


@pytest.mark.parametrize("mode", [mode for mode in MODES if mode != "pv"])
@pytest.mark.parametrize("state", STATES)
def test_the_axis_is_reached_in_each_mode(bench: Bench, state: str, mode: str) -> None:
    judged(bench, mode, state, "stop", at_once=True)


def _turned_by_another(bench: Bench) -> None:
    """Let the drive turn before any program of ours has opened the machine."""
    per_second = round(SPEED * bench.scale_of("x"))
    writes = (
        (0x6060, 3),
        (0x6083, per_second),
        (0x60FF, per_second),
        (0x6040, 0x06),
        (0x6040, 0x07),
        (0x6040, 0x0F),
    )
    for index, value in writes:
        with bench.lock:
            bench.devices["x"].write(index, 0, value)
        time.sleep(0.05)
    until(lambda: bench.speed > 0.9 * SPEED)


def test_an_axis_in_boot_is_reached_by_axisbus_stop(bench: Bench) -> None:
    """The program that boots has no machine yet, so it cannot be asked; it ends because it sees another master's stop."""
    _turned_by_another(bench)
    bench.dials.sdo_delay = 0.02
    ended: list[AxisbusError] = []

    def boot() -> None:
        try:
            bench.open()
        except AxisbusError as error:
            ended.append(error)

    booting = threading.Thread(target=boot)
    booting.start()
    time.sleep(0.3)
    assert booting.is_alive()
    assert all(result.ok for result in stop_on_bus(reader.load(bench.file)))
    assert bench.speed < AT_REST
    booting.join(ENDS)
    assert isinstance(ended[0], SecondMasterError)
    assert bench.speed < AT_REST, "it moves again"
