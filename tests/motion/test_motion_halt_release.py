"""Change the mode of a halted axis whose drive ignores 6060h while the halt bit (6040h bit 8) is set."""

from __future__ import annotations

import pytest

from axisbus.cia402.options import Ramp
from axisbus.cia402.port import ValueTransport
from axisbus.errors import AxisbusError, ModeError, UncommandedMotion
from axisbus.motion.modes import MODE_PROPERTIES, AfterHalt
from axisbus.motion.moves.halt_release import HaltRelease, after_halt
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.parameters import Handshake, HoldsLoad, HomingParameters
from axisbus.motion.states import AxisState
from axisbus.motion.stop.hold_setpoint import HoldSetPoint
from axisbus.motion.stop_deceleration import Braking
from axisbus.sim.fault_injection import NEVER
from kit.motion.plant_recorder import HALT, Watch
from kit.motion.rig import MODE, Rig, rig
from kit.motion.steps import Drive as Steps
from kit.motion.steps import T

BIT_4, BIT_12 = 0x10, 0x1000
ENABLED = 0x0627  # operation enabled, target reached
SEARCH = HomingParameters(method=33, speed_switch=5.0, speed_zero=5.0, acceleration=100.0)
NO_DEMAND = {"inputs": {"demand": ValueTransport.NONE}}
TAKES = 1.0  # seconds that a drive may take to change its mode
INTERRUPTED = {
    "pp": (1, lambda r: r.axis.move_absolute(300.0)),
    "pv": (3, lambda r: r.axis.move_velocity(50.0)),
    "hm": (6, lambda r: r.axis.home()),
}
NEXT = {
    "pp": (1, lambda r: r.axis.move_absolute(-10.0)),
    "pv": (3, lambda r: r.axis.move_velocity(-20.0)),
    "tq": (4, lambda r: r.axis.torque_control(-0.5)),
    "hm": (6, lambda r: r.axis.home(method=37)),
    "csp": (8, lambda r: r.group("x").move_linear([-10.0], velocity=50.0, acceleration=100.0)),
    "csv": (9, lambda r: r.axis.cyclic_velocity(-20.0)),
    "cst": (10, lambda r: r.axis.cyclic_torque(-0.5, slope=5.0)),
}
PAIRS = [(before, after) for before in INTERRUPTED for after in NEXT if before != after]


def halted(before: str = "pp", *, after: float = 0.4, **changes) -> tuple[Rig, Watch]:
    """An axis that was halted in the middle of a motion, on a drive that ignores 6060h meanwhile, and its witness from then on."""
    r = rig(homing=SEARCH, **changes).enabled()
    r.drive.dials.ignore_mode_during_halt = True
    mode, begin = INTERRUPTED[before]
    begin(r)
    r.run(after)
    r.axis.halt().wait(3)
    assert r.drive.controlword & HALT
    assert r.drive.mode_display == mode
    return r, Watch(r)


def words(watch: Watch) -> list[int]:
    return [sent.outputs.controlword for sent in watch.sent]


def fails(r: Rig, watch: Watch, text: str) -> None:
    """The next mode is refused, and the axis is still halted where it was."""
    with pytest.raises(ModeError) as told:
        r.axis.move_velocity(-20.0).wait(12)
    assert text in told.value.observed
    assert "must stay set" in told.value.observed
    assert "disable and enable" in told.value.remedy
    r.run(1.0)
    assert watch.displacement < 1.0
    assert all(word & HALT for word in words(watch))
    assert r.axis.state is AxisState.ERRORSTOP


# Every pair of modes.


@pytest.mark.parametrize(("before", "after"), PAIRS, ids=["-".join(pair) for pair in PAIRS])
@pytest.mark.parametrize("port", [None, NO_DEMAND], ids=["6062h", "no 6062h"])
def test_after_a_halt_the_next_mode_is_taken_without_the_halt_bit(before, after, port):
    r, watch = halted(before, port=port)
    mode, begin = NEXT[after]
    handle, here, began = begin(r), r.drive.axis.motor.position, r.now
    r.until(lambda: r.drive.mode_display == mode, TAKES + 2.0)
    assert r.now - began > TAKES
    assert abs(r.drive.axis.motor.position - here) < 1.0
    assert watch.displacement < 1.0  # the drive did not continue the halted motion
    handle.wait(5)
    assert watch.travel[1] < here + 1.0
    held = [sent for sent in watch.sent if sent.outputs.controlword & HALT]
    assert held[-1].t - began > TAKES
    requests = [sent.outputs.mode for sent in watch.sent if sent.t > held[-1].t]
    assert mode in requests  # once more, without the halt bit


