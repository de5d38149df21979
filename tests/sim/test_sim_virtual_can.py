"""The simulated wire: bit times, arbitration, faults, adapters, and that every run is the same."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.sdo.client import SdoClient
from axisbus.clock import VirtualClock
from axisbus.errors import StateError
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.node.network import ForeignNode
from axisbus.sim.virtual_can import VirtualAdapter, VirtualWire
from kit.motion.rig import GENERIC as GENERIC_FILE
from kit.motion.rig import dictionary_of
from kit.sim.heartbeat_guest import HeartbeatGuest
from kit.sim.same_frames import SCENARIOS, frames_of

BIT = 1e-6
TESTS = Path(__file__).parents[1]


class Ear:
    """Takes the frames of an adapter, as a channel does."""

    def __init__(self, clock: VirtualClock, adapter: VirtualAdapter) -> None:
        self.frames: list[tuple[float, int, bytes]] = []
        self.messages: list[can.Message] = []
        self.failures: list[Exception] = []
        self._clock = clock
        adapter.attach(self)

    def take_frame(self, can_id: int, data: bytes) -> None:
        self.frames.append((self._clock.now(), can_id, data))

    def take_message(self, message: can.Message) -> None:
        self.messages.append(message)

    def take_failure(self, error: Exception) -> None:
        self.failures.append(error)

    @property
    def ids(self) -> list[int]:
        return [can_id for _, can_id, _ in self.frames]


class Bench:
    """A wire with two adapters."""

    def __init__(
        self, *devices: Device, foreign_nodes: tuple[ForeignNode, ...] = (), bitrate: int = 1_000_000
    ) -> None:
        self.clock = VirtualClock()
        self.wire = VirtualWire(self.clock, devices, foreign_nodes, bitrate=bitrate)
        self.one, self.two = self.wire.connect(), self.wire.connect()
        self.ear_one, self.ear = Ear(self.clock, self.one), Ear(self.clock, self.two)


def node(node_id: int = 1) -> Device:
    return device_from_eds(dictionary_of(GENERIC_FILE), node_id, seed=node_id)


# -- the wire ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("bitrate", "bit"), [(1_000_000, 1e-6), (125_000, 8e-6)])
def test_a_frame_takes_the_time_of_its_bits(bitrate: int, bit: float) -> None:
    bench = Bench(bitrate=bitrate)
    bench.one.send(0x123, bytes(8))
    bench.clock.sleep(0.1)
    ((at, can_id, data),) = bench.ear.frames
    assert (can_id, data) == (0x123, bytes(8))
    assert 111 * bit <= at <= 135 * bit  # without stuff bits, and with all that there may be
    assert not bench.ear_one.frames  # it does not hear itself


def test_frames_of_one_sender_keep_their_order_and_the_lowest_identifier_of_all_is_sent_first() -> None:
    bench = Bench()
    for can_id in (0x300, 0x700, 0x080):
        bench.one.send(can_id, b"")
    bench.two.send(0x200, b"")
    bench.two.send(0x201, b"")
    bench.clock.sleep(0.1)
    assert bench.ear.ids == [0x300, 0x700, 0x080]
    order = sorted([*bench.ear.frames, *bench.ear_one.frames])
    assert [can_id for _, can_id, _ in order] == [0x300, 0x200, 0x201, 0x700, 0x080]


def test_virtual_time_does_not_pass_without_a_wait() -> None:
    bench = Bench()
    bench.one.send(0x123, b"")
    assert not bench.ear.frames
    bench.clock.sleep(0.001)
    assert bench.ear.ids == [0x123]


def test_remote_and_extended_frames_are_passed_as_messages() -> None:
    bench = Bench()
    bench.one.send_remote(0x701, 1)
    bench.one.send(0x1234_5678, b"\1")
    bench.clock.sleep(0.01)
    assert [(m.arbitration_id, m.is_remote_frame, m.is_extended_id) for m in bench.ear.messages] == [
        (0x701, True, False),
        (0x1234_5678, False, True),
    ]


def test_a_node_boots_and_answers_and_every_master_receives_it() -> None:
    bench = Bench(node(1), node(2))
    bench.clock.sleep(0.2)
    assert sorted(bench.ear.ids) == sorted(bench.ear_one.ids) == [0x701, 0x702]  # the boot-up messages
    bench.one.send(0x601, bytes((0x40, 0, 0x10, 0, 0, 0, 0, 0)))
    bench.clock.sleep(0.01)
    assert bench.ear.ids[2:] == [0x601, 0x581]
    assert bench.ear_one.ids[2:] == [0x581]


def test_the_objects_of_a_node_are_at_hand_as_those_of_a_local_node_of_canopen() -> None:
    bench = Bench(node(1))
    (local,) = bench.wire.nodes
    assert local.sdo[0x1018][1].raw == bench.wire.devices[0].read(0x1018, 1)
    local.sdo[0x607A].raw = 1234
    assert bench.wire.devices[0].drive.target_position == 1234


def test_a_late_answer_is_sent_at_its_time() -> None:
    device = node()
    device.dials.sdo_delay = 0.0123
    bench = Bench(device)
    bench.clock.sleep(0.2)
    began = bench.clock.now()
    bench.one.send(0x601, bytes((0x40, 0, 0x10, 0, 0, 0, 0, 0)))
    bench.clock.sleep(0.1)
    (at,) = [at for at, can_id, _ in bench.ear.frames if can_id == 0x581]
    assert at - began == pytest.approx(0.0123, abs=0.0004)


def test_modules_of_another_protocol_receive_the_nodes_and_each_other() -> None:
    bench = Bench(node(), foreign_nodes=(HeartbeatGuest(5), HeartbeatGuest(6)))
    bench.clock.sleep(1.0)
    assert {0x701, 0xA1, 0xC1} <= set(bench.ear.ids)  # the boot-up message, and heartbeats of both


def test_the_plant_is_stepped_to_the_present_time_when_a_wait_ends() -> None:
    bench = Bench(node())
    bench.clock.sleep(0.0123)
    assert bench.wire.devices[0].time == pytest.approx(0.0123)


# -- faults ------------------------------------------------------------------------------------------------------------


def sent(
    turn: Callable[[VirtualWire], None], seed: int = 0, count: int = 1000
) -> list[tuple[float, int, bytes]]:
    clock = VirtualClock()
    wire = VirtualWire(clock, (), seed=seed)
    one, two = wire.connect(), wire.connect()
    Ear(clock, one)
    ear = Ear(clock, two)
    turn(wire)
    for number in range(count):
        one.send(0x123, number.to_bytes(2, "little"))
        clock.sleep(0.001)
    clock.sleep(1.0)
    return ear.frames


def test_frames_are_lost_doubled_and_changed_with_the_given_probability() -> None:
    assert 600 < len(sent(lambda wire: setattr(wire.faults, "loss", 0.3))) < 800
    assert 1200 < len(sent(lambda wire: setattr(wire.faults, "duplication", 0.3))) < 1400
    changed = sent(lambda wire: setattr(wire.faults, "corruption", 0.3))
    assert len(changed) == 1000
    wrong = sum(data != number.to_bytes(2, "little") for number, (_, _, data) in enumerate(changed))
    assert 200 < wrong < 400
    assert not sent(lambda wire: setattr(wire.faults, "cut", True))


def test_random_faults_are_the_same_for_the_same_seed() -> None:
    def turn(wire: VirtualWire) -> None:
        wire.faults.loss = wire.faults.duplication = wire.faults.corruption = 0.1
        wire.faults.delay, wire.faults.jitter = 0.002, 0.001

    assert sent(turn, seed=3) == sent(turn, seed=3)
    assert sent(turn, seed=3) != sent(turn, seed=4)


def test_behind_a_gateway_frames_are_late_in_both_directions_and_keep_their_order() -> None:
    def turn(wire: VirtualWire) -> None:
        wire.faults.delay, wire.faults.jitter = 0.02, 0.01

    frames = sent(turn, count=200)
    assert [int.from_bytes(data, "little") for _, _, data in frames] == list(range(200))
    delays = [at - number * 0.001 for number, (at, _, _) in enumerate(frames)]
    assert min(delays) >= 0.04
    assert max(delays) <= 0.065


def test_jitter_alone_makes_frames_late() -> None:
    frames = sent(lambda wire: setattr(wire.faults, "jitter", 0.01), count=200)
    delays = [at - number * 0.001 for number, (at, _, _) in enumerate(frames)]
    assert 0.005 < max(delays) <= 0.025


def test_frames_sent_while_the_wire_is_cut_are_lost() -> None:
    bench = Bench()
    bench.wire.faults.cut = True
    bench.one.send(0x100, b"")
    bench.clock.sleep(0.01)
    bench.wire.faults.cut = False
    bench.one.send(0x101, b"")
    bench.clock.sleep(0.01)
    assert bench.ear.ids == [0x101]


def test_frames_withheld_from_the_nodes_are_received_by_masters() -> None:
    device = node()
    bench = Bench(device)
    bench.clock.sleep(0.2)
    device.write(0x1016, 1, 127 << 16 | 500)
    bench.wire.faults.heartbeat_lost = bench.wire.faults.sync_lost = True
    bench.one.send(0x77F, b"\5")
    bench.one.send(0x080, b"")
    bench.clock.sleep(0.1)
    assert bench.ear.ids[-2:] == [0x77F, 0x080]


@pytest.mark.parametrize("lost", [False, True])
def test_the_sync_of_any_identifier_can_be_kept_from_the_nodes(lost: bool) -> None:
    device = node()
    bench = Bench(device)
    bench.clock.sleep(0.2)
    device.write(0x1005, 0, 0x090)
    device.write(0x1800, 1, 0xC000_0181)
    device.write(0x1800, 2, 1)
    device.write(0x1800, 1, 0x4000_0181)
    bench.wire.faults.sync_lost = lost
    bench.one.send(0x000, b"\1\0")
    bench.clock.sleep(0.01)
    before = len(bench.ear.ids)
    for _ in range(3):
        bench.one.send(0x090, b"")
        bench.clock.sleep(0.01)
    tpdos = [each for each in bench.ear.ids[before:] if each != 0x090]
    assert bool(tpdos) is not lost


# -- adapters ----------------------------------------------------------------------------------------------------------


def test_a_full_queue_refuses_frames_until_it_has_room() -> None:
    bench = Bench()
    bench.one.full = True
    with pytest.raises(can.CanOperationError) as caught:
        bench.one.send(0x100, b"")
    assert caught.value.error_code == errno.ENOBUFS
    assert bench.one.send_all([(0x100, b"")]) == 0
    bench.one.full = False
    assert bench.one.send_all([(0x100, b""), (0x101, b"")]) == 2
    bench.clock.sleep(0.01)
    assert bench.ear.ids == [0x100, 0x101]


def test_an_adapter_that_is_unplugged_reports_so_and_sends_nothing() -> None:
    bench = Bench()
    bench.one.unplug()
    assert isinstance(bench.ear_one.failures[0], OSError)
    with pytest.raises(OSError, match="No such device"):
        bench.one.send(0x100, b"")
    assert bench.one.send_all([(0x100, b"")]) == 0
    bench.two.send(0x101, b"")
    bench.clock.sleep(0.01)
    assert not bench.ear_one.frames


def test_a_controller_that_is_bus_off_neither_sends_nor_receives_until_it_restarts() -> None:
    bench = Bench()
    bench.one.send(0x100, b"")
    bench.one.send(0x101, b"")
    bench.one.go_off(True)
    assert bench.one.state is can.BusState.ERROR
    bench.two.send(0x102, b"")
    bench.clock.sleep(0.01)
    assert 0x101 not in bench.ear.ids
    assert not bench.ear_one.frames
    bench.one.go_off(False)
    bench.two.send(0x103, b"")
    bench.clock.sleep(0.01)
    assert bench.ear_one.ids == [0x103]
    assert [message.is_error_frame for message in bench.ear_one.messages] == [True, True]


def test_the_queued_frames_of_a_closed_adapter_are_not_sent() -> None:
    bench = Bench()
    bench.one.send(0x100, b"")
    bench.one.send(0x101, b"")
    bench.one.shutdown()
    bench.two.send(0x102, b"")
    bench.clock.sleep(0.01)
    assert 0x101 not in bench.ear.ids
    assert not bench.ear_one.frames


# -- the same in every run ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SCENARIOS)
def test_the_same_seed_gives_the_same_frames_at_the_same_times(tmp_path: Path, seed: int) -> None:
    assert frames_of(tmp_path, seed) == frames_of(tmp_path, seed)


def test_the_same_seeds_give_the_same_frames_in_another_process(tmp_path: Path) -> None:
    path = os.pathsep.join([str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
    ran = subprocess.run(
        [sys.executable, "-m", "kit.sim.same_frames", str(tmp_path)],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert ran.stdout.split() == [frames_of(tmp_path, seed) for seed in SCENARIOS]


def test_a_frame_callback_must_not_wait_for_another_frame() -> None:
    """As in the receive thread of an adapter: a program that runs in virtual time runs on hardware too."""
    clock = VirtualClock()
    with Channel(VirtualWire(clock, [node()]).connect(), "simulated", clock=clock) as channel:
        sdo, seen = SdoClient(channel, 1), list[bool]()

        def read(_: bytes, __: float) -> None:
            seen.append(channel.in_receive_thread)
            with pytest.raises(StateError, match="an SDO transfer was called in the receive thread"):
                sdo.read(0x1000)

        channel.subscribe(0x701, read)
        clock.sleep(1.0)  # its boot-up message
        assert seen == [True]
        assert not channel.in_receive_thread
        assert sdo.read(0x1000) == 0x00020192
        assert channel.failure is None
