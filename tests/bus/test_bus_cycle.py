"""The bus as the scan drives it: the grid by a clock of our own, the frames of a cycle, and the quick stop that gets out."""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Callable, Iterator

import can
import pytest

from axisbus.bus.cycle import BootHeartbeat, CanCycle
from axisbus.bus.link.channel import Channel
from axisbus.bus.port import CanPort
from axisbus.cia402.port import Outputs
from axisbus.clock import SystemClock, VirtualClock
from axisbus.errors import AdapterError, TransmitQueueFull
from axisbus.sim.virtual_can import VirtualWire
from kit.bus.fake_bus import FakeBus, eventually
from kit.bus.ports import port_of, slave_of
from kit.manual_clock import HandClock


class Imprecise(HandClock):
    """A clock whose sleeps end a little too late or too early, as those of a real one do."""

    def __init__(self, overshoot: float = 0.0, share: float = 1.0) -> None:
        super().__init__(100.0)
        self.overshoot, self.share = overshoot, share

    def sleep(self, seconds: float) -> None:
        super().sleep(seconds if self.share == 1.0 else max(seconds * self.share, 0.0001))
        self.time += self.overshoot


class Watched(HandClock):
    """A clock at which each look of the scan takes some time."""

    def __init__(self) -> None:
        super().__init__(100.0)
        self.looks: list[float] = []

    def now(self) -> float:
        if threading.current_thread() is threading.main_thread():
            self.looks.append(self.time)
            self.time += 0.00001
            return self.looks[-1]
        return self.time


@pytest.fixture
def ports(channel: Channel, fake: FakeBus) -> Iterator[list[CanPort]]:
    made = []
    for node_id in (5, 6):
        slave_of(fake, node_id)
        made.append(port_of(channel, node_id))
    fake.sent.clear()
    yield made
    for port in made:
        port.close()
        port.node.close()


def target(node_id: int, word: int, position: int) -> tuple[int, bytes]:
    return 0x200 + node_id, struct.pack("<Hi", word, position)


def sdo_stop(node_id: int) -> tuple[int, bytes]:
    return 0x600 + node_id, bytes.fromhex("2B 40 60 00 02 00 00 00")


# -- time


def test_the_grid_does_not_drift(channel: Channel) -> None:
    channel.clock = Imprecise(overshoot=0.0003)
    cycle = CanCycle(channel, [])
    begun = []
    for number in range(1, 101):
        cycle.wait_until(100.0 + number * 0.004)
        begun.append(cycle.now() - (100.0 + number * 0.004))
    assert begun == pytest.approx([0.0003] * 100)


def test_a_late_cycle_is_not_waited_for(channel: Channel) -> None:
    clock = channel.clock = HandClock(100.0)
    cycle = CanCycle(channel, [])
    cycle.wait_until(99.99)
    assert clock.slept == []
    assert cycle.now() == 100.0


def test_a_sleep_that_ends_early_is_continued(channel: Channel) -> None:
    clock = channel.clock = Imprecise(share=0.5)
    cycle = CanCycle(channel, [])
    cycle.wait_until(100.004)
    assert clock.time >= 100.004
    assert len(clock.slept) > 1


def test_the_end_of_a_wait_is_watched_and_not_slept_through(channel: Channel) -> None:
    clock = channel.clock = Watched()
    cycle = CanCycle(channel, [], spin=0.0001)
    cycle.wait_until(100.004)
    assert clock.slept == pytest.approx([0.0039])
    assert clock.looks[-1] == pytest.approx(100.004, abs=0.00002)
    assert clock.looks[-1] >= 100.004


def test_a_wait_in_real_time_never_ends_too_early(channel: Channel) -> None:
    cycle = CanCycle(channel, [])
    for _ in range(20):
        t = cycle.now() + 0.002
        cycle.wait_until(t)
        assert time.monotonic() >= t


# -- the frames of a cycle


