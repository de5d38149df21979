"""One module under MIT control, from the first heartbeat to the removal of its power: frames and times in, frames out.

Theory of operation
-------------------
The controller listens first. It continues only if exactly one module sends heartbeats under this node ID, is idle and has no error,
and if no other master commands it. Then, still in idle, it sets the mode and sends *damping frames* (kp 0, torque 0, velocity 0,
and the kd of the settings) until the module answers them. This overwrites all old inputs before the module has power. Only then
does it request closed loop, once. Until the heartbeat shows closed loop, and until the first command, it keeps sending damping
frames, so that the output does not jump.

From then on the newest command is sent in each period, with its values limited to their ranges. The shutdown is always the same:
damping frames until the output is at standstill (at most 2 s), then idle until the heartbeat shows it; if it does not in time,
ESTOP (``ModuleMotionProcedure``). The shutdown begins when

- the user requests it, or gives no command for ``command_timeout``;
- answers or heartbeats are missing;
- the module leaves closed loop, restarts, or is commanded by another master;
- its position reaches the end of its range, beyond which the firmware may wrap it.

No frame of zeros is ever sent: ``mit.pack`` makes none, and ``Outgoing`` rejects it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple import mit
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, Outgoing, decode
from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.can_simple.identifier import require_node
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, IDLE, named
from axisbus.drives.gim6010.can_simple.mit import (
    MIT_CONTROL,
    Changed,
    MitCommand,
    MitFeedback,
    MitRanges,
    Packed,
)
from axisbus.drives.gim6010.can_simple.orders import MIT
from axisbus.drives.gim6010.direct_motion import BRAKE_TIME, ModuleMotionProcedure, ModuleMotionStage
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.errors import ArgumentError

_SHORTEST, _LONGEST = 0.001, 0.1  # s: limits of the period
_GAIN_STEPS = 4095  # steps of a gain on the wire
_FIXED_UP_TO = Firmware(0, 6, 0)  # from this version on the ranges are parameters
_PATHS = tuple(f"axis0.controller.config.mit_max_{name}" for name in ("pos", "vel", "kp", "kd", "torque"))


@dataclass(frozen=True, slots=True)
class MitSettings:
    """One module under MIT control; no setting has a default.

    ``node`` is 0 to 63. ``ranges`` are those of its firmware: the manual's up to 0.5.14, parameters in later versions; wrong ranges
    give values that are wrong by their ratio. ``gear`` is in turns of the rotor per turn of the output. ``damping`` is the kd, in
    the firmware's unit, for braking at every shutdown. ``period`` (0.001 to 0.1 s) is the period of the frames. If the program
    gives no command for ``command_timeout`` (s, at least two periods, at most 1), it is considered dead.

    Raises:
        ArgumentError: a value is invalid.
    """

    node: int
    ranges: MitRanges
    gear: float
    damping: float
    period: float
    command_timeout: float

    def __post_init__(self) -> None:
        require_node(self.node)
        if not isinstance(self.ranges, MitRanges):
            raise ArgumentError(
                "ranges of MIT control are not given", remedy="give MitRanges as the module has them"
            )
        least = self.ranges.kd / _GAIN_STEPS
        self._check("gear", 1e-3, 1e3, "turns of the rotor per turn of the output")
        self._check("damping", least, self.ranges.kd, "the damping of every stop: above 0")
        self._check("period", _SHORTEST, _LONGEST, "seconds")
        self._check("command_timeout", 2.0 * self.period, 1.0, "seconds, two periods at the least")

    def _check(self, name: str, low: float, high: float, what: str) -> None:
        value = getattr(self, name)
        good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not good or not low <= value <= high:
            raise ArgumentError(
                f"{name} of MIT control: {value!r}", remedy=f"give {low:.4g} to {high:.4g}: {what}"
            )

    def stiffness(self, kp: float) -> float:
        """Return the stiffness at the output for a gain ``kp``, in N·m/rad, by the gear.

        The firmware applies the gains to turns of the rotor and does not convert them (seen in code of the same maker, not measured
        on this module): at 8:1 a gain of 1 is 1.273 N·m/rad.
        """
        return kp * self.gear / math.tau

    def kp_for(self, stiffness: float) -> float:
        """Return the gain ``kp`` for a stiffness at the output, in N·m/rad."""
        return stiffness * math.tau / self.gear

    def output_damping(self, kd: float) -> float:
        """Return the damping at the output for a gain ``kd``, in N·m per rad/s, by the gear; as ``stiffness``."""
        return kd * self.gear / math.tau


def ranges_of(module: ModuleParameters) -> MitRanges:
    """Return the ranges of a module: its parameters, or the manual's, which are fixed up to firmware 0.5.14. Blocks.

    Raises:
        ArgumentError: a range is invalid. BusError: as ``ModuleParameters.read``.
    """
    if module.firmware < _FIXED_UP_TO:
        return MitRanges()
    return MitRanges(*(float(module.read(path)) for path in _PATHS))


# Messages that only a master sends. Mit_Control is not among them: it is also an answer.
_OTHERS = frozenset(
    named(each).command
    for each in (
        "Set_Axis_State",
        "Set_Controller_Mode",
        "Set_Input_Pos",
        "Set_Input_Vel",
        "Set_Input_Torque",
    )
)
_ANSWERS, ANSWER_TIME = 3, 1.0  # answers to damping frames before closed loop, and s to wait for them
START_TIME = 2.0  # s until a heartbeat must show closed loop
_LOST, _LOST_PERIODS = 0.1, 5  # s, or periods, without an answer
BLIND = 0.3  # s of braking if no answer shows the velocity
_EDGE = 0.99  # share of the position range that must not be reached
STANDS = 0.1  # rad/s of the output; a lower speed counts as standstill


# ----------------------------------------------------------------------------------------------------------------------
# Compares the two position values of a module: by MIT control's ranges, and by the encoder's message, which has no ranges.


ESTIMATES = named("Get_Encoder_Estimates").command
_NEAR, _LATE = (
    0.05,
    0.03,
)  # tolerance in rad, and the time in s whose motion at the present speed is added to it
_TOGETHER = 0.015  # s at most between answer and estimate
_ENOUGH = 5  # disagreements in a row


class PositionCrossCheck:
    """Number of consecutive disagreements: wrong ranges or a wrong gear show as disagreements away from position 0.

    The encoder's message becomes invalid as soon as the module leaves closed loop, which its heartbeat shows only later. Therefore
    a heartbeat with closed loop must follow the first disagreement, and eight bytes of 0 are ignored.
    """

    def __init__(self, settings: MitSettings) -> None:
        self._settings = settings
        self._row = 0
        self._since = math.inf  # begin of the consecutive disagreements

    def take(self, frame: CanFrame, feedback: MitFeedback, feedback_at: float, closed_at: float) -> str:
        """Compare an estimate with the newest answer; return the reason to stop, or an empty text.

        ``feedback_at`` is the time of that answer, ``closed_at`` the time of the last heartbeat with closed loop (s). If answer and
        estimate are too far apart in time, they are not compared: the output turns meanwhile.
        """
        found = decode(frame.can_id, frame.data, from_module=True)
        if (
            not isinstance(found, DecodedMessage)
            or not any(frame.data)
            or frame.time - feedback_at > _TOGETHER
        ):
            return ""
        turns = found.values["Pos_Estimate"]
        position = float(turns) * math.tau / self._settings.gear
        apart = abs(position - feedback.position)
        speed = max(
            abs(feedback.velocity), abs(float(found.values["Vel_Estimate"]) * math.tau / self._settings.gear)
        )
        agrees = apart <= _NEAR + _LATE * speed
        self._row = 0 if agrees else self._row + 1
        self._since = frame.time if self._row == 1 else self._since
        if self._row < _ENOUGH or closed_at <= self._since:
            return ""
        return (
            f"its position is {feedback.position:.3f} rad by MIT control and {position:.3f} rad by its encoder's message: "
            "the ranges or the gear that were given are not the module's"
        )


# -- controller --------------------------------------------------------------------------------------------------------


class MitPhase(Enum):
    """Phase of the control after listening and before its shutdown."""

    ANSWERING = "waiting for answers"
    STARTING = "waiting for closed loop"
    RUNNING = "led"


@dataclass(frozen=True, slots=True)
class MitCycle:
    """One command and its result.

    ``saturated`` are the values that were beyond their range, ``shifted`` the value that was changed so that the frame is not all
    zeros. ``feedback`` is the module's answer, which was received at ``time`` (s, monotonic) after the frame had been sent.
    """

    command: MitCommand
    saturated: tuple[Changed, ...]
    shifted: tuple[Changed, ...]
    feedback: MitFeedback
    time: float

    @property
    def exact(self) -> bool:
        """Whether the module received the command unchanged, except for rounding to a step."""
        return not self.saturated


class MitLeader(ModuleMotionProcedure):
    """Controller of one module; ``why`` is the reason for the shutdown, ``left`` the state in which it left the module."""

    def __init__(self, settings: MitSettings) -> None:
        super().__init__(settings.node)
        self.settings = settings
        self.phase = MitPhase.ANSWERING
        self.feedback: MitFeedback | None = None
        self.feedback_at = -math.inf
        self.answered: MitCycle | None = None  # the newest command with its answer
        self.answered_number = 0
        self._damping = self._pack(MitCommand(0.0, 0.0, 0.0, settings.damping, 0.0))
        self._agreement = PositionCrossCheck(settings)
        self._first_answer = -math.inf  # to the newest command
        self._wanted: tuple[MitCommand, float] | None = None
        self._number = 0  # of commands
        self._sent: tuple[MitCommand, Packed, int] | None = None  # the command whose answer is due
        self._at = -math.inf  # when the phase of waiting for closed loop began
        self._due = -math.inf
        self._answers = 0

    # Called by the user of the controller.

    @property
    def is_running(self) -> bool:
        """Whether the module accepts commands."""
        return self.stage is ModuleMotionStage.LED and self.phase is MitPhase.RUNNING

    @property
    def words(self) -> str:
        """The phase, or the stage before and after all phases."""
        return self.phase.value if self.stage is ModuleMotionStage.LED else self.stage.value

    @property
    def parting(self) -> tuple[Outgoing, ...]:
        """Frames to send if nothing else can be sent any more: damping, then idle."""
        return self._damping.frame, self._orders.idle()

    def command(self, command: MitCommand, now: float) -> int:
        """Set the command to send from now on; return its number, which ``answered_number`` has once the module answered it."""
        self._wanted = (command, now)
        self._number += 1
        return self._number

    def escalate(self) -> None:
        """Skip to ESTOP with the next step if the shutdown has begun; from any thread or signal handler."""
        self._wishes.append("")

    def give_up(self, left: str) -> None:
        """End the control at once: the caller cannot continue it."""
        self.stage, self.left, self.confirmed = ModuleMotionStage.DONE, left, False
        self.why = self.why or left

    def _heed(self, why: str) -> None:
        """Begin the shutdown; a second reason changes nothing, only ``escalate`` skips to ESTOP."""
        if why:
            self._end(why)
        elif self.stage is ModuleMotionStage.ENDING:
            super()._heed(why)

    # Reception.

    def _hear(self, command: int, frame: CanFrame) -> None:
        if self.done:
            return
        if command == MIT_CONTROL.command:
            self._answer(frame)
        elif command == ESTIMATES:
            self._estimate(frame)
        elif command in _OTHERS:
            self._end(f"another program commands the module (it was heard to send {frame.can_id:03X}h)")

    def _answer(self, frame: CanFrame) -> None:
        found = mit.read(self.node, frame.data, self.settings.ranges)
        if not isinstance(found, MitFeedback):
            return
        before = self.feedback
        self.feedback, self.feedback_at = found, frame.time
        self._answers += 1
        if not self.is_running:
            return
        jumped = before is not None and abs(found.position - before.position) > self.settings.ranges.position
        if jumped or abs(found.position) >= _EDGE * self.settings.ranges.position:
            self._end("its position is at the end of its range, beyond which the firmware may wrap it")
        elif self._sent is not None:
            command, packed, number = self._sent
            if number != self.answered_number:
                self.answered_number, self._first_answer = number, frame.time
            self.answered = MitCycle(command, packed.clipped, packed.shifted, found, frame.time)

    def _estimate(self, frame: CanFrame) -> None:
        """Compare the position with the encoder's own message, which is valid only in closed loop."""
        last = self._pulse.last
        alive = last is not None and last.state == CLOSED_LOOP and frame.time > self._pulse.at
        if alive and self.is_running and self.feedback is not None:
            why = self._agreement.take(frame, self.feedback, self.feedback_at, self._pulse.at)
            if why:
                self._end(why)

    # Sending.

    def _begin(self) -> Outgoing:
        self._answers, self._due = 0, self._begun
        return self._orders.mode(MIT)

    def _lead(self, now: float) -> Outgoing | None:
        return _STEPS[self.phase](self, now)

    def _wait_for_answers(self, now: float) -> Outgoing | None:
        if self._against(now, IDLE):
            return None
        if self._answers >= _ANSWERS:
            self.phase, self._at, self._to_brake = MitPhase.STARTING, now, True
            return self._orders.closed_loop()
        if now - self._begun > ANSWER_TIME:
            self._end("the module does not answer MIT control")
            return None
        return self._damp(now)

    def _wait_for_loop(self, now: float) -> Outgoing | None:
        last = self._pulse.last
        if self._against(now, IDLE, CLOSED_LOOP):
            return None
        fresh = self._pulse.at > self._at and self.feedback_at > self._at
        if fresh and last is not None and last.state == CLOSED_LOOP:
            self.phase = MitPhase.RUNNING
            self._wanted = self._sent = None
        elif now - self._at > START_TIME + 2.0 * self._pulse.period:
            self._end("the module does not go into closed loop")
            return None
        return self._damp(now)

    def _run(self, now: float) -> Outgoing | None:
        if self._against(now, CLOSED_LOOP) or self._is_deaf(now):
            return None
        if self._wanted is None:
            return self._damp(now)
        command, given = self._wanted
        is_answered = self.answered_number == self._number  # until then the program may be waiting for it
        if is_answered and now - max(given, self._first_answer) > self.settings.command_timeout:
            self._end(f"the program gave no command for {now - max(given, self._first_answer):.3f} s")
            return None
        if not self._is_due(now):
            return None
        packed = self._pack(command)
        self._sent = (command, packed, self._number)
        return packed.frame

    def _brake(self, now: float) -> Outgoing | None:
        fresh = now - self.feedback_at <= self._lost
        stands = fresh and self.feedback is not None and abs(self.feedback.velocity) <= STANDS
        if self._has_braked(now, stands=stands, longest=BRAKE_TIME if fresh else BLIND):
            return None
        return self._damp(now)

    def _is_deaf(self, now: float) -> bool:
        if now - self.feedback_at <= self._lost:
            return False
        self._end(f"the module has not answered for {now - self.feedback_at:.3f} s")
        return True

    # Helpers.

    @property
    def _lost(self) -> float:
        return max(_LOST, _LOST_PERIODS * self.settings.period)

    def _is_due(self, now: float) -> bool:
        """Whether a frame is due on the grid of periods; a missed frame is not sent later."""
        if now < self._due - 1e-9:
            return False
        following = self._due + self.settings.period
        self._due = following if following > now else now + self.settings.period
        return True

    def _damp(self, now: float) -> Outgoing | None:
        return self._damping.frame if self._is_due(now) else None

    def _pack(self, command: MitCommand) -> Packed:
        return mit.pack(self.node, command, self.settings.ranges)


_STEPS = {
    MitPhase.ANSWERING: MitLeader._wait_for_answers,
    MitPhase.STARTING: MitLeader._wait_for_loop,
    MitPhase.RUNNING: MitLeader._run,
}
