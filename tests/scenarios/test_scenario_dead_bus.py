"""The adapter of a running cell goes bad: a send that never returns, nothing received, nothing taken, nothing there any more."""

from __future__ import annotations

import errno
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import can
import pytest

from axisbus.errors import AxisbusError, ScanError, StateError, TransmitQueueFull
from axisbus.machine.machine import Machine
from kit.plant_probe import OFF, QUICK_STOP, SWITCH_ON_DISABLED
from kit.scenarios.simulated_bus import Line, enable, turning, until

NO_DEVICE = OSError(errno.ENODEV, "No such device")


class Adapter:
    """The adapter of a machine, which can be made to fail; all of it is released at the end."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.channel = machine._core.scan.cycle._channel
        self.bus = self.channel.bus
        self._send, self._recv = self.bus.send, self.bus.recv
        self.free = threading.Event()

    def hang(self, *, for_all: bool) -> None:
        """Let the scan's sends hang, or those of every thread."""

        def hanging(message: can.Message, timeout: float | None = None) -> None:
            if for_all or threading.current_thread().name == "axisbus scan":
                self.free.wait()
            self._send(message, timeout)

        self.bus.send = hanging

    def refuse(self) -> None:
        """Take no frame any more: the queue is full for good."""

        def full(_message: can.Message, _timeout: float | None = None) -> None:
            raise can.CanOperationError("Transmit buffer full")

        self.bus.send = full

    def go_deaf(self) -> None:
        """Receive nothing any more."""

        def broken(_timeout: float | None = None) -> None:
            raise can.CanOperationError("Error receiving: Network is down")

        self.bus.recv = broken

    def unplug(self) -> None:
        """Be gone; the next send notices it first."""
        noticed = threading.Event()

        def gone(*_: object) -> None:
            noticed.set()
            raise NO_DEVICE

        def missing_device(_timeout: float | None = None) -> None:
            noticed.wait()
            raise NO_DEVICE

        self.bus.send, self.bus.recv = gone, missing_device

    def let_go(self) -> None:
        """Work again."""
        self.free.set()
        self.bus.send, self.bus.recv = self._send, self._recv


@contextmanager
def turning_cell(folder, names: str = "xy") -> Iterator[tuple[Line, Adapter, list]]:
    """A cell with a running move of many seconds on each axis."""
    with Line(folder, names) as line:
        machine = line.open()
        adapter = Adapter(machine)
        try:
            turning(machine, line)
            handles = [axis.move_relative(1e5, velocity=90.0) for axis in machine]
            until(lambda: all(_has_target(line, name) for name in names))
            yield line, adapter, handles
        finally:
            adapter.let_go()
            _close(machine)


def _has_target(line: Line, name: str) -> bool:
    """Whether the move has set the drive's 607Ah; its SDO writes are done then."""
    with line.simulated_nodes.lock:
        return line.devices[name].read(0x607A) > 5_000_000


def _close(machine: Machine) -> Exception | None:
    try:
        machine.close()
    except AxisbusError as error:
        return error
    except ExceptionGroup as group:  # each axis has its own
        return group.exceptions[0]
    return None


def closing_error(adapter: Adapter) -> Exception:
    """Close the machine, which must raise the error."""
    error = _close(adapter.machine)
    assert error is not None
    return error


def scan_errors(handles: list) -> list[ScanError]:
    """Return the errors of the handles: each must have ended because of the scan."""
    until(lambda: not any(handle.busy for handle in handles))
    errors = [handle.exception() for handle in handles]
    assert [type(error) for error in errors] == [ScanError] * len(errors), errors
    return errors


@pytest.mark.nets("the supervisor", "the drive's watchdog")
def test_a_scan_that_hangs_in_a_send_is_replaced_by_the_supervisor(tmp_path, golden):
    with turning_cell(tmp_path) as (line, adapter, handles):
        adapter.hang(for_all=False)
        for name in "xy":
            line.must_be_still(name, stages=SWITCH_ON_DISABLED)
        golden("scan_hangs", scan_errors(handles)[0], volatile=True)
        late = adapter.machine["x"].move_absolute(0.0)
        assert isinstance(late.exception(), ScanError)


@pytest.mark.nets("the supervisor", "the drive's watchdog")
def test_a_send_that_returns_at_last_does_not_set_the_drives_in_motion_again(tmp_path):
    """The blocked frame of the scan is *enable operation* for each axis: it ends a held quick stop."""
    with turning_cell(tmp_path) as (line, adapter, handles):
        for device in line.devices.values():
            device.write(0x605A, 0, 6)  # brake, and stay in quick stop active
        adapter.hang(for_all=False)
        for name in "xy":
            line.must_be_still(name, stages=QUICK_STOP)
        adapter.let_go()
        for name in "xy":
            line.must_be_still(name, stages=QUICK_STOP, within=1.0)
        scan_errors(handles)