def test_one_cycle_sends_every_ports_frames_then_sync_then_heartbeat(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports, master_id=127, heartbeat=0.1)
    for number, port in enumerate(ports):
        port.write(Outputs(controlword=0x0F, target_position=number))
    cycle.commit()
    cycle.sync()
    cycle.heartbeat()
    assert fake.sent == [target(5, 0x0F, 0), target(6, 0x0F, 1), (0x080, b""), (0x77F, b"\x05")]
    fake.sent.clear()
    cycle.commit()  # nothing was given since
    assert fake.sent == []


def test_without_sync_and_heartbeat_the_cycle_sends_neither(channel: Channel, fake: FakeBus) -> None:
    cycle = CanCycle(channel, [], sync_cob_id=None)
    cycle.sync()
    cycle.heartbeat()
    assert fake.sent == []


def test_our_heartbeat_keeps_its_period(channel: Channel, fake: FakeBus) -> None:
    clock = channel.clock = HandClock(100.0)
    cycle = CanCycle(channel, [], master_id=127, heartbeat=0.1)
    for number in range(251):  # one second in cycles of 4 ms
        cycle.wait_until(100.0 + number * 0.004)
        cycle.heartbeat()
    assert 10 <= len(fake.frames(0x77F)) <= 11
    clock.time += 5.0  # after a suspension one is sent, not fifty
    cycle.heartbeat()
    cycle.heartbeat()
    assert len(fake.frames(0x77F)) <= 12


@pytest.mark.timeout(60)
def test_our_first_heartbeat_may_wait_for_a_full_queue_in_virtual_time() -> None:
    """The thread of another node that wants it too waits in virtual time as well, and does not keep the turn."""
    clock = VirtualClock()
    wire = VirtualWire(clock, ())
    adapter = wire.connect()
    adapter.full = True
    with Channel(adapter, "simulated", clock=clock) as channel:
        heard: list[tuple[float, int]] = []
        other = Channel(wire.connect(), "simulated", clock=clock)
        other.subscribe(0x77F, lambda data, stamp: heard.append((round(stamp, 3), data[0])))
        heartbeat = BootHeartbeat(channel, 127, 0.1)
        threads = [clock.thread(heartbeat.begin, f"axisbus node {number}") for number in (1, 2)]
        for thread in threads:
            thread.start()
        clock.sleep(0.002)
        adapter.full = False
        clock.sleep(0.25)
        assert not any(thread.is_alive() for thread in threads)
        heartbeat.end()
        clock.sleep(1.0)
        assert heard == [(0.002, 5), (0.102, 5), (0.202, 5)]
    clock.close()


def test_a_master_that_receives_nothing_sends_no_more_set_points(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports)
    fake.fail_receiving(OSError("unplugged"))
    eventually(lambda: channel.failure)
    ports[0].write(Outputs(controlword=0x0F, target_position=1))
    with pytest.raises(AdapterError, match="stopped receiving"):
        cycle.commit()
    with pytest.raises(AdapterError):
        cycle.sync()
    assert fake.sent == []


def once(cycle: CanCycle, ports: list[CanPort], position: int) -> None:
    """Run one cycle as a scan does, with a target for each port."""
    cycle.sync()
    for port in ports:
        port.read(cycle.now())
        port.write(Outputs(controlword=0x0F, target_position=position))
    cycle.commit()
    cycle.heartbeat()


