"""Parts of a module's port, frame by frame: the conditions of closed loop, position, target reached and restart."""

from __future__ import annotations

import random
import struct

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.cia402.port import Outputs, SdoRequest
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.rotor_position import RotorPosition
from axisbus.errors import ArgumentError, LimitError
from kit.can_simple.rig import COUNTS, SETTINGS, TorqueSettings, replace

QUESTIONS = {0x03, 0x09, 0x0A, 0x14}  # without a remote frame they are eight bytes of 0
PP = 1
HOMING = 6


class PortBench:
    """A port and a module that sends the values of the test every 10 ms; heartbeats every 0.1 s."""

    def __init__(self) -> None:
        self.port = ModulePort(SETTINGS)
        self.now = 10.0
        self.state, self.error, self.life, self.done = 1, 0, 0, True
        self.turns, self.velocity = 0.25, 0.0
        self.sent: list[tuple[int, bytes]] = []

    def hear(self, command: int, data: bytes) -> None:
        self.port.receive(CanFrame(self.now, 5 << 5 | command, data), self.now)

    def beat(self) -> None:
        self.hear(1, struct.pack("<IBBBB", self.error, self.state, self.done << 7, 0, self.life))
        self.life = self.life + 1 & 0xFF

    def cycle(self, word: int | None = None, **outputs) -> int:
        """One cycle; return the statusword that was read in it."""
        self.now += 0.01
        if round(self.now * 100) % 10 == 0:
            self.beat()
        self.hear(9, struct.pack("<ff", self.turns, self.velocity) if self.state == 8 else bytes(8))
        self.hear(10, struct.pack("<ii", 7777, round(self.turns * COUNTS) % COUNTS))
        inputs = self.port.read(self.now)
        self.inputs = inputs
        self.port.write(Outputs(controlword=word, **outputs))
        frames = [(each.can_id & 0x1F, each.data) for each in self.port.take_frames()]
        self.sent = [(command, data) for command, data in frames if command not in QUESTIONS]
        return inputs.statusword.value if inputs.statusword else 0

    def cycles(self, number: int, word: int | None = None, **outputs) -> list[tuple[int, bytes]]:
        """So many cycles; return all that was sent."""
        sent = []
        for _ in range(number):
            self.cycle(word, **outputs)
            sent += self.sent
        return sent

    def enabled(self) -> PortBench:
        self.cycles(20)
        for word in (0x06, 0x07):
            self.cycles(2, word, mode=PP)
        assert (7, struct.pack("<Ixxxx", 8)) in self.cycles(1, 0x0F)
        self.state = 8
        self.cycles(30, 0x0F)
        assert self.cycle(0x0F) & 0x6F == 0x27
        return self


def test_a_word_that_stays_at_enable_operation_enables_nothing_again():
    talk = PortBench().enabled()
    talk.state = 1
    sent = talk.cycles(300, 0x0F)
    assert [data for command, data in sent if command == 7] == []
    assert talk.cycle(0x0F) & 0x4F == 0x40


@pytest.mark.parametrize("word", [0x00, 0x02, 0x06, 0x07])
def test_a_controlword_that_withdraws_the_enable_requests_idle(word):
    talk = PortBench()
    talk.cycles(20)
    talk.cycles(2, 0x06)
    talk.cycles(2, 0x07)
    talk.cycles(3, 0x0F)
    assert (7, struct.pack("<Ixxxx", 1)) in talk.cycles(1, word)
    talk.state = 8  # it came all the same
    assert (7, struct.pack("<Ixxxx", 1)) in talk.cycles(30, word)
    talk.state = 1
    talk.cycles(20, word)
    assert talk.cycle(word) & 0x04 == 0


def test_closed_loop_without_a_position_is_not_operation_enabled():
    talk = PortBench()
    talk.cycles(20)
    talk.cycles(2, 0x06)
    talk.cycles(2, 0x07)
    talk.cycles(1, 0x0F)
    talk.state = 8
    hear = talk.hear
    talk.hear = lambda command, data: None if command == 9 else hear(command, data)
    talk.cycles(50, 0x0F)
    assert talk.cycle(0x0F) & 0x6F == 0x23
    talk.hear = hear
    talk.cycles(2, 0x0F)
    assert talk.cycle(0x0F) & 0x6F == 0x27