@pytest.mark.nets("the drive's watchdog")
def test_if_every_send_hangs_the_drives_watchdog_stops_them_and_closing_does_not_hang(tmp_path, golden):
    with turning_cell(tmp_path, "x") as (line, adapter, handles):
        adapter.hang(for_all=True)
        line.must_be_still(stages=OFF)
        scan_errors(handles)
        golden("closing_while_every_send_hangs", closing_error(adapter), volatile=True)


@pytest.mark.nets("the quick stop of a dead scan", "the drive's watchdog")
def test_an_adapter_that_receives_nothing_stops_every_drive(tmp_path, golden):
    """Frames are still sent, but no feedback is received."""
    with turning_cell(tmp_path) as (line, adapter, handles):
        adapter.go_deaf()
        for name in "xy":
            line.must_be_still(name, stages=SWITCH_ON_DISABLED)
        golden("adapter_deaf", scan_errors(handles)[0])
        golden("closing_deaf", closing_error(adapter))


@pytest.mark.nets("the drive's watchdog")
def test_an_adapter_that_is_unplugged_leaves_the_drives_to_their_watchdog(tmp_path, golden):
    with turning_cell(tmp_path) as (line, adapter, handles):
        adapter.unplug()
        for name in "xy":
            line.must_be_still(name, stages=OFF)
        golden("adapter_unplug", *scan_errors(handles), volatile=True)
        golden("closing_unplug", closing_error(adapter), volatile=True)


@pytest.mark.nets("the drive's watchdog")
def test_an_adapter_that_refuses_every_frame_leaves_the_drives_to_their_watchdog_and_the_scan_continues(
    tmp_path,
):
    with turning_cell(tmp_path) as (line, adapter, handles):
        adapter.refuse()
        for name in "xy":
            line.must_be_still(name, stages=OFF)
        until(lambda: not any(handle.busy for handle in handles))
        assert not adapter.machine._core.scan.ended
        errors = [handle.exception() for handle in handles]
        assert [type(error) for error in errors] == [TransmitQueueFull] * 2
        assert "its transmit queue is full" in errors[0].message
        assert "only the drive's own watchdog can stop it now" in errors[0].remedy


# -- the adapter is opened again -----------------------------------------------------------------------------------------


def usable_again(line: Line, machine: Machine) -> None:
    """Nothing is enabled; after a boot and a reset each axis moves as commanded."""
    assert not machine.session.ended
    for node, axis in enumerate(machine, start=1):
        line.must_be_still(axis.name, stages=OFF)
        assert machine.node(node).boot().ok
        axis.reset().wait(10)
        enable(axis)
        axis.move_relative(5.0).wait(10)


@pytest.mark.parametrize("how", [Adapter.unplug, Adapter.go_deaf], ids=["unplugged", "deaf"])
def test_an_adapter_that_is_opened_again_serves_the_same_machine(tmp_path, how):
    with turning_cell(tmp_path) as (line, adapter, handles):
        how(adapter)
        scan_errors(handles)
        stopped = adapter.machine.reconnect()
        assert [(each.axis, each.ok) for each in stopped] == [("x", True), ("y", True)], stopped
        usable_again(line, adapter.machine)
        assert _close(adapter.machine) is None
        line.must_be_still("x", stages=OFF)


def test_an_adapter_that_fails_again_is_opened_again(tmp_path):
    with turning_cell(tmp_path, "x") as (line, adapter, handles):
        for _ in range(3):
            adapter.go_deaf()
            scan_errors(handles)
            adapter.machine.reconnect()
            usable_again(line, adapter.machine)
            handles = [adapter.machine["x"].move_relative(1e5, velocity=90.0)]
            adapter.bus = adapter.channel.bus


def test_a_driver_in_which_the_scan_hangs_is_not_opened_again(tmp_path):
    with turning_cell(tmp_path, "x") as (_, adapter, handles):
        adapter.hang(for_all=False)
        scan_errors(handles)
        with pytest.raises(ScanError):
            adapter.machine.reconnect()


def test_an_adapter_that_refuses_every_frame_works_and_is_not_opened_again(tmp_path):
    with turning_cell(tmp_path, "x") as (_, adapter, handles):
        adapter.refuse()
        until(lambda: not any(handle.busy for handle in handles))
        with pytest.raises(StateError, match="it works"):
            adapter.machine.reconnect()
