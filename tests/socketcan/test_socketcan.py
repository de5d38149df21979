"""The kernel's own CAN under the master: links, error frames, bus-off, a link that goes away, and lost frames."""

from __future__ import annotations

import random
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial

import can
import pytest

from axisbus.bus.link.channel import Channel
from axisbus.cia301.nmt import NmtState
from axisbus.errors import AdapterError, AxisbusError, BusOff
from axisbus.machine.machine import Machine
from axisbus.machine.opening import boot
from kit.can_interface import LINK
from kit.socketcan_cell import ip, until

_ERROR_FRAME = {"is_error_frame": True, "is_extended_id": True}
CAN_ERR_CRTL, CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x04, 0x40, 0x100  # include/uapi/linux/can/error.h
_LOST = 0.02


def axisbus(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line as its user does."""
    command = [sys.executable, "-m", "axisbus", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def put_error_frame(error_class: int, data: bytes = bytes(8)) -> None:
    """Let the link report an error frame as a CAN controller would."""
    with can.Bus(LINK, interface="socketcan") as bus:
        bus.send(can.Message(arbitration_id=error_class, data=data, **_ERROR_FRAME))


def test_a_cell_boots_moves_and_stops(stage):
    with stage.open() as machine:
        for axis in machine:
            axis.enable().wait(20)
        for handle in [axis.move_relative(5_000) for axis in machine]:
            handle.wait(20)
        assert stage.energised() == [True, True]
        positions = [device.drives[0].axis.motor.position for device in stage.devices]
    assert positions == pytest.approx([5_000, 5_000], abs=20)
    assert (stage.speeds(), stage.energised()) == ([0, 0], [False, False])


def test_a_scan_lists_the_nodes(stage):
    done = axisbus("scan", "-i", "socketcan", "-c", LINK)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("servo drive (CiA 402)") == 2


def test_a_link_that_is_not_there_is_named_with_those_that_are():
    done = axisbus("scan", "-i", "socketcan", "-c", "can7")
    assert done.returncode == 3
    assert "there is no CAN interface 'can7' on this computer" in done.stderr
    assert LINK in done.stderr


def test_a_link_that_is_down_is_reported_with_the_line_that_brings_it_up(ends):
    ends.down(ends.ours)
    done = axisbus("scan", "-i", "socketcan", "-c", ends.ours)
    assert done.returncode == 3
    assert f"the CAN interface '{ends.ours}' is down" in done.stderr
    assert f"sudo ip link set {ends.ours} up" in done.stderr


def test_warnings_of_the_controller_are_counted_and_stop_nothing(stage):
    with stage.open() as machine:
        stage.travelling(machine)
        put_error_frame(CAN_ERR_CRTL, bytes([0, 0x08, 0, 0, 0, 0, 0, 0]))
        counters = machine.node(1)._node.channel.counters
        until(lambda: counters.error_frames == 1, 5)
        assert "transmit errors (warning)" in counters.errors[-1]
        assert min(stage.speeds()) > 1000


def test_bus_off_in_mid_move_ends_every_command_and_the_drives_stop(stage):
    with pytest.raises(AxisbusError) as caught, stage.open() as machine:
        handles = stage.travelling(machine)
        put_error_frame(CAN_ERR_BUSOFF)
        until(lambda: not any(handle.busy for handle in handles), 10)
        for handle in handles:
            with pytest.raises(AxisbusError, match="bus-off"):
                handle.wait(1)
        raise handles[0].error
    assert "bus-off" in str(caught.value)
    assert f"sudo ip link set {LINK} type can restart" in str(caught.value)
    until(lambda: stage.speeds() == [0, 0], 10)


def test_during_bus_off_no_frame_of_the_master_reaches_the_link(stage):
    with suppress(AxisbusError, ExceptionGroup), stage.open() as machine:
        handles = stage.travelling(machine)
        put_error_frame(CAN_ERR_BUSOFF)
        until(lambda: not any(handle.busy for handle in handles), 10)
        with can.Bus(LINK, interface="socketcan") as bus:
            seen = []
            end = time.monotonic() + 1.2
            while time.monotonic() < end:
                if (message := bus.recv(0.1)) is not None:
                    seen.append(message.arbitration_id)
        ours = [
            0x080,
            0x77F,
            *(base + node for base in (0x200, 0x300, 0x400, 0x500, 0x600) for node in (1, 2)),
        ]
        assert seen, "the drives go on sending"
        assert [hex(can_id) for can_id in seen if can_id in ours] == []


def test_a_controller_that_is_restarted_in_mid_move_leaves_the_cell_stopped_until_it_is_reset(stage):
    with stage.open() as machine:
        handles = stage.travelling(machine)
        put_error_frame(CAN_ERR_CRTL, bytes([0, 0x20, 0, 0, 0, 0, 135, 0]))
        put_error_frame(CAN_ERR_BUSOFF)
        put_error_frame(CAN_ERR_RESTARTED)  # at once, as with a short restart-ms
        until(lambda: not any(handle.busy for handle in handles), 10)
        for handle in handles:
            with pytest.raises(BusOff, match="went bus-off"):
                handle.wait(1)
        until(lambda: stage.speeds() == [0, 0], 10)
        told = [str(event).partition(LINK)[2] for event in machine.bus_events]
        assert told == [
            " is error passive (transmit errors 135, receive errors 0)",
            " is bus-off (transmit errors 135, receive errors 0)",
            " has been restarted and takes part in the bus again: check every node again",
        ]
        until(lambda: [machine.node(node).nmt for node in (1, 2)] == [NmtState.OPERATIONAL] * 2, 10)
        time.sleep(0.5)
        assert stage.speeds() == [0, 0]  # being back moves nothing
        for axis in machine:
            until(lambda axis=axis: _resets(axis), 10)
            axis.enable().wait(20)
        for handle in [axis.move_relative(5_000) for axis in machine]:
            handle.wait(20)


def _resets(axis) -> bool:
    """Whether a reset is accepted now: the last stop may still run."""
    try:
        axis.reset().wait(5)
    except AxisbusError:
        return False
    return True


def test_a_link_that_goes_down_during_a_move_is_reported_and_the_watchdogs_of_the_drives_stop_them(
    ends, make_stage
):
    stage = make_stage(ends.ours, ends.theirs)
    with pytest.raises(AxisbusError) as caught, stage.open() as machine:
        handles = stage.travelling(machine)
        ends.down(ends.ours)
        handles[0].wait(20)
    text = str(caught.value)
    assert f"socketcan:{ends.ours}" in text
    assert "Network is down" in text
    until(lambda: stage.speeds() == [0, 0] and stage.energised() == [False, False], 10)


def test_a_link_that_was_down_is_opened_again_by_the_same_machine(ends, make_stage):
    stage = make_stage(ends.ours, ends.theirs)
    with stage.open() as machine:
        for _ in range(2):
            handles = stage.travelling(machine)
            ends.down(ends.ours)
            with pytest.raises(AxisbusError):
                handles[0].wait(20)
            with pytest.raises(AdapterError, match="is down"):
                machine.reconnect()
            ends.up(ends.ours)
            assert all(each.ok for each in machine.reconnect())
            assert stage.energised() == [False, False]
            assert stage.speeds() == [0, 0]
            for node, axis in enumerate(machine, start=1):
                with pytest.raises(AxisbusError):
                    axis.reset().wait(5)
                assert machine.node(node).boot().ok
                axis.reset().wait(10)


def test_drives_that_lose_their_supply_in_mid_move_are_booted_again_by_the_same_machine(stage):
    with stage.open() as machine:
        for _ in range(2):
            handles = stage.travelling(machine)
            stage.supply(1, 2, on=False)
            for handle in handles:
                with pytest.raises(AxisbusError):
                    handle.wait(20)
            stage.supply(1, 2, on=True)
            for node, axis in enumerate(machine, start=1):
                until(partial(boots, machine, node), 20)
                axis.reset().wait(10)
            assert stage.energised() == [False, False]
            assert stage.speeds() == [0, 0]
        for axis in machine:
            axis.enable().wait(20)
        for handle in [axis.move_relative(5_000) for axis in machine]:
            handle.wait(20)


def test_an_axis_moves_on_while_the_drive_of_another_loses_its_supply_and_is_booted_again(stage):
    text = stage.file.read_text("utf-8")
    stage.file.write_text(text.replace("[bus]", '[bus]\non_lost_node = "report"'), "utf-8")
    with stage.open() as machine:
        lost, moving = stage.travelling(machine)
        stage.supply(1, on=False)
        with pytest.raises(AxisbusError):
            lost.wait(20)
        stage.supply(1, on=True)
        until(partial(boots, machine, 1), 20)
        machine["x"].reset().wait(10)
        assert moving.busy
        assert stage.speeds()[1] > 1000
        assert stage.energised() == [False, True]


def boots(machine: Machine, node: int) -> bool:
    """Whether a node boots: just after its supply has returned, it does not answer yet."""
    try:
        return machine.node(node).boot().ok
    except AxisbusError:
        return False


class LossyWire:
    """Carries frames between two vcan links, and loses one in fifty in each direction (seeded)."""

    def __init__(self, one: str, other: str, seed: int) -> None:
        self.lost = 0
        self._random = random.Random(seed)
        self._stop = threading.Event()
        self._buses = [can.Bus(name, interface="socketcan") for name in (one, other)]
        self._threads = [
            threading.Thread(target=self._carry, args=(here, there))
            for here, there in (self._buses, reversed(self._buses))
        ]
        for thread in self._threads:
            thread.start()

    def _carry(self, here: can.BusABC, there: can.BusABC) -> None:
        while not self._stop.is_set():
            message = here.recv(0.05)
            if message is None or message.is_error_frame:
                continue
            if self._random.random() < _LOST:
                self.lost += 1
            else:
                there.send(message)

    def close(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()
        for bus in self._buses:
            bus.shutdown()


@pytest.fixture
def second_link():
    ip("link", "add", "dev", "vcan9", "type", "vcan")
    ip("link", "set", "vcan9", "up")
    yield "vcan9"
    ip("link", "del", "vcan9")


def test_a_cell_boots_over_a_wire_that_loses_frames(second_link, make_stage):
    stage = make_stage(LINK, second_link)
    wire = LossyWire(LINK, second_link, seed=402)
    try:
        for _ in range(3):
            assert [report.error for report in boot(stage.file)] == [None, None]
    finally:
        wire.close()
    assert wire.lost > 0


def test_a_frame_is_refused_only_with_a_named_error(ends):
    """A link that goes down between two frames: the channel fails with the remedy, and stays failed."""
    with Channel.open("socketcan", ends.ours) as channel:
        ends.down(ends.ours)
        with pytest.raises(AdapterError, match=f"socketcan:{ends.ours}") as caught:
            for _ in range(200):
                channel.send(0x80, b"")
        assert "open the machine again" in str(caught.value)
