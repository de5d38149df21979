"""The simulated drive's LSS slave: hand-written frames, canopen's master and ours against it, and its fault settings."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator

import canopen
import pytest

from axisbus.sim.device import Device
from axisbus.sim.fault_injection import LssFaults
from axisbus.sim.node.lss import LssSlave
from axisbus.sim.node.network import SimulatedNetwork
from axisbus.sim.node.slave import Slave
from kit.sim.eds import DRIVE, NODE, U32, make_eds

EDS = make_eds(
    [
        *(row for row in NODE if row[0] != 0x1018),
        (0x1018, 1, U32, "ro", 0x1234),
        (0x1018, 2, U32, "ro", 0x56),
        (0x1018, 3, U32, "ro", 0x10002),
        (0x1018, 4, U32, "ro", 0),
        *DRIVE,
    ]
)
FEW_ONES = make_eds(
    [
        *(row for row in NODE if row[0] != 0x1018),
        *((0x1018, part, U32, "ro", part) for part in range(1, 5)),
        *DRIVE,
    ]
)  # canopen's fast scan waits its whole time-out for each one-bit
DEADLINE = 20.0
_channels = (f"test-sim-lss-{number}" for number in itertools.count())


class Wire:
    """A simulated drive without a bus: frames in as hex, LSS answers out as hex, time by hand."""

    def __init__(self, node_id: int = 255, serial: int = 7, dials: LssFaults | None = None) -> None:
        self.device = Device(EDS, node_id, serial=serial)
        if dials is not None:
            self.device.dials.lss = self.device.lss.dials = dials
        self.slave = Slave(self.device)
        self.now = 0.0
        self.frames: list[tuple[int, str]] = []

    def send(self, *frames: str) -> list[str]:
        """Send LSS requests (padded to 8 bytes) and return the answers without trailing zeros."""
        self.frames.clear()
        for frame in frames:
            self.slave.on_frame(0x7E5, bytes.fromhex(frame).ljust(8, b"\0"), self.now)
            self._collect()
        return [data for can_id, data in self.frames if can_id == 0x7E4]

    def pass_time(self, seconds: float) -> list[str]:
        """Let time pass in steps of 2 ms."""
        self.frames.clear()
        for _ in range(round(seconds / 0.002)):
            self.now += 0.002
            self.slave.step(self.now)
            self._collect()
        return [data for can_id, data in self.frames if can_id == 0x7E4]

    def _collect(self) -> None:
        for can_id, data in self.slave.take_frames():
            assert can_id != 0x7E4 or len(data) == 8
            self.frames.append((can_id, data.hex().rstrip("0") if can_id == 0x7E4 else data.hex()))


SELECT = ("4034120000", "4156000000", "4202000100", "4307000000")


def test_without_a_node_id_it_neither_boots_nor_answers_anything_but_lss() -> None:
    wire = Wire()
    wire.pass_time(1.0)
    wire.slave.on_frame(0x000, b"\x01\x00", wire.now)
    wire.slave.on_frame(0x605, bytes.fromhex("4000100000000000"), wire.now)
    assert wire.frames == []
    assert wire.send("4c") == ["5"]  # 50h: a slave without a node-ID is here


def test_a_node_id_is_given_in_hand_written_frames_and_it_boots_under_it() -> None:
    wire = Wire()
    assert wire.send("0400", *SELECT) == ["44"]
    assert wire.send("5e") == ["5eff"]
    assert wire.send("1105") == ["11"]
    assert wire.send("0400") == []
    wire.pass_time(0.2)
    assert (0x705, "00") in wire.frames
    assert wire.device.read(0x1014) == 0x85  # its COB-IDs follow the node-ID
    wire.frames.clear()
    wire.slave.on_frame(0x605, bytes.fromhex("4018100400000000"), wire.now)
    wire._collect()
    assert (0x585, "4318100407000000") in wire.frames


def test_a_configured_node_takes_a_new_node_id_at_a_reset_of_communication() -> None:
    wire = Wire(node_id=5)
    wire.pass_time(0.2)
    assert wire.send("0400", *SELECT, "1106", "0400") == ["44", "11"]
    wire.pass_time(0.2)
    assert wire.device.node_id == 5
    wire.slave.on_frame(0x000, bytes((130, 5)), wire.now)
    wire.pass_time(0.2)
    assert (0x706, "00") in wire.frames


def test_only_stored_settings_survive_a_restart() -> None:
    wire = Wire(node_id=5)
    wire.pass_time(0.2)
    wire.send("0400", *SELECT, "1106", "17", "1107", "0400")
    wire.slave.on_frame(0x000, bytes((129, 5)), wire.now)  # reset node
    wire.pass_time(0.2)
    assert wire.device.node_id == 6


def test_fast_scan_in_hand_written_frames() -> None:
    wire = Wire()
    assert wire.send("5100000000800000") == ["4f"]
    assert wire.send("51000000001f0000") == ["4f"]  # bit 31 is 0
    assert wire.send("51001000000c0000") == ["4f"]  # 1234h down to bit 12
    assert wire.send("51002000000c0000") == []
    assert wire.send("5134120000000001") == ["4f"]  # confirmed, on to part 1
    assert wire.send("5134120000000001") == []  # part 0 is over
    assert wire.send("5156000000000102", "5102000100000203", "5107000000000300") == ["4f"] * 3
    assert wire.send("5e") == ["5eff"]  # which only configuration answers
    assert wire.send("5100000000800000") == []  # and fast scan no longer does


def test_a_fault_setting_lets_fast_scan_be_answered_in_configuration_too() -> None:
    wire = Wire(dials=LssFaults(answers_on=True))
    assert wire.send("0401", "5100000000800000", "51001000000c0000", "51002000000c0000") == ["4f", "4f"]
    assert wire.send("5e") == ["5eff"]


def test_fast_scan_ignores_a_node_that_has_a_node_id() -> None:
    wire = Wire(node_id=5)
    wire.pass_time(0.2)
    assert wire.send("5100000000800000") == []


def test_inquiries_and_identification() -> None:
    wire = Wire()
    assert wire.send("5a") == []  # not in waiting
    identify = ("4634120000", "4756000000", "48", "49ffffffff", "4a07000000", "4b07000000")
    assert wire.send(*identify) == ["4f"]
    assert wire.send(*identify[:5], "4b06000000") == []
    assert wire.send(*identify[1:]) == []
    wire.send("0401")
    assert wire.send("5a", "5b", "5c", "5d") == ["5a3412", "5b56", "5c020001", "5d07"]


def test_requests_that_the_slave_refuses_or_ignores() -> None:
    wire = Wire(dials=LssFaults(refused_rates=frozenset({500_000})))
    wire.send("0401")
    assert wire.send("1100", "1180", "11ff") == ["1101", "1101", "11"]
    assert wire.send("130002", "130005", "138000", "130003") == ["1301", "1301", "1301", "13"]
    assert wire.send("99", "") == []
    wire.slave.on_frame(0x7E5, b"\x5e", wire.now)  # short
    assert wire.slave.take_frames() == []


def test_activation_waits_and_is_silent_before_and_after() -> None:
    wire = Wire()
    wire.send("0401", "130004", "156400")  # 125 kbit/s, 100 ms
    assert wire.send("5e") == []
    wire.pass_time(0.09)
    assert wire.device.lss.bit_rate == 0
    wire.pass_time(0.03)
    assert wire.device.lss.bit_rate == 125_000
    assert wire.send("5e") == []
    wire.pass_time(0.1)
    assert wire.send("5e") == ["5eff"]


def test_dials_for_errors_delays_and_losses() -> None:
    dials = LssFaults(store_error=1, node_id_error=255, specific_error=9, delay=0.05)
    wire = Wire(dials=dials)
    wire.send("0401")
    assert wire.send("17") == []
    assert wire.pass_time(0.04) == []
    assert wire.pass_time(0.02) == ["170109"]
    assert wire.send("1105") + wire.pass_time(0.06) == ["11ff09"]
    dials.delay, dials.lost_requests = 0.0, 1
    assert wire.send("5e", "5e") == ["5eff"]
    dials.lost_answers = 2
    assert wire.send("5e", "5e", "5e") == ["5eff"]
    dials.absent = True
    assert wire.send("5e") == []


def test_loss_is_by_chance_and_repeatable() -> None:
    def answered() -> list[bool]:
        slave = LssSlave(lambda: (1, 2, 3, 4), 255, LssFaults(loss=0.3), seed=5)
        seen = []
        for number in range(300):
            slave.on_frame(bytes.fromhex("4c00000000000000"), float(number))
            seen.append(bool(slave.take_answers(float(number))))
        return seen

    assert answered() == answered()
    assert 90 < sum(answered()) < 210  # about 0.7 · 0.7


def test_a_dead_or_booting_node_does_not_answer() -> None:
    wire = Wire(node_id=5)
    assert wire.send("4c", "0401", "5e") == []  # still booting
    wire.pass_time(0.2)
    wire.device.dials.dead = True
    assert wire.send("0401", "5e") == []


# On a bus, with other implementations of the master.


@pytest.fixture
def simulated_nodes() -> Iterator[SimulatedNetwork]:
    devices = [Device(FEW_ONES, 255, serial=serial, seed=serial) for serial in (0x40, 0x44)]
    with SimulatedNetwork(next(_channels), devices) as made:
        yield made


def test_canopens_own_master_finds_and_configures_one(simulated_nodes: SimulatedNetwork) -> None:
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.05
    network.connect(interface="virtual", channel=simulated_nodes._options["channel"])
    try:
        assert network.lss.fast_scan() == (True, [1, 2, 3, 0x40])
        assert network.lss.inquire_node_id() == 255
        network.lss.configure_node_id(42)
        network.lss.store_configuration()
        network.lss.configure_bit_timing(2)
        network.lss.send_switch_state_global(network.lss.WAITING_STATE)
        device = simulated_nodes.devices[0]
        end = time.monotonic() + DEADLINE
        while device.boot_ups == 0:
            assert time.monotonic() < end, "no boot-up"
            time.sleep(0.005)
        assert (device.node_id, device.lss.stored, device.lss.pending_bit_rate) == (42, 42, 500_000)
        assert network.lss.send_switch_state_selective(1, 2, 3, 0x44)
        assert network.lss.inquire_lss_address(0x5D) == 0x44
    finally:
        network.disconnect()


def test_a_simulated_drive_that_got_its_node_id_is_a_node_like_any_other(
    simulated_nodes: SimulatedNetwork,
) -> None:
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.05
    network.connect(interface="virtual", channel=simulated_nodes._options["channel"])
    try:
        network.lss.RESPONSE_TIMEOUT = DEADLINE
        assert network.lss.send_switch_state_selective(1, 2, 3, 0x44)
        network.lss.configure_node_id(9)
        network.lss.send_switch_state_global(network.lss.WAITING_STATE)
        node = network.add_node(9, canopen.ObjectDictionary())
        node.sdo.RESPONSE_TIMEOUT = DEADLINE
        node.nmt.wait_for_bootup(DEADLINE)
        assert node.sdo.upload(0x1000, 0) == bytes.fromhex("92010200")
        assert node.sdo.upload(0x1800, 1) == bytes.fromhex("89010000")
    finally:
        network.disconnect()
