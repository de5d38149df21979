"""Invariants of one axis for any commands and any behaviour of its drive: random commands against a hand-written drive."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import (
    INPUT_OBJECTS,
    OUTPUT_OBJECTS,
    Capabilities,
    Inputs,
    Outputs,
    Sample,
    SdoReply,
    ValueTransport,
)
from axisbus.errors import Replaced
from axisbus.motion import commands as c
from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.moves.coast_and_reset import Coast
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.moves.homing import HomingJob
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.parameters import DriveTimeouts, HomingParameters, StopTimes, Units
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.units import Scale
from kit.motion.rig import GENERIC, dictionary_of, parameters
from kit.motion.tiny_drive import CSP, HM, PP, PV, TQ, TinyDrive, state_of

PERIOD = 0.01
AGE = 0.1  # seconds that an input counts
WINDOW = 20  # increments in which a move ends
BRAKED = 20  # cycles after which an axis without messages must be off: the age of its statusword, and some
GIVEN_UP = 80  # the same while it is being enabled: the time of one transition more
ONE = Scale.of(1, "inc")
MAY_MOVE = {
    AxisState.HOMING,
    AxisState.STOPPING,
    AxisState.ERRORSTOP,
    AxisState.DISCRETE_MOTION,
    AxisState.CONTINUOUS_MOTION,
    AxisState.SYNCHRONIZED_MOTION,
}
TIMES = DriveTimeouts(transition=0.5, mode=0.3, acknowledge=0.3, sdo=0.5, progress=0.5, diagnosis=0.1)


TEMPERS = ("refuses_mode", "ignores_set_points", "keeps_acknowledge", "blocked")
PAUSE = st.sampled_from([0, 1, 2, 4, 12, 40])  # cycles after a command


def make_core(resting: int | None) -> AxisCore:
    """An axis in increments with short times; ``resting``: the only mode that its drive claims."""
    base = parameters("x", dictionary_of(GENERIC))
    return AxisCore(
        replace(
            base,
            units=Units(ONE, ONE, ONE, ratio_known=True, rated_torque=1.0),
            limits=replace(base.limits, velocity=None),
            timing=TIMES,
            stop_times=StopTimes(0.3, 0.3, 0.5),
            homing=HomingParameters(method=37),
            modes=base.modes if resting is None else frozenset({ModeOfOperation(resting)}),
        ),
        Capabilities(
            dict.fromkeys(INPUT_OBJECTS, ValueTransport.SYNC_PDO),
            dict.fromkeys(OUTPUT_OBJECTS, ValueTransport.SYNC_PDO),
            True,
            dict.fromkeys(INPUT_OBJECTS, AGE),
        ),
    )


class AxisUnderFire(RuleBasedStateMachine):
    """Random commands and faults; every cycle's outputs, and every handle that ends, are checked against the rules."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        self.handles: list[tuple[c.Command, WithTarget]] = []
        self.outputs = Outputs()
        self.inputs = Inputs(0.0, True, None, None, None, None, None, None)
        self.replies: list[SdoReply] = []
        self.words: list[int] = [0, 0, 0]
        self.state = AxisState.DISABLED
        self.was_running: set[type] = set()
        self.stop_sequence = None
        self.commanded = False
        self.enables: list[WithTarget] = []  # those that ran when the last outputs were made
        self.enabled_by: WithTarget | None = None  # the enable under which the drive was enabled last
        self.locked = False
        self.late = self.lateness = 0.0  # of the next cycle and of this one
        self.edge_at = 0.0
        self.unheard = 0
        self.heal()

    def heal(self) -> None:
        self.silent = False  # no TPDO comes
        self.operational = True
        self.sdo_works = True

    def heal_drive(self) -> None:
        for what in TEMPERS:
            setattr(self.drive, what, False)

    @initialize(
        holds=st.booleans(),
        lazy=st.integers(0, 4),
        resting=st.sampled_from([None, None, None, PV, TQ, CSP]),
        mode=st.sampled_from([0, PP, PV, TQ, HM, CSP, 10]),
        position=st.integers(-1000, 1000),
        stale=st.tuples(st.integers(-5000, 5000), st.integers(-900, 900), st.integers(-900, 900)),
        found=st.sampled_from(["disabled", "disabled", "disabled", "disabled", "enabled", "fault", "ready"]),
        enabled=st.booleans(),
    )
    def power_on(self, holds, lazy, resting, mode, position, stale, found, enabled) -> None:
        self.core = make_core(resting)
        self.drive = TinyDrive(holds=holds, mode=mode, position=position, stale=stale)
        self.drive.state, self.drive.lazy = found, lazy
        self.cycles(3)
        if enabled:
            self.submit(c.EnableCommand())
            self.cycles(15)

    # -- time ----------------------------------------------------------------------------------------------------------

    def cycles(self, count: int) -> None:
        for _ in range(count):
            self.cycle()

    def cycle(self) -> None:
        self.lateness, self.late = self.late, 0.0
        self.now += PERIOD + self.lateness
        position, transitions = self.drive.position, len(self.drive.transitions)
        self.drive.take(self.outputs)
        self.serve_sdo(self.outputs)
        self.drive.step(PERIOD + self.lateness)
        self.check_drive(self.drive.transitions[transitions:], position)
        self.inputs = self.sample()
        self.stop_sequence = self.core.stop_sequence  # this and the commands may end in this very cycle
        self.was_running = {type(command) for command, _ in self.handles}
        self.enables = [handle for command, handle in self.handles if isinstance(command, c.EnableCommand)]
        self.outputs = self.core.step(self.inputs)
        self.stop_sequence = self.core.stop_sequence or self.stop_sequence
        kept = self.drive.state == "enabled" and self.core.state is not AxisState.ERRORSTOP
        self.locked = self.locked and kept
        self.state = self.core.state  # the one that these outputs were made in
        self.check_outputs(self.outputs)
        if self.outputs.controlword is not None:
            self.words.append(self.outputs.controlword)
        self.check_ends()

    def sample(self) -> Inputs:
        drive, now, old = self.drive, self.now, self.inputs
        replies, self.replies = tuple(self.replies), []
        nmt = 5 if self.operational else 4
        if self.silent or not self.operational:
            return old._replace(now=now, operational=self.operational, sdo=replies, nmt=nmt, emcy=())
        return Inputs(
            now,
            True,
            Sample(drive.statusword, now),
            Sample(drive.mode_display, now),
            Sample(drive.position, now),
            Sample(drive.velocity, now),
            Sample(drive.torque, now),
            Sample(drive.position, now),
            (),
            replies,
            nmt,
        )

    def serve_sdo(self, outputs: Outputs) -> None:
        for request in outputs.sdo:
            if not self.sdo_works:
                continue
            self.replies.append(SdoReply(request.id, self.drive.serve(*request[1:]), None))

    # -- the rules of every cycle --------------------------------------------------------------------------------------

    @property
    def seen(self) -> str:
        """The state that the core may know of: by this test's own reckoning of ages."""
        sample = self.inputs.statusword
        oldest = self.now - AGE - self.lateness - 1e-9
        return "unknown" if sample is None or sample.stamp < oldest else state_of(sample.value)

    def running(self, kind: type) -> bool:
        """Whether such a command ran when this cycle began."""
        return kind in self.was_running

    def check_outputs(self, outputs: Outputs) -> None:
        word, seen = outputs.controlword, self.seen
        if not self.commanded:
            assert outputs == Outputs(sdo=outputs.sdo, cancel=outputs.cancel)
            assert all(request.value is None for request in outputs.sdo)
        if outputs.nmt_stop:
            assert self.stop_sequence.level == 3
        if word is None:
            return
        assert not word & 0b10_0100_0000, "bits 6 and 9 are never used"
        if seen == "unknown":
            assert word & ~0x0100 in (0x02, 0x00), f"controlword 0x{word:04X} into the unknown"
            # only a stop, or the power off that was asked for without one
            assert self.stop_sequence is not None or (not word & ~0x0100 and self.running(c.Disable))
        if word & 0x8F == 0x0F:
            may = seen == "enabled" or (
                self.running(c.EnableCommand) and seen in ("switched on", "quick stop")
            )
            assert may, f"0x{word:04X} in {seen}"
        if not word & 0b0010 and seen == "enabled":
            coasting = any(isinstance(x, c.Disable) and x.coast for x, handle in self.handles if handle.busy)
            assert coasting or self.stop_sequence.level >= 2, "disable voltage lets the motor coast"
        self.check_reset(word, seen)
        self.check_mode_bits(word, seen)

    def check_reset(self, word: int, seen: str) -> None:
        if not word & 0x80:
            return
        assert word == 0x80
        assert seen == "fault"
        assert self.running(c.ResetCommand)
        if not self.words[-1] & 0x80:
            assert not self.words[-2] & 0x80, "the edge came before the drive could see the low bit"

    def check_mode_bits(self, word: int, seen: str) -> None:
        before, mode = self.words[-1], self.inputs.mode.value
        if word & 0x30:
            assert seen == "enabled"
            assert mode == PP or (mode == HM and not word & 0x20 and self.running(c.Home))
        if mode != PP or seen != "enabled":
            return
        acknowledged = self.inputs.statusword.value & 0x1000
        if word & 0x10 and not before & 0x10:
            assert not acknowledged, "a new edge before the old acknowledge has fallen"
            self.edge_at = self.now
        halted = self.stop_sequence is not None and self.stop_sequence.level == 0
        kept = word & 0x0F == 0x0F  # where the power is being taken down, the set-point is void
        moves = halted or isinstance(self.core.activity, PositionMove)
        if before & 0x10 and not word & 0x10 and kept and moves:
            assert acknowledged or self.now - self.edge_at > TIMES.acknowledge, (
                "nobody knows if the edge was seen"
            )

    def check_drive(self, transitions: list[int], position: int) -> None:
        """The behaviour of the drive in this cycle, with the outputs of the previous one."""
        if 4 in transitions or 16 in transitions:
            assert self.enables, "enabled without a command to"
            assert self.enables[-1] is not self.enabled_by, "enabled a second time by the same command"
            self.enabled_by = self.enables[-1]
        if self.drive.position != position and self.commanded:
            assert self.state in MAY_MOVE, f"it moves in {self.state}"
        self.unheard = self.unheard + 1 if self.silent and self.operational and self.commanded else 0
        if self.unheard > (GIVEN_UP if isinstance(self.core.activity, EnableActivity) else BRAKED):
            assert self.drive.velocity == 0
            assert self.drive.state != "enabled", "left enabled although nothing is heard of it"

    # -- the rules of every end ----------------------------------------------------------------------------------------

    def check_ends(self) -> None:
        for command, handle in self.handles:
            if not handle.busy:
                self.check_end(command, handle)
        self.handles = [(command, handle) for command, handle in self.handles if handle.busy]

    def check_end(self, command: c.Command, handle: WithTarget) -> None:
        error = handle.error
        if isinstance(command, c.Disable | c.Shutdown) and command != c.Disable(coast=True):
            coasts = isinstance(self.core.activity, Coast)
            assert coasts or not isinstance(error, Replaced), "a motion must not undo it"
            if error is None and self.core.touched:
                assert self.drive.state not in ("enabled", "quick stop", "reaction"), command
        if error is not None:
            assert error.message
            return
        if isinstance(command, c.EnableCommand):
            assert self.seen == "enabled"
        elif isinstance(command, c.Move):
            assert abs(self.inputs.position.value - handle.target) <= WINDOW
        elif isinstance(command, c.Home):
            assert self.core.homed
            assert self.drive._home_found
        elif isinstance(command, c.Halt | c.Stop | c.QuickStop) and self.commanded:
            assert self.drive.velocity == 0

    @invariant()
    def an_error_is_reported_in_errorstop(self) -> None:
        if not hasattr(self, "core"):
            return
        core = self.core
        assert (core.state is AxisState.ERRORSTOP) == (core.error is not None)
        if core.error is not None:
            assert core.error.message
            assert len(core.error.observed) < 3000

    @invariant()
    def only_a_powered_axis_is_in_motion(self) -> None:
        if not hasattr(self, "core"):
            return
        core = self.core
        if core.touched and core.state in MAY_MOVE - {AxisState.ERRORSTOP, AxisState.STOPPING}:
            assert core.powered or isinstance(core.activity, EnableActivity) or core.stop_sequence is not None

    @invariant()
    def stop_locks_until_release(self) -> None:
        if self.locked:
            assert self.core.state not in MAY_MOVE - {AxisState.STOPPING, AxisState.ERRORSTOP}
            assert self.core.state is not AxisState.STANDSTILL

    # -- commands of users ---------------------------------------------------------------------------------------------

    def submit(self, command: c.Command, cycles: int = 0) -> None:
        handle = WithTarget(type(command).__name__)
        accept(self.core, command, handle)
        handle.target = self.core.last_target
        self.handles.append((command, handle))
        self.commanded = self.core.touched
        self.note_lock(command)
        self.check_ends()
        self.cycles(cycles)

    def note_lock(self, command: c.Command) -> None:
        if isinstance(command, c.Stop) and self.core.state is AxisState.STOPPING:
            self.locked = True
        elif isinstance(command, c.Release | c.Disable | c.Shutdown | c.QuickStop):
            self.locked = False

    @rule(count=st.integers(1, 60))
    def time_passes(self, count) -> None:
        self.cycles(count)

    @rule(cycles=PAUSE)
    def enable(self, cycles) -> None:
        self.submit(c.EnableCommand(), cycles)

    @rule()
    def recover(self) -> None:
        """All is well again, and the user resets and enables."""
        self.heal()
        self.heal_drive()
        self.cycles(80)
        self.submit(c.ResetCommand(), 12)
        self.submit(c.Release())
        self.submit(c.EnableCommand(), 20)

    @rule(coast=st.booleans(), cycles=PAUSE)
    def disable(self, coast, cycles) -> None:
        self.submit(c.Disable(coast), cycles)

    @rule(
        command=st.sampled_from(
            [
                c.ResetCommand(),
                c.Halt(),
                c.Stop(),
                c.Release(),
                c.QuickStop(),
                c.PolicyStop("another axis failed"),
            ]
        ),
        cycles=PAUSE,
    )
    def stop_or_so(self, command, cycles) -> None:
        self.submit(command, cycles)

    @rule(quick=st.booleans(), cycles=PAUSE)
    def leave(self, quick, cycles) -> None:
        self.submit(c.Shutdown("test", quick), cycles)

    @rule(reference=st.sampled_from(list(c.TargetReference)), value=st.integers(-800, 800), cycles=PAUSE)
    def move(self, reference, value, cycles) -> None:
        self.submit(c.Move(reference, value, MoveProfile(1000, 10_000, 10_000, 1000.0, 10_000.0)), cycles)

    @rule(velocity=st.integers(-500, 500), life=st.sampled_from([None, 0.2]), cycles=PAUSE)
    def move_velocity(self, velocity, life, cycles) -> None:
        self.submit(
            c.MoveVelocity(MoveProfile(velocity, 10_000, 10_000, abs(velocity), 10_000.0), life), cycles
        )

    @rule(torque=st.integers(-300, 300), cycles=PAUSE)
    def torque(self, torque, cycles) -> None:
        self.submit(c.TorqueControl(torque, None, 0.5), cycles)

    @rule(cycles=PAUSE)
    def home(self, cycles) -> None:
        self.submit(c.Home(HomingJob(37, None, None, None, 1.0)), cycles)

    @rule(position=st.integers(-500, 500))
    def set_position(self, position) -> None:
        self.submit(c.SetPosition(position))

    @rule(way=st.integers(-300, 300), velocity=st.sampled_from([100.0, 1000.0]), cycles=PAUSE)
    def follow(self, way, velocity, cycles) -> None:
        image = self.core.image
        here = (image.reference or 0) - image.origin
        self.submit(c.FollowTrajectory(TrapezoidalTrajectory(here, here + way, velocity, 5000.0)), cycles)

    # -- events --------------------------------------------------------------------------------------------------------

    @rule()
    def fault(self) -> None:
        self.locked = False
        self.drive.fail()

    @rule()
    def supply_drops(self) -> None:
        self.locked = False
        self.drive.drop()

    @rule(count=st.sampled_from([3, 12, 60, 250]))
    def tpdos_stop(self, count) -> None:
        self.locked = False
        self.silent = True
        self.cycles(count)
        self.silent = False

    @rule(count=st.integers(1, 60))
    def the_node_is_not_operational(self, count) -> None:
        self.locked = False
        self.operational = False
        self.cycles(count)
        self.operational = True

    @rule(count=st.sampled_from([5, 80]))
    def sdo_is_not_answered(self, count) -> None:
        self.sdo_works = False
        self.cycles(count)
        self.sdo_works = True

    @rule(
        what=st.sampled_from(TEMPERS),
        count=st.sampled_from([5, 100]),
    )
    def the_drive_is_stubborn(self, what, count) -> None:
        setattr(self.drive, what, True)
        self.cycles(count)
        setattr(self.drive, what, False)

    @rule(seconds=st.sampled_from([0.005, 0.05, 0.2, 1.0]))
    def the_program_is_late(self, seconds) -> None:
        self.locked = self.locked and seconds < 0.2
        self.late = seconds
        self.cycle()

    # -- cases that are rare by chance ---------------------------------------------------------------------------------

    @precondition(lambda self: self.core.activity is not None)
    @rule(command=st.sampled_from([c.Halt(), c.Disable(), c.Stop(), c.QuickStop()]), cycles=PAUSE)
    def interrupt(self, command, cycles) -> None:
        self.submit(command, cycles)

    @precondition(lambda self: isinstance(self.core.activity, PositionMove))
    @rule(value=st.integers(-800, 800), cycles=st.integers(0, 8))
    def another_move(self, value, cycles) -> None:
        self.move.__wrapped__(self, c.TargetReference.ABSOLUTE, value, cycles)

    @precondition(lambda self: self.core.stop_sequence is not None)
    @rule(
        command=st.sampled_from(
            [
                c.Disable(),
                c.EnableCommand(),
                c.Halt(),
                c.QuickStop(),
                c.Release(),
                c.ResetCommand(),
                c.Shutdown("test"),
            ]
        ),
        cycles=PAUSE,
    )
    def during_a_stop(self, command, cycles) -> None:
        self.submit(command, cycles)

    @precondition(lambda self: self.core.powered)
    @rule()
    def stop_and_stay(self) -> None:
        self.submit(c.Stop(), 12)

    @precondition(lambda self: self.locked)
    @rule(
        command=st.sampled_from([c.Halt(), c.EnableCommand(), c.ResetCommand(), c.PolicyStop("another")]),
        cycles=PAUSE,
    )
    def in_stopping(self, command, cycles) -> None:
        self.submit(command, cycles)

    @rule()
    def held_in_errorstop(self) -> None:
        """Enabled, and refused the mode for homing."""
        self.recover.__wrapped__(self)
        self.drive.refuses_mode = True
        self.submit(c.Home(HomingJob(37, None, None, None, 1.0)), 60)
        self.drive.refuses_mode = False

    @precondition(lambda self: self.core.powered)
    @rule(pause=st.integers(1, 12), cycles=PAUSE)
    def home_after_a_set_point_that_was_not_taken(self, pause, cycles) -> None:
        self.drive.ignores_set_points = True
        self.move.__wrapped__(self, c.TargetReference.RELATIVE, 300, pause)
        self.submit(c.Halt(), 12)
        self.drive.ignores_set_points = False
        self.home.__wrapped__(self, cycles)

    # -- the end -------------------------------------------------------------------------------------------------------

    def teardown(self) -> None:
        """Once the drive behaves again, every command comes to an end, and leaving switches the axis off."""
        if not hasattr(self, "core"):
            return
        self.heal()
        self.heal_drive()
        self.until_all_ended(600)
        self.submit(c.Shutdown("the test is over"))
        self.until_all_ended(300)
        self.cycles(2)
        if self.commanded:
            assert self.drive.state in ("disabled", "fault")
            assert self.drive.velocity == 0

    def until_all_ended(self, count: int) -> None:
        for _ in range(count):
            if not self.handles:
                return
            self.cycle()
        raise AssertionError(f"these have not ended: {self.handles}")


class WithTarget(CommandStatus):
    """A ticket that remembers where its move was to end."""

    target: int | None = None


AxisUnderFire.TestCase.settings = settings(
    max_examples=300, stateful_step_count=40, deadline=None, derandomize=True, phases=(Phase.generate,)
)
TestAxisUnderFire = AxisUnderFire.TestCase
TestAxisUnderFire.pytestmark = [pytest.mark.timeout(120)]