def test_a_set_point_is_reached_by_a_heartbeat_received_after_it():
    talk = PortBench().enabled()
    for index, value in ((0x6081, COUNTS), (0x6083, COUNTS), (0x6084, COUNTS)):
        talk.port.objects.write(index, 0, value)
    while round(talk.now * 100) % 10 != 2:
        talk.cycle(0x0F)
    target = talk.inputs.position.value + 3 * COUNTS
    assert [command for command, _ in talk.cycles(1, 0x1F, target_position=target)] == [0x11, 0x12, 0x0C]
    assert talk.cycle(0x1F) & 0x1400 == 0x1000  # taken, and not reached: the heartbeat is of before
    talk.done = False
    talk.cycles(12, 0x0F)
    assert talk.cycle(0x0F) & 0x1400 == 0
    talk.done = True
    talk.cycles(12, 0x0F)
    assert talk.cycle(0x0F) & 0x1400 == 0x400


def test_a_set_point_without_velocity_or_ramp_is_not_taken():
    talk = PortBench().enabled()
    assert talk.cycles(5, 0x1F, target_position=5000) == []
    assert talk.cycle(0x1F) & 0x1000 == 0


@pytest.mark.parametrize("method", [0, 1, 17, 33])
def test_a_homing_that_would_move_is_an_error(method):
    talk = PortBench().enabled()
    talk.port.objects.write(0x6098, 0, method)
    talk.cycles(20, 0x0F, mode=HOMING)
    assert talk.cycles(1, 0x1F) == []
    assert talk.cycle(0x1F) & 0x3000 == 0x2000


def test_a_mode_that_there_is_not_is_not_shown():
    talk = PortBench().enabled()
    for mode in (2, 7, 9, 10, 11, -3):
        talk.cycles(3, 0x0F, mode=mode)
        assert talk.inputs.mode.value == PP


@pytest.mark.parametrize("turns", [0.25, -0.2, 12.0])
def test_zeros_of_a_module_that_switched_itself_off_do_not_replace_its_last_position(turns):
    talk = PortBench()
    talk.turns = turns
    talk.enabled()
    place = talk.inputs.position.value
    while round(talk.now * 100) % 10 != 2:
        talk.cycle(0x0F)
    talk.state = 1  # at once, and its heartbeat shows it later
    for _ in range(40):
        talk.cycle(0x0F)
        assert talk.inputs.position is None or abs(talk.inputs.position.value - place) <= 3


@pytest.mark.parametrize("life", [3, 100, 250])
def test_a_counter_that_does_not_continue_after_a_silence_is_a_restart(life):
    talk = PortBench()
    talk.life = life
    talk.cycles(30)
    assert talk.inputs.operational
    talk.now += 1.6
    talk.life = 0
    talk.beat()
    talk.cycle()
    assert not talk.inputs.operational
    assert talk.inputs.nmt == 127


@pytest.mark.parametrize("life", [3, 100, 250])
def test_a_life_counter_that_continues_after_a_silence_shows_no_restart(life):
    talk = PortBench()
    talk.life = life
    talk.cycles(30)
    talk.now += 1.6
    talk.cycle()
    assert talk.inputs.overdue
    assert not talk.inputs.operational
    talk.life = talk.life + 16 & 0xFF
    talk.beat()
    talk.cycle()
    assert talk.inputs.operational
    assert talk.port.hearing.missed == 16


def test_between_rare_counts_the_direction_that_fits_the_speed_is_used():
    place = RotorPosition(20.0)
    place.open()
    place.take_count(0, 0.0)
    place.take_estimate(0.0, 15.0, 0.01)
    place.take_estimate(0.15, 15.0, 0.02)
    place.shut()
    place.take_count(round(0.75 * COUNTS), 0.06)  # 0.6 turns on, or 0.4 back
    assert place.shown == pytest.approx(0.75 * COUNTS, abs=2)


def test_an_object_that_there_is_not_is_refused_with_its_code():
    talk = PortBench()
    talk.cycles(20)
    asked = (SdoRequest(1, 0x6099, 1, None), SdoRequest(2, 0x6041, 0, None), SdoRequest(3, 0x6085, 0, 5))
    talk.cycle(None, sdo=asked)
    talk.cycle()
    assert [(each.id, each.abort) for each in talk.inputs.sdo] == [
        (1, 0x0602_0000),
        (2, None),
        (3, 0x0601_0002),
    ]
    talk.cycle(
        None,
        sdo=(
            SdoRequest(4, 0x6082, 0, 5),
            SdoRequest(5, 0x6081, 0, -1),
            SdoRequest(6, 0x6085, 0, 40 * COUNTS),
        ),
    )
    talk.cycle()
    assert [each.abort for each in talk.inputs.sdo] == [0x0609_0030, 0x0609_0030, None]


