"""Simulated drives on python-can's virtual bus in real time: they survive foreign masters.

Every wait is for a condition with a generous deadline, so that a busy computer only makes these slower.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from axisbus.errors import AdapterError
from axisbus.sim.device import Device
from axisbus.sim.node.network import SimulatedNetwork, object_dictionary
from kit.can_interface import options
from kit.sim.eds import drive_eds
from kit.sim.heartbeat_guest import HeartbeatGuest
from kit.sim.rig import state

DEADLINE = 20.0
_channels = (f"test-sim-{number}" for number in itertools.count())


@pytest.fixture
def channel() -> str:
    return next(_channels)


def wait_for(done: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + DEADLINE
    while not done():
        assert time.monotonic() < end, f"not within {DEADLINE} s: {what}"
        time.sleep(0.005)


class Master:
    """A hand-written master: frames out, frames in."""

    def __init__(self, channel: str) -> None:
        self.bus = can.Bus(**options(channel))

    def send(self, can_id: int, data: str = "") -> None:
        self.bus.send(can.Message(arbitration_id=can_id, data=bytes.fromhex(data), is_extended_id=False))

    def until(self, wanted: Callable[[can.Message], bool], what: str) -> can.Message:
        end = time.monotonic() + DEADLINE
        while time.monotonic() < end:
            message = self.bus.recv(0.1)
            if message is not None and wanted(message):
                return message
        raise AssertionError(f"not within {DEADLINE} s: {what}")

    def expect(self, can_id: int, data: str) -> None:
        self.until(
            lambda m: m.arbitration_id == can_id and bytes(m.data).hex() == data, f"{can_id:03X} {data}"
        )

    def expect_state(self, can_id: int, name: str) -> None:
        self.until(
            lambda m: m.arbitration_id == can_id and state(int.from_bytes(m.data[:2], "little")) == name, name
        )


@pytest.fixture
def master(channel: str) -> Iterator[Master]:
    made = Master(channel)
    yield made
    made.bus.shutdown()


def test_a_move_in_hand_written_frames(channel, master):
    with SimulatedNetwork(devices=[Device(drive_eds(), 5)], **options(channel)):
        master.expect(0x705, "00")  # boot-up
        master.send(0x605, "4000100000000000")
        master.expect(0x585, "4300100092010200")
        master.send(0x605, "2f60600001000000")  # profile position
        master.expect(0x585, "6060600000000000")
        master.send(0x000, "0105")  # start
        master.expect_state(0x185, "switch on disabled")
        for word, name in (
            ("0600", "ready to switch on"),
            ("0700", "switched on"),
            ("0f00", "operation enabled"),
        ):
            master.send(0x205, word + "00000000")
            master.expect_state(0x185, name)
        master.send(0x205, "1f00" + "d0070000")  # 2000 increments, new set-point
        master.until(lambda m: m.arbitration_id == 0x185 and bool(m.data[1] & 0x10), "set-point acknowledge")
        master.send(0x205, "0f00" + "d0070000")
        master.until(
            lambda m: (
                m.arbitration_id == 0x185
                and bool(m.data[1] & 0x04)
                and int.from_bytes(m.data[2:6], "little", signed=True) == 2000
            ),
            "target reached at 2000",
        )


@contextmanager
def canopens_master(channel, made) -> Iterator[BaseNode402]:
    """The node of canopen's own master for a simulated drive made from an EDS, which has booted; its time-outs are ours."""
    with SimulatedNetwork(devices=[Device(made, 5)], **options(channel)) as simulated_nodes:
        network = canopen.Network()
        network.NOTIFIER_CYCLE = 0.05
        network.connect(**options(channel))
        try:
            node = BaseNode402(5, object_dictionary(made, 5))
            network.add_node(node)
            node.sdo.RESPONSE_TIMEOUT = DEADLINE
            for name in ("SWITCH_OP_MODE", "SWITCH_STATE_FINAL", "SWITCH_STATE_SINGLE", "CHECK_TPDO"):
                setattr(node, f"TIMEOUT_{name}", DEADLINE)
            wait_for(lambda: simulated_nodes.devices[0].boot_ups == 1, "boot-up")
            yield node
        finally:
            network.disconnect()


