"""Moves to a position in profile position mode."""

from __future__ import annotations

import math

from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import MotionTimeout
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.blending.pp_blending import BlendedTarget, PpBlending
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.moves.activity import present_speed, require_position
from axisbus.motion.moves.prepare import Prepare, Prepared, require_ramps
from axisbus.motion.moves.profile import MoveProfile, braking_distance, duration
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.moves.setpoint_confirmation import confirmation_for
from axisbus.motion.moves.setpoint_without_ack import set_point
from axisbus.motion.override import deadline_extension
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.setpoint_update import SetPointUpdate, VelocityChangeCheck
from axisbus.motion.stop_deceleration import CommandedMotion

_WINDOW_FLOOR = 20  # increments
_WINDOW_SHARE = 0.02  # of the move's distance


class PositionMove(Prepared):
    """A move in profile position mode: prepare, set-point handshake, arrival; holds its deadline and its progress."""

    mode = ModeOfOperation.PROFILE_POSITION
    ends_at_rest = True
    in_effect = False

    def __init__(
        self,
        target: int,
        profile: MoveProfile,
        parameters: AxisParameters,
        prepare: Prepare,
        before: SetPoint | None,
        factor: float = 1.0,
    ) -> None:
        """``target`` in unwrapped increments; ``before`` is an unfinished handshake of another move.

        ``factor``: the override for which ``prepare`` writes the velocity; ``profile`` has the velocity as commanded.
        """
        self._set_point_update = SetPointUpdate(profile, factor, parameters)
        self._velocity_check: VelocityChangeCheck | None = None
        profile = self._set_point_update.profile
        self.set_point = set_point(target, parameters)
        self._confirmation = confirmation_for(self.set_point, profile, parameters)
        # Until the axis leaves a path of the master, it does not move by these ramps.
        if prepare.set_point_source is None or prepare.pending_mode_switch is not None:
            self.commanded = CommandedMotion(profile.speed, profile.up, profile.down, by_target=True)
        self._profile = profile
        self._parameters = parameters
        self._prepare = prepare
        self._before = before
        self._start: int | None = None
        self._window = parameters.position_window
        self._earliest_end = -math.inf  # see ``_unseen_duration``
        self._is_taken = False
        self._watch = _ArrivalWatch(target, profile, parameters)
        self._blending: PpBlending | None = None  # set once moves have joined it
        self._target = target

    @property
    def target(self) -> int:
        """The position of its end, including all moves that have joined it, in unwrapped increments."""
        return self._target

    @property
    def is_soft(self) -> bool:
        """Whether its jerk is limited."""
        return self._profile.softness is not None

    @property
    def commands(self) -> int:
        """The number of moves that share it and have not ended."""
        return 1 if self._blending is None else self._blending.commands

    def join(self, part: BlendedTarget, ticket: CommandStatus, image: AxisImage) -> None:
        """Continue to the end of another move, in the same direction; ``ticket`` belongs to the last move so far."""
        if self._blending is None:
            profile = self._profile if self._profile.ramp else self._set_point_update.profile
            first = BlendedTarget(self._target, profile, part.mode, ticket)
            self._blending = PpBlending(first, self._parameters)
        self._blending.add(part, image.now)
        self._target = part.target
        self._set_point_update.request(self._set_point_update.requested)

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the drive has arrived."""
        if self._start is None and not self._begins(image, order):
            return False
        self._watch.extend(deadline_extension(image.override, self._parameters.scan_period))
        if self._blending is not None:
            self._check_passed_ends(self._blending, image)
        if not self.set_point.begun and not self._set_point_stays(image, order):
            return False
        taken = self.set_point.step(image, order)
        order.halt = order.halt and self.set_point.keeps_halt(image)
        if self._confirmation is not None:
            self._confirmation.step(image)
        if not taken:
            return False
        if not self._is_taken:
            self._is_taken = self.in_effect = True
            self.rests_from = image.now
            self._earliest_end = image.now + self._unseen_duration(image)
            if self._blending is not None and self.set_point.target == self._target:
                self._blending.taken(image.now)
        if self._velocity_check is not None:
            self._velocity_check.look(image)
        if self._arrived(image):
            return True
        self._watch.check(image)
        return False

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued requests."""
        super().cancel(order)
        self._set_point_update.cancel(order)

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake, for the move that replaces this one."""
        if self._before is not None and self._before.begun:
            return self._before
        return self.set_point if self.set_point.begun else None

    def _begins(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once no handshake of another move is running and all is prepared: from then on the move runs."""
        if self._before is not None and self._before.begun:
            self._before.step(image, order)
            return False
        if not self._prepare.step(image, order):
            return False
        self._begin(image)
        return True

    def _begin(self, image: AxisImage) -> None:
        self._set_point_update.ramps = self._prepare.ramps  # later writes add to these
        self._use_profile(self._set_point_update.ramps.applied(self._profile))
        if self._profile.timeout is None:
            require_position(image, self._parameters.name, "the time that a move may take")
        self._start = image.position if image.position is not None else self.set_point.target
        distance = abs(self.set_point.target - self._start)
        if self._window is None:
            self._window = max(_WINDOW_FLOOR, int(distance * _WINDOW_SHARE))
        self._watch.begin(image, distance)

    def _use_profile(self, profile: MoveProfile) -> None:
        """Compute from now on with a profile that has the drive's ramps."""
        self._profile = require_ramps(profile, self._parameters)
        self.commanded = CommandedMotion(profile.speed, profile.up, profile.down, by_target=True)
        self._watch = _ArrivalWatch(self.set_point.target, profile, self._parameters, self._watch.deadline)

    def _check_passed_ends(self, passing: PpBlending, image: AxisImage) -> None:
        """Check which ends have been passed, and request the next profile if it is due."""
        profile = passing.look(image)
        if profile is not None:
            self._set_point_update.request(profile)
            self._watch.deadline = None  # a caller's deadline was for the previous move

    def _set_point_stays(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether the set-point stays unchanged; a hold by an override of 0, or a change of its velocity, comes first."""
        was_held = self._set_point_update.held
        given = self._set_point_update.step(image, order)
        if given is None:
            return True
        self.rests_from = image.now
        if given:
            self._give_again(image, was_held)
        return given

    def _give_again(self, image: AxisImage, was_held: bool) -> None:
        """Give the target again, with the velocity that has just been written."""
        moved, target = self._is_taken and not was_held, self._target
        before = self._profile
        profile = (self._set_point_update.ramps or self._prepare.ramps).applied(
            self._set_point_update.profile
        )
        self.set_point = set_point(target, self._parameters)
        self._is_taken = self.in_effect = False
        self._use_profile(profile)
        self._confirmation = confirmation_for(self.set_point, profile, self._parameters)
        self._velocity_check = None
        if moved:
            self._velocity_check = VelocityChangeCheck(before, profile, target, self._parameters, image.now)
        here = image.position if image.position is not None else target
        self._watch.begin(image, abs(target - here))

    def _unseen_duration(self, image: AxisImage) -> float:
        """Return the seconds that the rest of the move takes from standstill if neither bit 10 nor the position shows its end.

        If the axis is within the window before it is fast, bit 10 may stay set during the whole motion, and an axis that begins
        gently cannot yet be told from one at standstill. A move that is hardly faster than a standstill cannot be told from one at
        any time. 0 for all other moves, or if a value is not known.
        """
        profile, window, parameters = self._profile, self._window, self._parameters
        if image.position is None or window is None or not profile.speed or not profile.ramp:
            return 0.0
        distance = abs(self.set_point.target - image.position)
        soft = profile.soft_seconds(abs(parameters.units.position.factor))
        slow = parameters.unseen_speed
        if distance > window + slow * (slow / profile.ramp + soft) and profile.speed > slow:
            return 0.0
        return duration(distance, profile.speed, profile.ramp) + soft

    def _arrived(self, image: AxisImage) -> bool:
        """Whether bit 10 is set, and (if 6064h is fresh) the axis is within the window: bit 10 may be from the previous move."""
        if image.statusword is None or not image.statusword & sw.TARGET_REACHED:
            return False
        if self.set_point.target != self._target or self._set_point_update.is_requested:
            return False  # another end has joined it
        if self._confirmation is not None and not self._confirmation.suffices(image):
            return False
        if image.position is None:
            return True
        assert self._window is not None
        distance = abs(image.position - self.set_point.target)
        if image.now < self._earliest_end and distance > self._parameters.standstill_tolerance:
            self.rests_from = image.now
            return False
        if distance > self._window:
            return False
        self.settling = self._unseen_duration(image)
        return True


class _ArrivalWatch:
    """The deadline of a move: from its distance and limits, else from progress, else the caller's."""

    __slots__ = ("_parameters", "_profile", "_progress_at", "_progress_position", "_target", "deadline")

    def __init__(
        self, target: int, profile: MoveProfile, parameters: AxisParameters, deadline: float | None = None
    ) -> None:
        """``deadline``: the caller's own (s, monotonic, with its extensions), if it already runs for the same move."""
        self._target = target
        self._profile = profile
        self._parameters = parameters
        self.deadline = None if profile.timeout is None else deadline
        self._progress_at = 0.0
        self._progress_position: int | None = None

    def begin(self, image: AxisImage, distance: float) -> None:
        """Start the watch for a move of ``distance`` increments."""
        if self.deadline is None:
            allowed = self._allowed(distance, present_speed(image, self._parameters))
            self.deadline = None if allowed is None else image.now + allowed
        self._progress_at = image.now

    def _allowed(self, distance: float, speed: float) -> float | None:
        """Return twice the time to brake from ``speed`` (in either direction) and to cover the whole distance, plus a margin."""
        profile = self._profile
        if profile.timeout is not None:
            return profile.timeout
        if not profile.speed or not profile.ramp:
            return None
        total_distance = distance + braking_distance(speed, profile.ramp)
        soft = profile.soft_seconds(abs(self._parameters.units.position.factor))
        return (
            2.0 * (speed / profile.ramp + duration(total_distance, profile.speed, profile.ramp) + soft) + 2.0
        )

    def extend(self, seconds: float) -> None:
        """Extend the caller's deadline by ``seconds`` of this cycle: the motion is slower because of an override."""
        if self.deadline is not None and self._profile.timeout is not None:
            self.deadline += seconds

    def check(self, image: AxisImage) -> None:
        """Raise MotionTimeout when the deadline has passed, or (without one) when 6064h no longer changes."""
        if self.deadline is not None:
            if image.now > self.deadline:
                raise self._late(
                    image,
                    "twice the time that follows from its distance, velocity and acceleration has passed",
                )
            return
        if image.position != self._progress_position:
            self._progress_position = image.position
            self._progress_at = image.now
        elif image.now - self._progress_at > self._parameters.timing.progress:
            raise self._late(image, f"6064h has not changed for {self._parameters.timing.progress:g} s")

    def _late(self, image: AxisImage, why: str) -> MotionTimeout:
        name, position = self._parameters.name, self._parameters.units.position
        shown = None if image.position is None else position.to_units(image.position - image.origin)
        where = "unknown" if shown is None else f"{shown:g} {position.unit}"
        word = 0 if image.statusword is None else image.statusword
        return MotionTimeout(
            f"{name}: the axis has not arrived at {position.to_units(self._target - image.origin):g} {position.unit}",
            axis=name,
            observed=f"position {where}; {why}; target reached (bit 10) is {int(bool(word & sw.TARGET_REACHED))}, "
            f"statusword 0x{word:04X}" + "".join(f"; {hint}" for hint in sw.hints(word)),
            remedy=self._unreported_remedy()
            if self._is_there(image) and not word & sw.TARGET_REACHED
            else "check whether the axis is blocked, whether the drive limits torque or velocity, and whether its "
            "position window (6067h) can be met; if it only stops a little short, set position_window in [axes."
            + name
            + "]; if it turned at another speed than commanded, its drive counts velocities in a unit of its own: set "
            "velocity_scale there",
        )

    def _is_there(self, image: AxisImage) -> bool:
        """Whether the axis is at its target by its position."""
        parameters = self._parameters
        window = max(parameters.position_window or 0, parameters.standstill_tolerance)
        return image.position is not None and abs(image.position - self._target) <= window

    def _unreported_remedy(self) -> str:
        name = self._parameters.name
        return (
            "the axis is at its target, and its drive does not report it: let the drive accept a wider window (6067h) or a shorter "
            f"time within it (6068h), by lines in [axes.{name}.objects]; position_window does not change the drive. If the drive "
            "never sets bit 10 in pp, move the axis in csp, which does not need it: "
            f'machine.group("{name}").move_linear(...)'
        )
