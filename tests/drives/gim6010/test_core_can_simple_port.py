"""A module on a channel, without a bus: reports and repeated orders after a bus-off, and a request is no order."""

from __future__ import annotations

import struct

from axisbus.cia402.port import Outputs
from axisbus.drives.gim6010.core.part import ModuleSender
from axisbus.errors import BusOff
from kit.can_simple.rig import SETTINGS

ENABLE, HALT = 0x0F, 0x100
VELOCITY_MODE = struct.pack("<II", 2, 2)
PV = 3


class Quiet:
    """A channel that carries nothing alone; ``bus_off_count`` counts its bus-offs."""

    def __init__(self) -> None:
        self.receivers = {}
        self.bus_off_count = 0
        self.off = None
        self.last_bus_off = None

    def subscribe(self, can_id, receiver) -> None:
        self.receivers[can_id] = receiver

    def unsubscribe(self, can_id, receiver) -> None:
        self.receivers.pop(can_id, None)


class SenderBench:
    """A sender and its module, which is in closed loop once it was requested, and turns as commanded."""

    def __init__(self) -> None:
        self.channel = Quiet()
        self.sender = ModuleSender(self.channel, SETTINGS)
        self.now, self.life, self.state, self.speed = 10.0, 0, 1, 0.0

    def say(self, command: int, data: bytes) -> None:
        self.channel.receivers[5 << 5 | command](data, self.now)

    def cycle(self, word: int | None, *, dropped: bool = False, **outputs):
        """Run one cycle; return the inputs, and the sent orders, by command."""
        self.now += 0.01
        if round(self.now * 100) % 10 == 0:
            self.say(1, struct.pack("<IBBBB", 0, self.state, 0x80, 0, self.life))
            self.life += 1
        self.say(9, struct.pack("<ff", 1.0, self.speed))
        inputs = self.sender.read(self.now)
        self.sender.write(Outputs(controlword=word, **outputs))
        frames = self.sender.take_frames()
        if dropped:
            self.sender.drop_frames()
            return inputs, []
        for can_id, data in frames:
            if can_id & 0x1F == 7:
                self.state = data[0]
        return inputs, [(can_id & 0x1F, data) for can_id, data in frames]


def turning() -> SenderBench:
    talk = SenderBench()
    for _ in range(30):
        talk.cycle(None)
    for word in (0x06, 0x07, *[ENABLE] * 40):
        talk.cycle(word, mode=PV, target_velocity=3 * 16384)
    talk.speed = 3.0
    for _ in range(10):
        talk.cycle(ENABLE, target_velocity=3 * 16384)
    assert talk.state == 8
    return talk


def test_during_bus_off_a_module_is_not_operational_and_the_reason_is_reported():
    talk = turning()
    inputs, _ = talk.cycle(ENABLE)
    assert inputs.operational
    assert inputs.bus is None
    talk.channel.off = talk.channel.last_bus_off = BusOff("the controller is bus-off")
    talk.channel.bus_off_count += 1
    for _ in range(3):
        inputs, _ = talk.cycle(ENABLE, dropped=True)
        assert not inputs.operational
        assert inputs.bus is talk.channel.off
    talk.channel.off = None
    inputs, _ = talk.cycle(ENABLE)
    assert inputs.operational


def test_a_bus_off_that_ends_before_the_next_cycle_is_reported_once():
    talk = turning()
    talk.channel.last_bus_off = BusOff("the controller is bus-off")
    talk.channel.bus_off_count += 1
    inputs, _ = talk.cycle(ENABLE)
    assert not inputs.operational
    inputs, _ = talk.cycle(ENABLE)
    assert inputs.operational


def test_dropped_frames_are_sent_again_with_the_mode_and_a_halt():
    talk = turning()
    _, before = talk.cycle(ENABLE | HALT, target_velocity=3 * 16384)
    assert VELOCITY_MODE not in [data for command, data in before if command == 0x0B]
    talk.cycle(ENABLE | HALT, dropped=True)
    _, after = talk.cycle(ENABLE | HALT)
    assert (0x0B, VELOCITY_MODE) in after
    velocities = [struct.unpack("<f", data[:4])[0] for command, data in after if command == 0x0D]
    assert velocities
    assert velocities[-1] < 3.0


def test_the_frames_of_a_stop_are_there_for_another_thread():
    talk = turning()
    (mode, speed), none = talk.sender.stop_frames()
    assert mode == (5 << 5 | 0x0B, VELOCITY_MODE)
    assert speed == (5 << 5 | 0x0D, bytes(8))
    assert none == ()
    idle = SenderBench()
    for _ in range(30):
        idle.cycle(None)
    assert idle.sender.stop_frames() == ((), ())


def test_a_closed_sender_is_no_longer_a_receiver_of_the_channel():
    talk = SenderBench()
    talk.sender.close()
    assert talk.channel.receivers == {}