@pytest.mark.parametrize(("before", "after"), PAIRS, ids=["-".join(pair) for pair in PAIRS])
def test_a_drive_that_takes_its_mode_under_halt_stays_halted_until_it_moves(before, after):
    r, watch = halted(before)
    r.drive.dials.ignore_mode_during_halt = False
    mode, begin = NEXT[after]
    handle = begin(r)
    assert r.until(lambda: r.drive.mode_display == mode, TAKES) < 0.2
    assert all(word & HALT for word in words(watch))
    assert not any(word & BIT_4 for word in words(watch))
    handle.wait(5)


@pytest.mark.parametrize("seconds", [0.5, 0.9])
def test_a_drive_that_takes_its_mode_late_stays_halted(seconds):
    r, watch = halted("pp")
    r.drive.dials.ignore_mode_during_halt = False
    r.drive.dials.mode_delay = seconds
    r.axis.move_velocity(-20.0)
    r.until(lambda: r.drive.mode_display == 3, TAKES)
    assert all(word & HALT for word in words(watch))
    assert not any(word & BIT_4 for word in words(watch))


def test_a_mode_that_is_taken_late_is_left_again_before_the_halt_ends():
    r, watch = halted("pp")
    r.drive.dials.ignore_mode_during_halt = False
    r.drive.dials.mode_delay = TAKES + 0.005
    r.axis.move_velocity(-20.0).wait(8)
    assert watch.displacement > 100
    r, watch = halted("pp")
    r.drive.dials.modes_refused = frozenset({3})
    with pytest.raises(ModeError, match="does not enter mode 3"):
        r.axis.move_velocity(-20.0).wait(8)
    r.run(0.5)
    assert watch.displacement < 1.0
    assert r.drive.controlword & HALT  # again


def test_a_halt_while_the_halt_bit_is_being_cleared():
    for pause in (0.5, 1.1, 1.2, 1.3, 1.4):
        r, watch = halted("pp")
        r.axis.move_velocity(-0.001)
        r.run(pause)
        r.axis.halt().wait(3)
        r.run(0.5)
        assert r.drive.controlword & HALT
        assert watch.displacement < 1.0
        r.axis.move_absolute(-10.0).wait(5)
        assert watch.travel[1] < watch.rows[0].position + 1.0


# The set-point at the present position.


