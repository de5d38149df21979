"""Modes of operation over a module: the set-points of each mode in a cycle, and bits 10, 12 and 13 of its statusword."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import homing, objects
from axisbus.cia402 import objects as o
from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Outputs
from axisbus.drives.gim6010.can_simple.orders import FILTER, TRAPEZOID
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.setpoints import MOVES, ModuleSetPoints
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN

_M = ModeOfOperation
_CLOSE = 64  # counts to the target, if the heartbeat does not report the end of a trajectory
_LATER = 0.02  # s after a set-point, from which heartbeats refer to it
_STANDS_BY = 1.0  # s in which a motor to be homed in place must come to standstill
_IN_VELOCITY = 0.05  # share of the target velocity


# -- Objects of a profile that motion writes, in increments, and their values in the module's turns --------------------


class ModuleProfile:
    """The values written last; 0 means not yet written, and is never used as a velocity or ramp."""

    def __init__(self, settings: ModuleSettings) -> None:
        self._settings = settings
        most = 1000 if settings.torque is not None else 0
        self.values: dict[int, int] = {
            o.PROFILE_VELOCITY: 0,
            o.PROFILE_ACCELERATION: 0,
            o.PROFILE_DECELERATION: 0,
            o.END_VELOCITY: 0,
            o.HOMING_METHOD: 0,
            o.HOME_OFFSET: 0,
        } | ({} if settings.torque is None else {o.TORQUE_SLOPE: 0, o.MAX_TORQUE: most})

    @property
    def speed(self) -> float:
        """6081h in turns/s."""
        return self.values[o.PROFILE_VELOCITY] / TURN

    @property
    def up(self) -> float:
        """6083h in turns/s²."""
        return self.values[o.PROFILE_ACCELERATION] / TURN

    @property
    def down(self) -> float:
        """6084h in turns/s²; if not written yet, the module's own velocity ramp: braking must always be possible."""
        return self.values[o.PROFILE_DECELERATION] / TURN or self._settings.velocity_ramp

    @property
    def complete(self) -> bool:
        """Whether velocity and acceleration of a trapezoid are known."""
        return self.speed > 0.0 and self.up > 0.0

    @property
    def slope(self) -> float:
        """6087h as N·m/s of the rotor, at most the module's own ramp, which is also used if 6087h is 0."""
        torque = self._settings.torque
        assert torque is not None  # without it, torque is not available
        asked = self.values[o.TORQUE_SLOPE] / 1000.0 * torque.rated
        return min(asked, torque.ramp) if asked > 0.0 else torque.ramp

    def torque(self, permille: int) -> float:
        """Convert a torque in ‰ to N·m of the rotor, limited to 6072h."""
        torque = self._settings.torque
        assert torque is not None
        most = self.values[o.MAX_TORQUE]
        return max(-most, min(most, permille)) / 1000.0 * torque.rated

    def permille(self, current: float) -> int:
        """Convert a current (A) to a torque in ‰."""
        torque = self._settings.torque
        assert torque is not None
        return round(current * torque.constant / torque.rated * 1000.0)


# -- The targets of a mode, as frames ----------------------------------------------------------------------------------


@dataclass(slots=True)
class Targets:
    """The last targets; ``stream`` is the target position of the present cycle, or None."""

    position: int | None = None
    velocity: int = 0
    torque: int = 0
    stream: int | None = None

    def take(self, outputs: Outputs) -> None:
        self.stream = outputs.target_position
        self.position = self.position if outputs.target_position is None else outputs.target_position
        self.velocity = self.velocity if outputs.target_velocity is None else outputs.target_velocity
        self.torque = self.torque if outputs.target_torque is None else outputs.target_torque


@dataclass(frozen=True, slots=True)
class Means:
    """The objects that a mode uses."""

    settings: ModuleSettings
    hearing: ModuleFeedback
    lead: ModuleSetPoints
    profile: ModuleProfile
    targets: Targets


class ModuleMode(ABC):
    """One mode, from its selection to the next one's; ``begin`` may find the motor moving, and ``halt`` brings it to standstill."""

    def __init__(self, means: Means) -> None:
        self._means = means
        self._lead, self._profile, self._targets = means.lead, means.profile, means.targets

    def begin(self) -> None:
        """Brake to standstill and hold."""
        self._lead.rest(self._profile.down)

    @abstractmethod
    def step(self, word: int, edge: int) -> None:
        """Execute a cycle; ``edge``: the bits of the controlword that have risen. Not called under halt."""

    def halt(self, word: int, edge: int, first: bool) -> None:  # noqa: ARG002  # most modes ignore the controlword then
        """Execute a cycle under halt; ``first``: the first one."""
        if first:
            self._lead.rest(self._profile.down)

    @abstractmethod
    def bits(self, halted: bool) -> int:
        """Return bits 10, 12 and 13."""

    @property
    def _rests(self) -> int:
        return sw.TARGET_REACHED if self._lead.stands else 0


