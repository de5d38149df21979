"""Blended moves of one axis in cyclic synchronous position mode, with set-points streamed by the master.

Theory of operation
-------------------
All moves form one profile (``BlendedProfile``). Each added command extends it from the present time on, so neither position nor
velocity changes where it was already planned. The ticket of a command ends when the axis has passed its end; the ticket of the last
command ends when the axis has arrived there and is at standstill. An override and a halt act on the time of the profile, as for any
trajectory.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import NamedTuple

from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.blending.blended_profile import (
    BlendedProfile,
    Leg,
    LegTransition,
    extended_profile,
    profile_from_rest,
    profile_of_move,
)
from axisbus.motion.blending.mode import passed_slower, reverses_before
from axisbus.motion.command_status import CommandEnds, CommandStatus
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import timed_out
from axisbus.motion.moves.csp_move import CspMove, MoveProgress
from axisbus.motion.moves.follow import Follow
from axisbus.motion.override import deadline_extension
from axisbus.motion.parameters import AxisParameters

_TO_REST = 1e-9  # seconds before its end at which a profile can no longer be extended


class BlendedCommand(NamedTuple):
    """One command: its leg (units), its end in unwrapped increments, its ticket, and the caller's own deadline (s)."""

    leg: Leg
    target: int
    ticket: CommandStatus
    timeout: float | None


class BlendedMoves(Follow):
    """Holds the commands whose ends are ahead, the profile through them, and the deadline of the first command."""

    foresees = False

    def __init__(self, part: BlendedCommand, parameters: AxisParameters, gate: StartBarrier) -> None:
        """``part``: the first command, which begins from rest (or see ``adopt_move``)."""
        super().__init__(None, parameters, gate)
        self._parts = deque([part])
        self._profile: BlendedProfile | None = None
        self._ends = CommandEnds()
        self._deadline: float | None = None

    def adopt_move(self, progress: MoveProgress, before: CspMove) -> None:
        """Take over an active move as the first command: from the last target of ``before``, on the time scale of that move."""
        self._use_profile(profile_of_move(progress.profile))
        self.resume(before)
        self.clock = self._time = progress.clock
        self.shifted = before.shifted
        self._deadline = before.deadline

    @property
    def target(self) -> int:
        """End of the last command in unwrapped increments, without a superimposed distance."""
        return self._parts[-1].target

    @property
    def commands(self) -> int:
        """The number of commands that share the profile and have not ended."""
        return len(self._parts)

    @property
    def window(self) -> int:
        """The number of cycles in the mean that the axis follows."""
        return 1

    @property
    def why_not(self) -> str:
        """Why no command can be added now; "" if one can."""
        if self._addition is not None:
            return "a distance is being superimposed on the present motion"
        if self._profile is not None and self._profile_time >= self._profile.duration - _TO_REST:
            return "it came after the end of the previous command"
        return ""

    def join(self, part: BlendedCommand) -> None:
        """Append another command; allowed only if ``why_not`` is empty."""
        self._ends.add(self._parts[-1].ticket, part.ticket)
        self._parts.append(self._within_override(part))
        if self._profile is not None:
            self._use_profile(self._extended_through(self._profile))

    def _within_override(self, part: BlendedCommand) -> BlendedCommand:
        """Return the command with reduced limits, so that the axis stays within its limits while an override speeds time up.

        Time cannot always be slowed down before the command begins: the axis may need its full deceleration for the active move.
        """
        rate, pace, leg = self._time.fastest, self._pace, part.leg
        if rate <= 1.0 or pace is None:
            return part
        hardest = math.inf if pace.acceleration is None else pace.acceleration / rate**2
        fastest = math.inf if pace.velocity is None else pace.velocity / rate
        slower = leg._replace(
            velocity=min(leg.velocity, fastest), up=min(leg.up, hardest), down=min(leg.down, hardest)
        )
        return part._replace(leg=slower)

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the axis has arrived at the end of the last command."""
        self._check_deadline(
            image
        )  # before advancing: if it raises, the axis brakes in this cycle from its position
        self._advance_profile(image)
        if self._profile is None and self._prepared:
            units = self._parameters.units.position
            start = units.to_units(self.reference(image) - image.origin)
            self._use_profile(profile_from_rest(start, self._legs(), self._mean))
        if super().step(image, order):
            return True
        if self._profile is not None:
            self._pass_ends(self._profile)
        return False

    def _advance_profile(self, image: AxisImage) -> None:
        """Advance the unsmoothed profile by one cycle if the axis follows a mean; nothing to do here."""

    def _legs(self) -> list[Leg]:
        return [part.leg for part in self._parts]

    @property
    def _profile_time(self) -> float:
        """The present time on the profile, in its seconds."""
        return self.clock.t

    @property
    def _mean(self) -> float:
        """Length of the averaging window, in seconds of the profile."""
        return 0.0

    def _extended_through(self, profile: BlendedProfile) -> BlendedProfile:
        """Return the profile extended through all ends, including transitions that the profile has passed but the axis has not."""
        t, before = self._profile_time, profile.transitions[len(profile.transitions) - len(self._parts) + 1 :]
        passed = [transition for transition in before if transition.time <= t]
        longer = extended_profile(profile, t, self._legs()[len(passed) :])
        return replace(longer, transitions=(*passed, *longer.transitions))

    def _use_profile(self, profile: BlendedProfile) -> None:
        self._profile = profile
        self._command_profile(profile)
        for part, transition in zip(self._parts, profile.transitions, strict=True):
            self._ends.mark(part.ticket, profile.passed_at(transition))

    def _command_profile(self, profile: BlendedProfile) -> None:
        self.replace_trajectory(profile)

    def _pass_ends(self, profile: BlendedProfile) -> None:
        """End the commands whose ends the axis has passed; the profile keeps the transitions that were ahead at planning."""
        t = self.clock.t
        for transition in profile.transitions[len(profile.transitions) - len(self._parts) : -1]:
            if t < profile.passed_at(transition):
                break
            self._parts.popleft()
            self._deadline = None
            self._note_difference(transition, self._parts[0].ticket)
        self._ends.end_passed(t)

    def _note_difference(self, transition: LegTransition, ticket: CommandStatus) -> None:
        """Note on the ticket if a command has not taken over as requested."""
        unit = self._units.unit
        if transition.turns:
            ticket.note = reverses_before()
        elif transition.speed < transition.requested * 0.999:
            ticket.note = passed_slower(transition.speed, transition.requested, unit)

    def _check_deadline(self, image: AxisImage) -> None:
        part = self._parts[0]
        if part.timeout is None or self.clock.braking:
            return
        if self._deadline is None:
            self._deadline = image.now + part.timeout
        self._deadline += deadline_extension(image.override, self._period)
        if image.now > self._deadline:
            raise timed_out(part.target, part.timeout, image, self._parameters)