@pytest.mark.parametrize("delay", [0.05, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("after", [0.05, 0.3])
def test_a_late_acknowledge_is_awaited_twice(delay, after):
    r = rig().enabled()
    r.drive.dials.ignore_mode_during_halt = True
    r.drive.dials.acknowledge_delay = delay
    r.axis.move_absolute(300.0)
    r.run(after)
    r.axis.halt().wait(3)
    watch = Watch(r)
    handle = r.axis.move_velocity(-20.0)
    r.until(lambda: r.drive.mode_display == 3, 6.0)
    assert watch.displacement < 1.0
    handle.wait(5)
    given = [sent.outputs for sent in watch.sent if sent.outputs.controlword & BIT_4]
    assert {outputs.target_position for outputs in given[-10:]} == {round(watch.rows[0].position)}


@pytest.mark.parametrize("delay", [1.05, 1.3, 1.6, 1.9])
def test_an_acknowledge_that_is_later_than_it_may_be_does_not_end_the_halt(delay):
    r = rig().enabled()
    r.drive.dials.ignore_mode_during_halt = True
    r.drive.dials.acknowledge_delay = delay
    r.axis.move_absolute(300.0)
    r.run(0.05)
    r.axis.halt().wait(3)
    fails(r, Watch(r), "does not accept its present position")


@pytest.mark.parametrize(
    "deaf", [{"acknowledge_never": True}, {"ignore_setpoint_during_halt": True}, {"acknowledge_delay": NEVER}]
)
def test_without_an_acknowledge_the_axis_stays_halted(deaf):
    r, watch = halted("pp")
    for dial, value in deaf.items():
        setattr(r.drive.dials, dial, value)
    fails(r, watch, "does not accept its present position")


def test_a_set_point_that_the_drive_has_limited_does_not_end_the_halt():
    r, watch = halted("pp")
    r.device.write(0x607D, 1, 60_000)  # the axis is outside, and would be moved to this limit
    r.device.write(0x607D, 2, 400_000)
    fails(r, watch, "does not accept its present position")


def test_with_an_acknowledge_that_proves_nothing_the_axis_stays_halted_within_a_move():
    r, watch = halted("pp", handshake=Handshake.ON_CHANGE)
    fails(r, watch, "on-change")
    assert not any(word & BIT_4 for word in words(watch))


def test_with_an_acknowledge_that_proves_nothing_an_axis_at_its_target_is_released():
    r = rig(handshake=Handshake.ON_CHANGE).enabled()
    r.drive.dials.ignore_mode_during_halt = True
    r.axis.move_absolute(10.0).wait(5)
    r.axis.halt().wait(3)
    watch = Watch(r)
    r.axis.move_velocity(-20.0).wait(5)
    assert not any(word & BIT_4 for word in words(watch))
    assert r.drive.mode_display == 3


@pytest.mark.parametrize("changes", [{}, {"handshake": Handshake.ON_CHANGE}], ids=["bit 12", "on-change"])
def test_after_the_axis_was_disabled_nothing_is_left_of_the_move(changes):
    r, watch = halted("pp", **changes)
    r.drive.dials.ignore_setpoint_during_halt = True
    fails(r, watch, "halt")
    r.axis.reset().wait(3)
    r.axis.disable().wait(3)
    r.axis.enable().wait(3)
    watch.forget()
    r.axis.move_velocity(-20.0).wait(5)
    assert watch.travel[1] < watch.rows[0].position + 1.0
    assert r.drive.mode_display == 3


def test_an_axis_that_moves_when_its_halt_ends_is_stopped():
    r, watch = halted("pp")
    mode = r.drive._mode
    start = mode._start  # the drive acknowledges under halt, and keeps its old target
    mode._start = lambda axis, point, *_: None if r.drive._halted else start(axis, point)
    r.drive.dials.modes_refused = frozenset({3})
    with pytest.raises(UncommandedMotion) as told:
        r.axis.move_velocity(-20.0).wait(5)
    assert "its halt bit was cleared" in told.value.observed
    r.run(1.0)
    assert abs(r.drive.axis.motor.velocity) < 1.0
    assert watch.displacement < 2_000


@pytest.mark.parametrize("after", ["pp", "hm", "csp", "csv", "cst"])
def test_after_a_halt_under_torque_the_next_mode_is_taken_without_the_halt_bit(after):
    r = rig(braking=Braking(quick_stop=Ramp.QUICK)).enabled()
    r.drive.dials.ignore_mode_during_halt = True
    r.axis.torque_control(0.5)
    r.run(0.4)
    r.axis.halt().wait(8)
    assert (r.drive.mode_display, bool(r.drive.controlword & HALT)) == (4, True)
    watch = Watch(r)
    mode, begin = NEXT[after]
    handle = begin(r)
    r.until(lambda: r.drive.mode_display == mode, TAKES + 2.0)
    assert watch.displacement < 1.0
    assert {sent.outputs.target_torque for sent in watch.sent} <= {0, None}
    handle.wait(5)


# Step by step.


class Halted:
    """A drive under halt in ``mode``, and the release of its halt bit, cycle by cycle."""

    def __init__(self, mode: int, position: int = 700, **changes) -> None:
        self.drive = Steps(**changes)
        self.say = {"statusword": ENABLED, "mode": mode, "position": position, "torque": 0}
        self.drive.order.halt = True
        image, _ = self.drive.cycle(**self.say)
        self.release = HaltRelease(image, self.drive.parameters, image.now)

    def cycle(self, **say) -> tuple[bool, int]:
        """One cycle: whether the halt is over for the drive, and bit 8 and bit 4 of the word that is sent."""
        self.say |= say
        image, order = self.drive.cycle(**self.say)
        order.halt = True
        order.goal = image.state
        order.target_position = self.say["position"]
        done = self.release.step(image, order)
        for request in order.sdo:
            self.drive.answers(request.id)
        return done, order.controlword(image.state) & (HALT | BIT_4)

    def cycles(self, count: int, **say) -> list[tuple[bool, int]]:
        return [self.cycle(**say) for _ in range(count)]

    def until(self, word: int, limit: int = 400) -> int:
        """The cycles until bits 8 and 4 are ``word``."""
        for count in range(limit):
            if self.cycle()[1] == word:
                return count
        raise AssertionError(f"0x{word:03X} was not sent within {limit} cycles")


@pytest.mark.parametrize("mode", [3, 4, 8, 9, 10])
def test_a_target_at_standstill_is_all_that_the_halt_bit_waits_for(mode):
    halt = Halted(mode)
    cycles = halt.until(0)
    assert cycles * T < 0.3
    assert [done for done, _ in halt.cycles(4)] == [False, False, True, True]
    assert halt.release.done


@pytest.mark.parametrize(("mode", "torque"), [(4, 0), (10, 0), (3, 30)])
def test_no_torque_acts_when_the_halt_ends(mode, torque):
    halt = Halted(mode)
    for step in (halt.release.step, halt.release.watch):
        image, order = halt.drive.cycle(**halt.say)
        order.target_torque = 30
        step(image, order)
        assert order.target_torque == torque


def test_an_interrupted_homing_must_be_reported():
    halt = Halted(6)
    assert {word for _, word in halt.cycles(60, statusword=ENABLED & ~0x400)} == {HALT}
    halt.say["statusword"] = ENABLED
    assert halt.until(0) * T < 0.3
    halt = Halted(6)
    halt.cycles(200, statusword=ENABLED & ~0x400)
    assert "homing is interrupted" in halt.release.refusal


def test_the_old_acknowledge_must_have_had_its_time_before_the_set_point_is_given():
    halt = Halted(1)
    since = halt.drive.now
    halt.until(HALT | BIT_4)
    waited = halt.drive.now - since
    assert halt.drive.parameters.timing.acknowledge <= waited < halt.drive.parameters.timing.acknowledge + 0.1


def test_one_acknowledge_of_an_earlier_set_point_does_not_end_the_halt():
    halt = Halted(1)
    halt.until(HALT | BIT_4)
    halt.cycles(3, statusword=ENABLED | BIT_12)  # of the earlier edge
    assert halt.cycles(3, statusword=ENABLED)[-1] == (False, HALT | BIT_4)  # the second edge
    assert {word for _, word in halt.cycles(30)} == {HALT | BIT_4}
    halt.cycles(3, statusword=ENABLED | BIT_12)
    halt.say["statusword"] = ENABLED
    assert halt.until(0) * T < 0.3


def test_a_drive_that_leaves_its_mode_gets_no_bit_4():
    halt = Halted(1)
    halt.until(HALT | BIT_4)
    assert halt.cycle(mode=6) == (False, HALT)
    assert "does not keep" in halt.release.refusal
    assert halt.cycles(3, mode=1)[-1] == (False, HALT)


def test_a_drive_that_does_not_confirm_its_mode_stays_halted():
    halt = Halted(1)
    halt.cycles(200, mode=6)
    assert "does not confirm" in halt.release.refusal


def test_an_axis_that_is_not_at_standstill_stays_halted():
    halt = Halted(3)
    for position in range(700, 5_000, 20):
        assert halt.cycle(position=position)[1] == HALT
    assert "not seen at standstill" in halt.release.refusal
    assert "still moving" in halt.release.refusal


def test_without_a_position_there_is_no_set_point():
    halt = Halted(1, position=None)
    assert {word for _, word in halt.cycles(600)} == {HALT}
    assert "does not accept its present position" in halt.release.refusal


def test_queued_transfers_are_cancelled():
    halt = Halted(1)
    since = halt.drive.now
    while halt.drive.now < since + halt.drive.parameters.timing.acknowledge:
        image, order = halt.drive.cycle(**halt.say)
        order.halt = True
        halt.release.step(image, order)
    [asked] = order.sdo
    assert (asked.index, asked.value) == (0x6081, 1)
    halt.release.cancel(order)
    assert order.cancel == [asked.id]


@pytest.mark.parametrize(
    ("mode", "load", "left"),
    [
        (1, HoldsLoad.BRAKE, AfterHalt.SET_POINT),
        (3, HoldsLoad.TORQUE, AfterHalt.TARGET),
        (4, HoldsLoad.NO, AfterHalt.TARGET),
        (4, HoldsLoad.BRAKE, None),
        (10, HoldsLoad.TORQUE, None),
        (6, HoldsLoad.NO, AfterHalt.SEARCH),
        (2, HoldsLoad.NO, None),
        (0, HoldsLoad.NO, None),
        (-3, HoldsLoad.NO, None),
        (None, HoldsLoad.NO, None),
    ],
)
def test_the_remains_of_a_halted_motion_by_mode(mode, load, left):
    drive = Steps(holds_load=load)
    image, _ = drive.cycle(statusword=ENABLED, mode=mode, position=0)
    assert after_halt(image, drive.parameters) is left
    assert bool(HaltRelease(image, drive.parameters, image.now).refusal) is (left is None)


@pytest.mark.parametrize(
    ("seen", "idle"),
    [
        ("found enabled in pp", False),
        ("pp, off, pp", True),
        ("pp, off, pp, set-point", False),
        ("pp, set-point, off, pp", True),
        ("pp, quick stop, pp", False),  # it has kept its power
        ("pv, pp", True),
        ("pv, pp, set-point", False),
        ("pp, set-point, pv, pp", True),
    ],
)
def test_when_the_master_knows_that_the_drive_has_no_set_point(seen, idle):
    drive = Steps()
    words = {"off": 0x0250, "quick stop": 0x0207}
    for step in seen.split(", "):
        mode = 3 if step == "pv" else 1
        image, _ = drive.cycle(statusword=words.get(step, ENABLED), mode=mode, position=0)
        image.reference_tracker.note(image.now, mode, None, 500, step == "set-point")
    assert image.reference_tracker.idle is idle


def test_every_mode_defines_the_remains_of_a_halted_motion():
    left = {mode: conduct.after_halt for mode, conduct in MODE_PROPERTIES.items()}
    assert left.pop(MODE.PROFILE_POSITION) is AfterHalt.SET_POINT
    assert left.pop(MODE.HOMING) is AfterHalt.SEARCH
    assert left.pop(MODE.VELOCITY) is left.pop(MODE.CYCLIC_SYNC_TORQUE_ANGLE) is None
    assert set(left.values()) == {AfterHalt.TARGET}


def test_an_axis_without_halt_bit_is_not_released():
    drive = Steps()
    switch = ModeSwitch(MODE.PROFILE_VELOCITY, drive.parameters)
    with pytest.raises(AxisbusError) as told:
        while True:
            assert not switch.step(*drive.cycle(statusword=ENABLED, mode=1, position=0))
    assert drive.now < 10.0 + drive.parameters.timing.mode + 3 * T
    assert "halt bit" not in str(told.value)


def test_a_hold_set_point_waits_for_the_handshake_of_the_interrupted_move():
    drive = Steps()
    hold = HoldSetPoint(700, drive.parameters)
    hold.step(*drive.cycle(statusword=ENABLED, mode=1, position=700))
    drive.answers(drive.order.sdo[0].id)
    for word in (ENABLED, ENABLED, ENABLED | BIT_12):  # the acknowledge of the interrupted move
        image, order = drive.cycle(statusword=word, mode=1, position=700)
        order.bits = BIT_4
        assert not hold.step(image, order)
        assert order.target_position is None
    for word in (ENABLED | BIT_12, ENABLED, ENABLED | BIT_12):
        assert not hold.step(*drive.cycle(statusword=word, mode=1, position=700))
    assert hold.step(*drive.cycle(statusword=ENABLED, mode=1, position=700))


@pytest.mark.parametrize(
    "stop", [lambda axis: axis.halt(), lambda axis: axis.disable(), lambda axis: axis.stop()]
)
@pytest.mark.parametrize("after", ["pv", "hm", "csp", "csv", "cst"])
def test_a_stop_awaits_the_acknowledge_of_the_present_position(after, stop):
    r, watch = halted("pp")
    r.drive.dials.acknowledge_delay = 0.03
    NEXT[after][1](r)
    r.until(lambda: bool(r.drive.controlword & BIT_4))
    stop(r.axis)
    r.until(lambda: bool(r.drive.statusword & BIT_12), 0.1)
    assert r.drive.controlword & BIT_4
    r.run(0.5)
    assert not r.drive.controlword & BIT_4
    assert watch.displacement < 1.0