class Position(ModuleMode):
    """Profile position: each rising edge of bit 4 gives the trapezoid a new target; a halt discards it."""

    _waiting: float | None = None  # turns: a target that was accepted under halt
    _acknowledged = False

    def step(self, word: int, edge: int) -> None:
        """Take a set-point and start the move; a set-point taken under halt starts when the halt is over."""
        self._take(word, edge)
        goal, self._waiting = self._waiting, None
        if goal is not None:
            profile = self._profile
            self._lead.go(goal, profile.speed, profile.up, profile.down)

    def halt(self, word: int, edge: int, first: bool) -> None:
        """Brake to standstill; a set-point is still accepted."""
        super().halt(word, edge, first)
        self._take(word, edge)

    def _take(self, word: int, edge: int) -> None:
        target = self._targets.position
        if edge & cw.NEW_SET_POINT and target is not None and self._profile.complete:
            self._waiting, self._acknowledged = self._means.hearing.place.turns_at(target), True
        self._acknowledged = self._acknowledged and bool(word & cw.NEW_SET_POINT)

    def bits(self, halted: bool) -> int:
        """Bit 12: the set-point was accepted. Bit 10: it is reached."""
        reached = self._rests if halted or self._lead.goal is None else self._reached
        return reached | (sw.SET_POINT_ACKNOWLEDGE if self._acknowledged else 0)

    @property
    def _reached(self) -> int:
        hearing, lead = self._means.hearing, self._lead
        if hearing.beat is None or hearing.beat_at <= lead.goal_at + _LATER or self._waiting is not None:
            return 0
        done = None if self._means.settings.relayed else hearing.beat.trajectory_done
        if done is None:
            here = hearing.place.turns
            done = (
                here is not None
                and lead.goal is not None
                and abs(here - lead.goal) * TURN <= _CLOSE
                and lead.stands
            )
        return sw.TARGET_REACHED if done else 0


class Velocity(ModuleMode):
    """Profile velocity: the ramps are computed here, never steeper than the module's own ramp, which cannot be set."""

    _ramped = 0.0  # turns/s

    def begin(self) -> None:
        """Continue at the rotor's velocity, and ramp from there."""
        self._ramped = self._lead.velocity or 0.0
        self._lead.turn(self._ramped)

    def step(self, word: int, edge: int) -> None:  # noqa: ARG002
        """Send the next velocity of the ramp."""
        self._ramp(self._wanted)

    def halt(self, word: int, edge: int, first: bool) -> None:  # noqa: ARG002
        self._ramp(0.0)

    @property
    def _wanted(self) -> float:
        most = self._means.settings.velocity_limit
        return max(-most, min(most, self._targets.velocity / TURN))

    def _ramp(self, wanted: float) -> None:
        """Slow down, also through 0, with the deceleration; speed up with the acceleration, and not at all if it is 0."""
        now, most = self._ramped, self._means.settings.velocity_ramp
        slows = abs(wanted) < abs(now) or wanted * now < 0.0
        rate = min(self._profile.down if slows else self._profile.up, most)
        aim = 0.0 if wanted * now < 0.0 else wanted
        change = rate * self._means.settings.period
        self._ramped = max(now - change, aim) if aim < now else min(now + change, aim)
        self._lead.turn(self._ramped)

    def bits(self, halted: bool) -> int:
        """Bit 12: velocity 0. Bit 10: the velocity is reached."""
        velocity = self._lead.velocity
        if velocity is None:
            return 0
        wanted = 0.0 if halted else self._wanted
        reached = abs(velocity - wanted) <= max(MOVES, _IN_VELOCITY * abs(wanted))
        return (sw.TARGET_REACHED if reached else 0) | (sw.SPEED_ZERO if abs(velocity) <= MOVES else 0)


