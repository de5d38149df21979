"""What must hold of one axis whatever is asked of it and whatever its drive does: random commands against a hand-written drive."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from rig import GENERIC, dictionary_of, parameters
from tiny_drive import CSP, HM, PP, PV, TQ, TinyDrive, state_of

from axisbus.cia402.port import (
    INPUT_OBJECTS,
    OUTPUT_OBJECTS,
    Capabilities,
    Inputs,
    Outputs,
    Sample,
    SdoReply,
    Source,
)
from axisbus.motion import commands as c
from axisbus.motion.accept import accept
from axisbus.motion.core import AxisCore
from axisbus.motion.handle import NOBODY, Handle
from axisbus.motion.homing import HomingJob
from axisbus.motion.parameters import Homing, StopTimes, Timing, Units
from axisbus.motion.profile import Profile
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import Trapezoid
from axisbus.units import Scale

PERIOD = 0.01
AGE = 0.1  # seconds that an input counts
ONE = Scale.of(1, "inc")
MAY_MOVE = {
    AxisState.HOMING,
    AxisState.STOPPING,
    AxisState.ERRORSTOP,
    AxisState.DISCRETE_MOTION,
    AxisState.CONTINUOUS_MOTION,
    AxisState.SYNCHRONIZED_MOTION,
}
TIMES = Timing(transition=0.5, mode=0.3, acknowledge=0.3, sdo=0.5, progress=0.5, diagnosis=0.1)


def make_core() -> AxisCore:
    base = parameters("x", dictionary_of(GENERIC))
    return AxisCore(
        replace(
            base,
            units=Units(ONE, ONE, ONE, ratio_known=True, rated_torque=1.0),
            limits=replace(base.limits, velocity=None),
            timing=TIMES,
            stop_times=StopTimes(0.3, 0.3, 0.5),
            homing=Homing(method=37),
        ),
        Capabilities(
            dict.fromkeys(INPUT_OBJECTS, Source.SYNC_PDO),
            dict.fromkeys(OUTPUT_OBJECTS, Source.SYNC_PDO),
            True,
            dict.fromkeys(INPUT_OBJECTS, AGE),
        ),
    )


class AxisUnderFire(RuleBasedStateMachine):
    """Random commands and mishaps; every cycle's outputs are held against the rules."""

    def __init__(self) -> None:
        super().__init__()
        self.core = make_core()
        self.now = 0.0
        self.handles: list[tuple[c.Command, Handle]] = []
        self.silent = False  # no TPDO comes
        self.operational = True
        self.sdo_works = True
        self.outputs = Outputs()
        self.inputs = Inputs(0.0, True, None, None, None, None, None, None)
        self.replies: list[SdoReply] = []
        self.last_word: int | None = None
        self.commanded = False
        self.late = 0.0

    @initialize(
        holds=st.booleans(),
        mode=st.sampled_from([0, PP, PV, TQ, HM, CSP, 10]),
        position=st.integers(-1000, 1000),
        stale=st.tuples(st.integers(-5000, 5000), st.integers(-900, 900), st.integers(-900, 900)),
        found=st.sampled_from(["disabled", "disabled", "enabled", "fault", "ready"]),
    )
    def power_on(self, holds, mode, position, stale, found) -> None:
        self.drive = TinyDrive(holds=holds, mode=mode, position=position, stale=stale)
        self.drive.state = found
        self.cycles(3)

    # -- time ----------------------------------------------------------------------------------------------------------

    def cycles(self, count: int) -> None:
        for _ in range(count):
            self.cycle()

    def cycle(self) -> None:
        self.now += PERIOD + self.late
        state_before, position_before = self.core.state, self.drive.position
        transitions_before = len(self.drive.transitions)
        self.drive.take(self.outputs)
        self.serve_sdo(self.outputs)
        self.drive.step(PERIOD + self.late)
        self.check_drive(transitions_before, state_before, position_before)
        self.inputs = self.sample()
        self.late = 0.0
        self.outputs = self.core.step(self.inputs)
        self.check_outputs(self.outputs)
        if self.outputs.controlword is not None:
            self.last_word = self.outputs.controlword

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
            key = (request.index, request.subindex)
            if request.value is not None:
                self.drive.objects[key] = request.value
            self.replies.append(SdoReply(request.id, self.drive.objects.get(key, 0), None))

    # -- the rules -----------------------------------------------------------------------------------------------------

    @property
    def seen(self) -> str:
        """The state that the core may know of: by this test's own reckoning of ages."""
        sample = self.inputs.statusword
        return "unknown" if sample is None or sample.stamp < self.now - AGE - self.late else state_of(sample.value)

    def running(self, *kinds: type) -> bool:
        return any(isinstance(command, kinds) and handle.busy for command, handle in self.handles)

    def check_outputs(self, outputs: Outputs) -> None:
        word, seen = outputs.controlword, self.seen
        if not self.commanded:
            assert outputs == Outputs(sdo=outputs.sdo)
            assert all(request.value is None for request in outputs.sdo)
        if word is None:
            return
        assert not word & 0b10_0100_0000, "bits 6 and 9 are never used"
        if seen == "unknown":
            assert word in (0x02, 0x00), f"controlword 0x{word:04X} into the unknown"
            assert self.core.ladder is not None
        if word & 0x8F == 0x0F:
            assert seen == "enabled" or (self.enabling and seen in ("switched on", "quick stop")), f"0x{word:04X} in {seen}"
        if word & 0x80:
            assert self.running(c.Reset)
            assert seen == "fault"
            assert word == 0x80
        if not word & 0b0010 and seen == "enabled":
            coasting = any(isinstance(command, c.Disable) and command.coast for command, h in self.handles if h.busy)
            assert coasting or self.core.ladder.rung >= 2, "disable voltage drops the load"
        if word & 0x30:
            assert seen == "enabled"
            assert self.inputs.mode.value in (PP, HM)
        if word & 0x10 and not (self.last_word or 0) & 0x10 and self.inputs.mode.value == PP:
            assert not self.inputs.statusword.value & 0x1000, "a new edge before the old acknowledge has fallen"
        if outputs.nmt_stop:
            assert self.core.ladder.rung == 3

    @property
    def enabling(self) -> bool:
        return any(isinstance(command, c.Enable) and handle.busy for command, handle in self.handles)

    def check_drive(self, before: int, state: AxisState, position: int) -> None:
        """What the drive did in this cycle, with the outputs of the one before."""
        new = self.drive.transitions[before:]
        if 4 in new or 16 in new:
            assert self.enabling or self.ticket, "enabled without a command to"
            assert not self.was_enabled, "enabled again by the same command"
            self.was_enabled = True
        if self.drive.position != position and self.commanded:
            assert state in MAY_MOVE, f"it moves in {state}"

    ticket = False
    was_enabled = False

    @invariant()
    def the_error_is_told_where_there_is_one(self) -> None:
        core = self.core
        assert (core.state is AxisState.ERRORSTOP) == (core.error is not None)
        if core.error is not None:
            assert core.error.message
            assert len(core.error.observed) < 3000

    @invariant()
    def only_a_powered_axis_is_in_motion(self) -> None:
        core = self.core
        if core.touched and core.state in MAY_MOVE - {AxisState.ERRORSTOP, AxisState.STOPPING}:
            assert core.powered or self.enabling or core.ladder is not None

    # -- what users do -------------------------------------------------------------------------------------------------

    def submit(self, command: c.Command) -> None:
        handle = Handle(type(command).__name__, NOBODY)
        self.handles = [(old, h) for old, h in self.handles if h.busy]
        accept(self.core, command, handle)
        self.handles.append((command, handle))
        if isinstance(command, c.Enable) and handle.busy:
            self.ticket, self.was_enabled = True, False
        if self.core.touched:
            self.commanded = True

    @rule(count=st.integers(1, 30))
    def time_passes(self, count) -> None:
        self.cycles(count)
        self.ticket = self.enabling

    @rule()
    def enable(self) -> None:
        self.submit(c.Enable())

    @rule()
    def enable_and_wait(self) -> None:
        self.submit(c.Enable())
        self.cycles(12)

    @rule(coast=st.booleans())
    def disable(self, coast) -> None:
        self.submit(c.Disable(coast))

    @rule(
        command=st.sampled_from(
            [c.Reset(), c.Halt(), c.Stop(), c.Release(), c.QuickStop(), c.PolicyStop("another axis failed")]
        )
    )
    def stop_or_so(self, command) -> None:
        self.submit(command)

    @rule(quick=st.booleans())
    def leave(self, quick) -> None:
        self.submit(c.Shutdown("test", quick))

    @rule(reference=st.sampled_from(list(c.Reference)), value=st.integers(-800, 800))
    def move(self, reference, value) -> None:
        self.submit(c.Move(reference, value, Profile(1000, 10_000, 10_000, 1000.0, 10_000.0)))

    @rule(velocity=st.integers(-500, 500), life=st.sampled_from([None, 0.2]))
    def move_velocity(self, velocity, life) -> None:
        self.submit(c.MoveVelocity(Profile(velocity, 10_000, 10_000, abs(velocity), 10_000.0), life))

    @rule(torque=st.integers(-300, 300))
    def torque(self, torque) -> None:
        self.submit(c.TorqueControl(torque, None, 0.5))

    @rule()
    def home(self) -> None:
        self.submit(c.Home(HomingJob(37, None, None, None, 1.0)))

    @rule(position=st.integers(-500, 500))
    def set_position(self, position) -> None:
        self.submit(c.SetPosition(position))

    @rule(way=st.integers(-300, 300), velocity=st.sampled_from([100.0, 1000.0]))
    def follow(self, way, velocity) -> None:
        image = self.core.image
        here = (image.reference or 0) - image.origin
        self.submit(c.FollowTrajectory(Trapezoid(here, here + way, velocity, 5000.0)))

    # -- what happens --------------------------------------------------------------------------------------------------

    @rule()
    def fault(self) -> None:
        self.drive.fail()

    @rule()
    def supply_drops(self) -> None:
        self.drive.drop()

    @rule(silent=st.booleans())
    def tpdos(self, silent) -> None:
        self.silent = silent

    @rule(operational=st.booleans())
    def node(self, operational) -> None:
        self.operational = operational

    @rule(works=st.booleans())
    def sdo(self, works) -> None:
        self.sdo_works = works

    @rule(refuses=st.booleans(), ignores=st.booleans(), blocked=st.booleans())
    def temper(self, refuses, ignores, blocked) -> None:
        self.drive.refuses_mode, self.drive.ignores_set_points, self.drive.blocked = refuses, ignores, blocked

    @rule(seconds=st.sampled_from([0.005, 0.05, 0.2, 1.0]))
    def the_program_is_late(self, seconds) -> None:
        self.late = seconds
        self.cycle()

    @precondition(lambda self: self.core.activity is not None)
    @rule(command=st.sampled_from([c.Halt(), c.Disable(), c.Stop()]))
    def interrupt(self, command) -> None:
        self.submit(command)
        self.cycles(3)

    # -- the end -------------------------------------------------------------------------------------------------------

    def teardown(self) -> None:
        """Once the drive behaves again, every command comes to an end, and leaving switches the axis off."""
        self.silent, self.operational, self.sdo_works = False, True, True
        self.drive.refuses_mode = self.drive.ignores_set_points = self.drive.blocked = False
        self.cycles(600)
        assert [handle for _, handle in self.handles if handle.busy] == []
        self.submit(c.Shutdown("the test is over"))
        self.cycles(300)
        assert not self.handles[-1][1].busy
        if self.commanded:
            assert self.drive.state in ("disabled", "fault")
            assert self.drive.velocity == 0


AxisUnderFire.TestCase.settings = settings(max_examples=150, stateful_step_count=30, deadline=None, derandomize=True)
TestAxisUnderFire = AxisUnderFire.TestCase
TestAxisUnderFire.pytestmark = [pytest.mark.timeout(50)]
