"""The scan dies at any point: the drives get a quick stop and reach standstill, and every handle reports the end of the scan."""

from __future__ import annotations

from typing import NoReturn

import pytest

from axisbus.errors import AdapterError, ScanError
from kit.cell import Cell
from kit.plant_probe import OFF, SWITCH_ON_DISABLED

NETS = pytest.mark.nets("the quick stop of a dead scan", "the drive's watchdog")
PLACES = ("receive", "read", "write", "commit", "sync", "heartbeat", "wait")


def unplugged() -> AdapterError:
    return AdapterError(
        "the CAN adapter can0 failed while sending", observed="OSError: [Errno 19] No such device"
    )


def fail(cell: Cell, place: str) -> None:
    """Let a call of the cycle fail, or of the port of the second axis."""
    if place not in ("read", "write"):
        setattr(cell.faults, place, unplugged())
        return

    def broken(_: object) -> NoReturn:
        raise unplugged()

    setattr(cell.port("y"), place, broken)


@pytest.mark.parametrize("place", PLACES)
@NETS
def test_a_scan_that_dies_stops_every_drive_and_ends_every_handle(scenario, golden, place):
    cell = scenario.simulated("xy")
    handles = cell.travelling()
    fail(cell, place)
    cell.run(0.2)
    for name in "xy":
        cell.must_be_still(name, within=1.0, stages=SWITCH_ON_DISABLED)
    for handle, axis in zip(handles, cell.machine, strict=True):
        assert isinstance(handle.exception(), ScanError)
        golden(f"scan_died_{axis.name}", handle.exception())
    late = cell.x.move_absolute(0.0)
    assert isinstance(late.exception(), ScanError)


@NETS
def test_a_fault_of_our_own_in_an_axis_kills_the_scan_and_stops_every_drive(scenario, golden):
    cell = scenario.simulated("xy")
    handles = cell.travelling()

    def broken(_: object) -> None:
        raise KeyError("statusword")

    cell.core("x").step = broken
    with pytest.raises(KeyError):
        cell.run(0.2)
    for name in "xy":
        cell.must_be_still(name, within=1.0, stages=SWITCH_ON_DISABLED)
    golden("scan_died_by_a_bug", handles[1].exception())


@NETS
def test_a_group_whose_scan_dies_ends_its_handle_and_stops(scenario):
    cell = scenario.simulated("xy").enabled()
    line = cell.machine.group("x", "y").move_linear((500.0, 300.0), velocity=100.0)
    cell.run(1.0)
    cell.must_move("x")
    cell.faults.commit = unplugged()
    cell.run(0.05)
    for name in "xy":
        cell.must_be_still(name, within=1.0, stages=SWITCH_ON_DISABLED)
    assert isinstance(line.exception(), ScanError)


@pytest.mark.nets("the drive's watchdog")
def test_if_the_quick_stop_cannot_be_sent_the_drives_own_watchdog_stops_them(scenario):
    """The adapter was pulled out: nothing that we send arrives, and closing must not pretend otherwise."""
    cell = scenario.simulated("x")
    cell.turning()
    cell.wire.masters[0].unplug()
    cell.run(0.05)
    cell.must_move()
    with pytest.raises(ScanError):
        cell.machine.close()
    cell.must_be_still(within=1.0, stages=OFF)


def test_closing_after_the_scan_has_died_reports_that_and_the_unknown_states(scenario, golden):
    cell = scenario.simulated("x")
    cell.turning()
    cell.faults.commit = unplugged()
    cell.run(0.05)
    with pytest.raises(ScanError) as caught:
        cell.machine.close()
    golden("closing_after_the_scan_died", caught.value)


def test_an_exception_in_the_with_block_carries_the_scans_death(scenario, golden):
    cell = scenario.simulated("x")
    with pytest.raises(ScanError) as caught, cell.machine:
        cell.enabled()
        handle = cell.x.move_relative(500.0)
        cell.run(0.3)
        cell.faults.sync = unplugged()
        handle.wait(5)
    golden("with_block_of_a_dead_scan", caught.value)


def test_a_frame_that_was_stuck_is_followed_by_nothing_but_the_quick_stop(scenario):
    """A send blocks; meanwhile the supervisor takes over. When the send returns at last, neither SYNC nor heartbeat may follow."""
    cell = scenario.simulated("x")
    cell.turning()
    scan, cycle = cell.machine._core.scan, cell.cycle
    sent = []
    commit, sync, heartbeat = cycle.commit, cycle.sync, cycle.heartbeat
    cycle.sync = lambda: (sent.append("sync"), sync())
    cycle.heartbeat = lambda: (sent.append("heartbeat"), heartbeat())

    def stuck() -> None:
        commit()
        scan.failure = ScanError("the scan of the bus hangs")
        scan.end()  # as the supervisor does in its own thread
        sent.clear()

    cycle.commit = stuck
    cell.run(0.05)
    assert sent == []
    cell.must_be_still(within=1.0, stages=OFF)