class Torque(ModuleMode):
    """Profile torque on the module's torque ramp; a halt brakes by velocity 0, since no torque can brake."""

    _ramped = 0.0  # N·m

    def begin(self) -> None:
        """Command torque 0."""
        self._ramped = 0.0
        self._lead.push(0.0)

    def step(self, word: int, edge: int) -> None:  # noqa: ARG002
        """Send the next torque of the slope; a module that was braked on a serial line stays braked."""
        if self._lead.is_braked:
            self._lead.turn(0.0)
            return
        wanted = self._profile.torque(self._targets.torque)
        change = self._profile.slope * self._means.settings.period
        self._ramped = max(self._ramped - change, min(self._ramped + change, wanted))
        self._lead.push(self._ramped)

    def halt(self, word: int, edge: int, first: bool) -> None:  # noqa: ARG002
        """Brake on the module's velocity ramp; the torque starts from 0 afterwards.

        On a serial line the brake cannot be left under power: an axis at standstill that got no torque yet is not braked.
        """
        at_rest = self._lead.is_pushed and not self._ramped and not self._lead.moves
        self._ramped = 0.0
        if self._means.settings.relayed and at_rest:
            self._lead.push(0.0)
        else:
            self._lead.turn(0.0)

    def bits(self, halted: bool) -> int:
        """Bit 10: the slope has ended; under halt: the motor is at standstill."""
        reached = self._ramped == self._profile.torque(self._targets.torque)
        return self._rests if halted else sw.TARGET_REACHED if reached else 0


class ModuleCsp(ModuleMode):
    """Cyclic synchronous position: the module follows each target, and holds the last one if no other follows."""

    _follows = _given = False

    def step(self, word: int, edge: int) -> None:  # noqa: ARG002
        """Send the target of this cycle; if the mode was changed in motion, only after the motor has come to standstill."""
        target = self._targets.stream
        self._follows = self._follows or self._lead.stands
        if target is None or not self._follows:
            return
        mode = TRAPEZOID if self._means.settings.filter_bandwidth is None else FILTER
        first, self._given = not self._given, True
        self._lead.follow(mode, self._means.hearing.place.turns_at(target), first=first)

    def halt(self, word: int, edge: int, first: bool) -> None:
        """Brake to standstill along a trajectory."""
        super().halt(word, edge, first)
        self._follows = self._given = False

    def bits(self, halted: bool) -> int:
        """Bit 12: the drive follows the command."""
        return sw.FOLLOWS_COMMAND if self._follows and not halted else 0


class ModuleHoming(ModuleMode):
    """Homing in place (methods 35 and 37): the present position becomes 607Ch; nothing moves and nothing is sent.

    Set_Linear_Count would shift the estimate while the position loop holds it, which would cause a jump.
    """

    _bits = 0
    _since: float | None = None  # start time; None: not running

    def begin(self) -> None:
        """Brake to standstill and hold; with torque 0 on a serial line, where torque control cannot be left under power."""
        if self._means.settings.relayed and self._lead.is_pushed:
            self._lead.push(0.0)
        else:
            super().begin()

    def step(self, word: int, edge: int) -> None:  # noqa: ARG002
        """Home at the rising edge of bit 4, as soon as the motor is at standstill."""
        if edge & cw.HOMING_START:
            self._bits, self._since = 0, self._lead.now
        if self._since is None:
            return
        values = self._profile.values
        if values[objects.HOMING_METHOD] not in homing.IN_PLACE or self._lead.now - self._since > _STANDS_BY:
            self._bits, self._since = sw.HOMING_ERROR, None
        elif self._lead.stands:
            self._means.hearing.place.home(values[objects.HOME_OFFSET])
            self._bits, self._since = sw.HOMING_ATTAINED, None

    def bits(self, halted: bool) -> int:  # noqa: ARG002
        """Bit 12: homing attained. Bit 13: homing error. Bit 10: standstill."""
        return self._bits | self._rests


MODES: dict[int, type[ModuleMode]] = {
    _M.PROFILE_POSITION: Position,
    _M.PROFILE_VELOCITY: Velocity,
    _M.PROFILE_TORQUE: Torque,
    _M.HOMING: ModuleHoming,
    _M.CYCLIC_SYNC_POSITION: ModuleCsp,
}


def modes_of(settings: ModuleSettings) -> dict[int, type[ModuleMode]]:
    """Return the modes that a module supports with its settings: torque needs the torque settings.

    On a serial line only modes remain that need a single control and input mode from idle to idle: the two are separate registers,
    and the behaviour of a module under power between the two writes is unknown.
    """
    left_out = () if settings.torque is not None else (_M.PROFILE_TORQUE,)
    wanted = (settings.line_mode, _M.HOMING) if settings.relayed else tuple(MODES)
    return {mode: kind for mode, kind in MODES.items() if mode in wanted and mode not in left_out}
