"""Bus-off during a move: every command ends with an error, nothing is queued for later, nothing moves uncommanded afterwards."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import can
import pytest

from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.errors import AxisbusError, BusOff, StateError, TransmitQueueFull
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.plant_probe import ENABLED, OFF
from kit.scenarios.safety_nets import NETS
from kit.scenarios.simulated_bus import Line, enable, turning, until

CAN_ERR_CRTL, CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x04, 0x40, 0x100  # include/uapi/linux/can/error.h


class Wire:
    """The adapter of a machine whose controller can go bus-off and restart, reported by error frames as in Linux.

    During bus-off nothing is received, and frames given to the driver are kept in ``queued``, as in Linux, to be sent at the
    restart.
    """

    def __init__(self, machine: Machine) -> None:
        self._scan = machine._core.scan
        self.channel = machine._core.scan.cycle._channel
        self.channel._linux_classes = True
        self.queued: list[can.Message] = []
        self._bus = self.channel.bus
        self._send, self._recv = self._bus.send, self._bus.recv
        self._off = False
        self._told: list[can.Message] = []
        self._bus.send, self._bus.recv = self._on_send, self._on_recv

    def _on_send(self, message: can.Message, timeout: float | None = None) -> None:
        if self._off:
            self.queued.append(message)
        else:
            self._send(message, timeout)

    def _on_recv(self, timeout: float | None = None) -> can.Message | None:
        if self._told:
            return self._told.pop(0)
        message = self._recv(timeout)
        return None if self._off else message

    def _tell(self, error_class: int, status: int = 0) -> None:
        data = bytes((0, status, 0, 0, 0, 0, 128 if status else 0, 0))
        self._told.append(can.Message(arbitration_id=error_class, is_error_frame=True, data=data))

    def go_off(self) -> None:
        self._tell(CAN_ERR_CRTL, 0x20)
        self._tell(CAN_ERR_BUSOFF)
        until(lambda: self.channel.off is not None)
        cycles = self._scan.lateness.cycles
        until(lambda: self._scan.lateness.cycles > cycles + 1)  # a frame may just be in transit
        self._off = True

    def restart(self) -> None:
        """Restart as the kernel does: the kept frames are sent first."""
        self._off = False
        for message in self.queued:
            self._send(message)
        self._tell(CAN_ERR_RESTARTED)
        until(lambda: self.channel.off is None)


@contextmanager
def turning_cell(folder, names: str = "xy") -> Iterator[tuple[Line, Machine, Wire, list]]:
    """A cell with a running move of many seconds on each axis."""
    with Line(folder, names, period="40ms", heartbeat="400ms") as line:
        machine = line.open()
        try:
            wire = Wire(machine)
            turning(machine, line)
            handles = [axis.move_relative(1e5, velocity=90.0) for axis in machine]
            for axis in machine:
                line.must_move(axis.name)
            yield line, machine, wire, handles
        finally:
            with suppress(AxisbusError, ExceptionGroup):  # of an axis without confirmed standstill
                machine.close()


def ends_of(handles: list) -> list[AxisbusError]:
    until(lambda: not any(handle.busy for handle in handles))
    return [handle.exception() for handle in handles]


@pytest.mark.nets("the drive's watchdog")
def test_bus_off_ends_every_command_and_the_drives_watchdog_stops_them(tmp_path):
    with turning_cell(tmp_path) as (line, machine, wire, handles):
        wire.go_off()
        told = ends_of(handles)
        for name in "xy":
            line.must_be_still(name, stages=OFF)
        assert [type(error) for error in told] == [BusOff, BusOff]
        went = f"the CAN controller of {wire.channel.name} went bus-off: it no longer takes part in the bus"
        assert [error.message for error in told] == [
            f"{name}: node {node} is lost: {went}" for node, name in ((1, "x"), (2, "y"))
        ]
        assert "transmit errors 128, receive errors 0" in told[0].observed
        assert "only the drive's own watchdog can stop it now; check bit rate, wiring" in told[0].remedy
        assert [axis.state for axis in machine] == [AxisState.ERRORSTOP] * 2
        assert not machine._core.scan.ended
        assert [str(event) for event in machine.bus_events] == [
            f"the CAN controller of {wire.channel.name} is error passive (transmit errors 128, receive errors 0)",
            f"the CAN controller of {wire.channel.name} is bus-off (transmit errors 128, receive errors 0)",
        ]


def test_no_frame_is_queued_for_the_restart_after_bus_off(tmp_path):
    with turning_cell(tmp_path) as (_, machine, wire, handles):
        wire.go_off()
        ends_of(handles)
        cycles = machine._core.scan.lateness.cycles
        until(lambda: machine._core.scan.lateness.cycles > cycles + 10)  # the scan continues
        assert [hex(message.arbitration_id) for message in wire.queued] == []


def without_watchdog(monkeypatch) -> None:
    for owner, name, instead in NETS["the drive's watchdog"]:
        monkeypatch.setattr(owner, name, instead)


def test_a_drive_without_a_watchdog_is_stopped_as_soon_as_the_bus_is_back_and_serves_after_a_reset(
    tmp_path, monkeypatch
):
    without_watchdog(monkeypatch)
    with turning_cell(tmp_path, "x") as (line, machine, wire, handles):
        wire.go_off()
        ends_of(handles)
        line.must_move()  # only the watchdog stops it
        x = machine["x"]
        refused = x.reset()
        assert isinstance(ends_of([refused])[0], StateError)
        wire.restart()
        line.must_be_still(stages=OFF)
        until(lambda: machine.node(1).nmt is NmtState.OPERATIONAL)
        assert x.state is AxisState.ERRORSTOP
        assert isinstance(ends_of([x.enable()])[0], AxisbusError)
        until(lambda: ends_of([x.reset()]) == [None])
        enable(x)
        line.must_be_still(stages=ENABLED)
        x.move_relative(5.0).wait(10)
        assert machine.bus_events[-1].restarted


def test_a_second_bus_off_is_reported_as_the_first(tmp_path, monkeypatch):
    without_watchdog(monkeypatch)
    with turning_cell(tmp_path, "x") as (line, machine, wire, handles):
        for _ in range(2):
            wire.go_off()
            wire.restart()  # soon: no watchdog has reacted, and still no axis continues its motion
            line.must_be_still(stages=OFF)
            assert isinstance(ends_of(handles)[0], BusOff)
            x = machine["x"]
            until(lambda: machine.node(1).nmt is NmtState.OPERATIONAL)
            until(lambda x=x: ends_of([x.reset()]) == [None])
            enable(x)
            handles = [x.move_relative(1e5, velocity=90.0)]
            until(lambda: line.speed() > 20.0)


def test_a_drive_found_pre_operational_after_bus_off_needs_the_machine_opened_again(tmp_path):
    """Its watchdog (1029h) may have done that, or it may have restarted unnoticed with other PDOs: a start is not enough."""
    with turning_cell(tmp_path, "x") as (line, machine, wire, handles):
        wire.go_off()
        ends_of(handles)
        line.must_be_still(stages=OFF)
        assert line.devices["x"].nmt is NmtState.PRE_OPERATIONAL
        wire.restart()
        until(lambda: machine.node(1).nmt is NmtState.PRE_OPERATIONAL)
        machine.node(1).command(NmtCommand.START)
        x = machine["x"]
        until(lambda: "is still being stopped" not in str(ends_of([x.reset()])[0]))
        line.must_be_still(stages=OFF)
        refused = ends_of([x.reset()])[0]
        assert isinstance(refused, StateError)
        assert "node 1 has returned, but a reset is not enough" in str(refused)
        assert isinstance(ends_of([x.enable()])[0], AxisbusError)
        with suppress(AxisbusError, ExceptionGroup):
            machine.close()
        with line.open() as again:
            again["x"].reset().wait(10)
            enable(again["x"])
            again["x"].move_relative(5.0).wait(10)


# -- a full transmit queue ---------------------------------------------------------------------------------------------


class FullQueue:
    """An adapter whose driver refuses every frame while ``full``, as Linux does where the link's queue has no room."""

    def __init__(self, machine: Machine) -> None:
        self._bus = machine._core.scan.cycle._channel.bus
        self._send = self._bus.send
        self.full = False
        self.taken: list[can.Message] = []
        self._bus.send = self._on_send

    def _on_send(self, message: can.Message, timeout: float | None = None) -> None:
        if self.full:
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
        self.taken.append(message)
        self._send(message, timeout)