def test_a_full_queue_ends_no_cycle_and_its_refused_frames_are_not_sent_later(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports, sync_counter=10, master_id=127, heartbeat=0.001)
    for node_id in (5, 6):
        fake.inject(0x700 + node_id, "05")
    eventually(lambda: all(port.read(cycle.now()).operational for port in ports))
    once(cycle, ports, 1)
    before = list(fake.sent)
    assert before == [(0x80, b"\x01"), target(5, 0x0F, 1), target(6, 0x0F, 1), (0x77F, b"\x05")]
    fake.full = True
    for position in (2, 3, 4):
        once(cycle, ports, position)
        seen = [port.read(cycle.now()) for port in ports]
        assert [type(inputs.bus) for inputs in seen] == [TransmitQueueFull] * 2
        assert not any(inputs.operational for inputs in seen)
        cycle.wait_until(cycle.now())  # reception works, so nothing is raised
    assert "its transmit queue is full" in seen[0].bus.message
    assert fake.sent == before
    fake.full = False
    # The outputs of the drives are replaced before SYNC, and SYNC counts the sent frames.
    once(cycle, ports, 5)
    assert fake.sent[4:] == [target(5, 0x0F, 5), target(6, 0x0F, 5), (0x80, b"\x02"), (0x77F, b"\x05")]
    seen = [port.read(cycle.now()) for port in ports]
    assert [(inputs.bus, inputs.operational) for inputs in seen] == [(None, True)] * 2
    fake.sent.clear()
    once(cycle, ports, 6)
    assert fake.sent[:3] == [(0x80, b"\x03"), target(5, 0x0F, 6), target(6, 0x0F, 6)]


def test_a_blocked_cycle_tries_each_frame_once_without_waiting(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports, master_id=127, heartbeat=0.001)
    fake.full = True
    once(cycle, ports, 1)
    for position in (2, 3):
        refused = channel.counters.full
        once(cycle, ports, position)
        assert channel.counters.full == refused + 1


@pytest.mark.parametrize(
    ("options", "probe"),
    [
        ({}, (0x80, b"")),
        ({"sync_cob_id": None, "master_id": 127, "heartbeat": 60.0}, (0x77F, b"\x05")),
    ],
)
def test_a_cycle_without_frames_finds_out_by_sync_or_heartbeat_that_the_queue_has_room(
    channel: Channel, fake: FakeBus, options: dict, probe: tuple[int, bytes]
) -> None:
    cycle = CanCycle(channel, [], **options)
    fake.full = True
    once(cycle, [], 0)
    assert isinstance(channel.off, TransmitQueueFull)
    fake.full = False
    once(cycle, [], 0)
    assert channel.off is None
    assert fake.sent[0] == probe
    assert fake.sent.count((0x80, b"")) <= 1


def test_a_queue_that_fills_in_mid_cycle_drops_the_rest_of_the_cycle(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports)
    fake.full = True
    once(cycle, ports, 1)
    fake.full = False

    def fills(can_id: int, *_: object) -> list[tuple[int, bytes]]:
        fake.full |= can_id == 0x205
        return []

    fake.peers.append(fills)
    once(cycle, ports, 2)
    assert fake.sent == [target(5, 0x0F, 2)]
    assert isinstance(channel.off, TransmitQueueFull)
    fake.peers.remove(fills)
    fake.full = False
    once(cycle, ports, 3)
    assert fake.sent[1:] == [target(5, 0x0F, 3), target(6, 0x0F, 3), (0x80, b"")]


# -- the quick stop


def commanded(cycle: CanCycle, fake: FakeBus, ports: list[CanPort]) -> None:
    for port in ports:
        port.write(Outputs(controlword=0x1F, target_position=1000))
    cycle.commit()
    fake.sent.clear()