def test_canopens_own_402_master_enables_and_moves_a_simulated_drive(channel):
    made = drive_eds(x1800_5=20)  # an event timer, so that its TPDO really is periodic
    with canopens_master(channel, made) as node:
        node.nmt.state = "OPERATIONAL"
        node.setup_402_state_machine()
        for name in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
            node.state = name
            assert node.state == name
        node.op_mode = "PROFILED POSITION"
        assert node.op_mode == "PROFILED POSITION"
        node.rpdo[1]["607A:0"].raw = -3_000  # it shares the RPDO with the controlword
        node.controlword = 0x1F
        wait_for(lambda: bool(node.sdo[0x6041].raw & 0x1000), "set-point acknowledge")
        node.controlword = 0x0F
        wait_for(lambda: node.sdo[0x6064].raw == -3_000, "the target")
        node.state = "SWITCH ON DISABLED"
        assert state(node.sdo[0x6041].raw) == "switch on disabled"


@pytest.mark.parametrize(
    "changes", [{"x1800_5": 20}, {"x1800_5": 100}, {}], ids=["20 ms", "100 ms", "on change"]
)
def test_canopens_own_402_master_sees_a_quick_stop_at_standstill(channel, changes):
    made = drive_eds(x605A=2, **changes)
    with canopens_master(channel, made) as node:
        seen = []
        take = node.on_TPDOs_update_callback

        def look(tpdo) -> None:
            take(tpdo)
            seen.append(node.state)

        node.on_TPDOs_update_callback = look
        node.nmt.state = "OPERATIONAL"
        node.setup_402_state_machine()
        # A TPDO sent on change is sent when the node starts, to a listener.
        for name in ("PRE-OPERATIONAL", "OPERATIONAL"):
            node.nmt.state = name
        for name in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
            node.state = name
        node.controlword = 0x0002  # as the setter of its state does
        wait_for(lambda: "QUICK STOP ACTIVE" in seen, "the quick stop")
        wait_for(lambda: node.state == "SWITCH ON DISABLED", "its end")


def test_a_slow_node_delays_no_other(channel, master):
    slow, quick = Device(drive_eds(), 1), Device(drive_eds(), 2)
    slow.dials.sdo_delay = 1.0
    with SimulatedNetwork(devices=[slow, quick], **options(channel)):
        wait_for(lambda: slow.boot_ups == 1 and quick.boot_ups == 1, "boot-up")
        master.send(0x601, "4000100000000000")
        master.send(0x602, "4000100000000000")
        first = master.until(lambda m: m.arbitration_id in (0x581, 0x582), "an answer")
        second = master.until(lambda m: m.arbitration_id in (0x581, 0x582), "the other answer")
        assert (first.arbitration_id, second.arbitration_id) == (0x582, 0x581)


def test_synchronous_pdos_on_the_bus(channel, master):
    with SimulatedNetwork(
        devices=[Device(drive_eds(x1400_2=1, x1800_2=1), 5)], **options(channel)
    ) as simulated_nodes:
        drive = simulated_nodes.devices[0].drive
        wait_for(lambda: state(drive.statusword) == "switch on disabled", "the self-test")
        master.send(0x000, "0100")
        master.send(0x205, "060000000000")
        master.send(0x080)
        master.expect(0x185, "500200000000")
        wait_for(lambda: state(drive.statusword) == "ready to switch on", "the transition")
        master.send(0x080)
        master.expect(0x185, "310200000000")


def test_nmt_gates_the_bus(channel, master):
    with SimulatedNetwork(devices=[Device(drive_eds(x1017=20), 5)], **options(channel)) as simulated_nodes:
        master.send(0x000, "0205")
        wait_for(lambda: simulated_nodes.devices[0].boot_ups == 1, "boot-up")
        master.send(0x000, "0205")
        master.expect(0x705, "04")
        master.send(0x605, "4000100000000000")
        master.send(0x000, "8005")
        seen = master.until(
            lambda m: m.arbitration_id == 0x585 or bytes(m.data) == b"\x7f", "pre-operational"
        )
        assert seen.arbitration_id == 0x705