def test_a_queue_that_is_full_for_some_cycles_stops_the_axes_and_they_serve_after_a_reset(tmp_path):
    """For less than the drives' own watchdogs wait, so that only the master stops them."""
    with turning_cell(tmp_path) as (line, machine, _, handles):
        queue = FullQueue(machine)
        scan = machine._core.scan
        for _ in range(2):
            queue.full = True
            cycles = scan.lateness.cycles
            until(lambda cycles=cycles: scan.lateness.cycles > cycles + 3)
            queue.taken.clear()
            queue.full = False
            told = ends_of(handles)
            for name in "xy":
                line.must_be_still(name, stages=OFF)
            assert [type(error) for error in told] == [TransmitQueueFull] * 2
            assert "its transmit queue is full" in told[0].message
            assert "only the drive's own watchdog can stop it now" in told[0].remedy
            assert not scan.ended
            first = next(number for number, one in enumerate(queue.taken) if one.arbitration_id == 0x80)
            controlwords = [
                one.data[0] for one in queue.taken[:first] if one.arbitration_id in (0x201, 0x202)
            ]
            assert controlwords[:2] == [0x02, 0x02]  # the quick stop goes before the first SYNC
            handles = []
            for axis in machine:
                assert axis.state is AxisState.ERRORSTOP
                until(lambda axis=axis: ends_of([axis.reset()]) == [None])
                enable(axis)
                handles.append(axis.move_relative(1e5, velocity=90.0))
            for name in "xy":
                until(lambda name=name: line.speed(name) > 20.0)