def test_a_quick_stop_repeats_the_last_frames_with_another_controlword(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    """Fully prebuilt frames would carry an old target; zeros would be a target too."""
    cycle = CanCycle(channel, ports)
    commanded(cycle, fake, ports)
    assert cycle.quick_stop_all()
    assert fake.sent == [
        target(5, 0x02, 1000),
        target(6, 0x02, 1000),
        (0x080, b""),
        sdo_stop(5),
        sdo_stop(6),
    ]


def test_an_axis_that_was_never_commanded_is_left_alone(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports)
    commanded(cycle, fake, ports[:1])
    cycle.quick_stop_all()
    assert {can_id for can_id, _ in fake.sent} == {0x205, 0x080, 0x605}
    fake.sent.clear()
    CanCycle(channel, []).quick_stop_all()
    assert fake.sent == []


def test_a_frame_that_was_written_but_never_committed_is_not_sent_by_the_stop(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports)
    commanded(cycle, fake, ports)
    ports[0].write(Outputs(controlword=0x1F, target_position=2000))
    cycle.quick_stop_all()
    assert target(5, 0x02, 1000) in fake.sent


def test_a_quick_stop_reaches_the_other_nodes_when_one_frame_fails(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports)
    commanded(cycle, fake, ports)

    def refuse(can_id: int, data: bytes, remote: bool) -> list[tuple[int, bytes]]:
        if can_id == 0x205:
            raise can.CanOperationError("Transmit buffer full")
        return []

    fake.peers.append(refuse)
    assert not cycle.quick_stop_all()
    assert fake.frames(0x206) == [target(6, 0x02, 1000)[1]]
    assert fake.frames(0x605) == [sdo_stop(5)[1]]  # and the first node gets it by SDO


def test_a_quick_stop_gets_out_of_a_failed_channel(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports)
    commanded(cycle, fake, ports)
    fake.fail_receiving(OSError("deaf"))
    eventually(lambda: channel.failure)
    assert cycle.quick_stop_all()
    assert target(5, 0x02, 1000) in fake.sent


def test_a_quick_stop_overtakes_the_scan_thread_that_is_stuck_in_send(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports)
    commanded(cycle, fake, ports)
    fake.stuck = threading.Event()
    ports[0].write(Outputs(controlword=0x1F, target_position=1001))
    scan = threading.Thread(target=cycle.commit, name="stuck scan")
    scan.start()
    eventually(lambda: channel._send_lock.locked())
    assert cycle.quick_stop_all()
    assert target(6, 0x02, 1000) in fake.sent
    assert target(5, 0x02, 1001) in fake.sent
    fake.stuck.set()
    scan.join()


def test_a_quick_stop_returns_even_if_the_driver_does_not(
    channel: Channel, fake: FakeBus, ports: list[CanPort]
) -> None:
    cycle = CanCycle(channel, ports)
    commanded(cycle, fake, ports)
    never = threading.Event()

    def block(can_id: int, data: bytes, remote: bool) -> list[tuple[int, bytes]]:
        never.wait(10)
        return []

    class Waited(threading.Thread):
        def join(self, timeout: float | None = None) -> None:
            patience.append(timeout)
            super().join(timeout)

    class Noting(SystemClock):
        def thread(self, run: Callable[[], object], name: str) -> Waited:
            return Waited(target=run, name=name, daemon=True)

    patience: list[float | None] = []
    channel.clock = Noting()
    fake.peers.append(block)
    begin = time.monotonic()
    assert not cycle.quick_stop_all()
    assert time.monotonic() - begin < 5
    assert patience == [0.5]
    never.set()


def test_a_port_that_breaks_does_not_keep_the_others_from_stopping(
    channel: Channel, fake: FakeBus, ports: list[CanPort], monkeypatch: pytest.MonkeyPatch
) -> None:
    cycle = CanCycle(channel, ports)
    commanded(cycle, fake, ports)

    def broken() -> None:
        raise ValueError("a fault of ours")

    monkeypatch.setattr(ports[0], "stop_frames", broken)
    assert not cycle.quick_stop_all()
    assert target(6, 0x02, 1000) in fake.sent


def test_closing_leaves_the_channel_to_its_owner(fake: FakeBus) -> None:
    with Channel(fake, "fake:0") as channel:
        CanCycle(channel, []).close()
        channel.check()
        cycle = CanCycle(channel, [], owns_channel=True)
        cycle.close()
        cycle.close()
        assert not fake.is_open


def test_a_quick_stop_repeats_only_the_frames_that_hold_the_controlword(
    channel: Channel, fake: FakeBus
) -> None:
    slave_of(fake, 5)
    port = port_of(channel, 5, ("6040/16", "607A/32"))
    assert port.stop_frames() == ((), ())
    port.write(Outputs(controlword=0x0F, target_position=7))
    assert [can_id for can_id, _ in port.take_frames()] == [0x305, 0x205]
    pdo, sdo = port.stop_frames()
    assert pdo == ((0x205, b"\x02\x00"),)
    assert sdo == (sdo_stop(5),)
    port.close()
    port.node.close()