@pytest.mark.parametrize("node", [-1, 64, True, 1.5])
def test_an_invalid_node_id_is_refused(node):
    with pytest.raises(ArgumentError, match="not a node ID"):
        replace(SETTINGS, node=node)


@pytest.mark.parametrize(
    "name", ["velocity_limit", "current_limit", "velocity_ramp", "acceleration", "period", "heartbeat"]
)
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_no_setting_is_zero_or_missing(name, value):
    with pytest.raises(ArgumentError, match=name):
        replace(SETTINGS, **{name: value})


def test_a_current_above_the_limit_of_the_module_is_refused():
    with pytest.raises(LimitError, match="current_limit"):
        replace(SETTINGS, current_limit=50.1)
    with pytest.raises(ArgumentError, match="constant"):
        TorqueSettings(0.0, 1.0, 1.0)


def _after_silence(life: int, next_life: int, silence: float) -> PortBench:
    """A module that was received with one life counter, and after a silence with another."""
    talk = PortBench()
    for place in range(3):
        talk.now += 0.1
        talk.life = life - 2 + place
        talk.beat()
    talk.now += silence
    talk.life = next_life & 0xFF
    talk.beat()
    return talk


@pytest.mark.parametrize("step", [1, 2, 4])
def test_heartbeats_that_this_computer_took_late_are_no_restart(step):
    """After 0.5 s in which the program did not run, the count of the first waiting one has advanced by one."""
    talk = _after_silence(100, 100 + step, 0.5)
    assert not talk.port.hearing.bootups
    talk.port.read(talk.now)
    assert talk.port.hearing.state == 5  # operational


@pytest.mark.parametrize(
    ("life", "next_life", "silence"),
    [
        (100, 0, 1.5),  # it restarted
        (100, 3, 1.5),
        (
            4,
            5,
            1.5,
        ),  # as of a module that had just started, and restarted: it cannot be distinguished from one that was delayed
        (100, 130, 0.5),  # it is ahead of the time that has passed
        (100, 90, 0.5),
    ],
)
def test_a_count_that_no_time_explains_is_a_restart(life, next_life, silence):
    talk = _after_silence(life, next_life, silence)
    assert talk.port.hearing.bootups == 1
    assert talk.port.hearing.bootup_stamp == talk.now


@pytest.mark.parametrize(("remote", "asked"), [(True, {True, False}), (False, {False})])
def test_without_remote_frames_the_module_is_asked_by_data_frames_alone(remote, asked):
    port = ModulePort(replace(SETTINGS, remote=remote))
    ways = set()
    now = 10.0
    for number in range(300):
        now += 0.01
        if number % 10 == 0:
            beat = struct.pack("<IBBBB", 0, 1, 0x80, 0, number // 10)
            port.receive(CanFrame(now, 5 << 5 | 1, beat), now)
        port.read(now)
        ways |= {each.remote for each in port.take_frames()}
    assert ways == asked


@pytest.mark.parametrize("speed", [0.0, 0.09, -3.0, 12.0])
@pytest.mark.parametrize("seed", range(5))
def test_counts_received_twice_or_late_do_not_distort_the_estimated_position(speed, seed):
    """Each count comes twice, as to two programs that ask; some are taken up to 20 ms late, in one go with those behind them."""
    chance = random.Random(seed)
    place, true, free, now = RotorPosition(fastest=20.0), 10.0, 0.0, 0.0
    place.velocity = speed  # as the last estimate had it
    for number in range(800):
        true = 10.0 + number * 0.01
        free = max(free, true + (chance.uniform(0.0, 0.02) if chance.random() < 0.2 else 0.0))
        for _ in range(2):
            now = max(now + 1e-6, free)
            place.take_count(
                (round((0.5 + speed * (true - 10.0)) * COUNTS) + chance.randint(-1, 1)) % COUNTS, now
            )
    assert place.shown == pytest.approx((0.5 + speed * (true - 10.0)) * COUNTS, abs=3)
    assert place.velocity == pytest.approx(speed, abs=0.3 * abs(speed) + 0.02)