def test_simulated_drives_without_processor_time_are_behind(channel, master):
    with SimulatedNetwork(devices=[Device(drive_eds(), 5)], **options(channel)) as network:
        wait_for(lambda: not network.behind(), "they keep up")
        with network.lock:
            master.send(0x080)
            wait_for(network.behind, "they are held up")
        wait_for(lambda: not network.behind(), "they have caught up")


def test_all_simulated_drives_share_two_threads(channel):
    before = threading.active_count()
    with SimulatedNetwork(
        devices=[Device(drive_eds(), number) for number in range(1, 9)], **options(channel)
    ) as simulated_nodes:
        wait_for(lambda: all(device.boot_ups == 1 for device in simulated_nodes.devices), "boot-ups")
        assert threading.active_count() - before <= 2
    wait_for(lambda: threading.active_count() <= before, "the end of the threads")


def test_a_node_of_the_network_gives_local_access(channel):
    with SimulatedNetwork(devices=[Device(drive_eds(), 5)], **options(channel)) as simulated_nodes:
        node = simulated_nodes.network[5]
        node.sdo[0x6081].raw = 4_321
        assert simulated_nodes.devices[0].drive.settings.profile_velocity == 4_321
        wait_for(lambda: state(node.sdo[0x6041].raw) == "switch on disabled", "the self-test")
        with pytest.raises(canopen.SdoAbortedError):
            node.get_data(0x5555, 0)
        with pytest.raises(canopen.SdoAbortedError):
            node.set_data(0x6041, 0, b"\0\0", check_writable=True)


def test_malformed_frames_do_no_harm(channel, master):
    with SimulatedNetwork(devices=[Device(drive_eds(), 5)], **options(channel)) as simulated_nodes:
        wait_for(lambda: simulated_nodes.devices[0].boot_ups == 1, "boot-up")
        for can_id, data in (
            (0x605, ""),
            (0x605, "40"),
            (0x000, "01"),
            (0x000, "ff00"),
            (0x080, "0102"),
            (0x705, "05"),
        ):
            master.send(can_id, data)
        master.send(0x605, "4000100000000000")
        master.expect(0x585, "4300100092010200")


def test_a_channel_that_cannot_be_opened_is_named():
    simulated_nodes = SimulatedNetwork("nowhere", [Device(drive_eds(), 5)], interface="no-such-interface")
    with pytest.raises(AdapterError, match="nowhere"):
        simulated_nodes.start()


def test_closing_twice_is_harmless_and_a_failure_is_handed_on(channel):
    simulated_nodes = SimulatedNetwork(devices=[Device(drive_eds(), 5)], **options(channel))
    simulated_nodes.start()
    simulated_nodes.close()
    simulated_nodes.close()
    broken = SimulatedNetwork(devices=[Device(drive_eds(), 6)], **options(channel))
    broken.nodes[0].slave.step = lambda _: 1 / 0
    broken.start()
    wait_for(lambda: not broken._thread.is_alive(), "the failure")
    with pytest.raises(AdapterError, match="ZeroDivisionError"):
        broken.close()


def test_a_node_of_another_protocol_works_beside_the_devices(channel):
    foreign_node = HeartbeatGuest(16)
    with SimulatedNetwork(
        devices=[Device(drive_eds(), 40)], foreign_nodes=[foreign_node], **options(channel)
    ):
        master = Master(channel)
        try:
            master.until(lambda message: message.arbitration_id == 16 << 5 | 1, "its heartbeat")
            master.send(16 << 5 | 0x17, "0102030405060708")
            answer = master.until(lambda message: message.arbitration_id == 16 << 5 | 0x17, "its answer")
            assert bytes(answer.data) == bytes.fromhex("0807060504030201")
        finally:
            master.bus.shutdown()
