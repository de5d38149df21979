"""The modes of operation over a module: what each gives it in a cycle, and what bits 10, 12 and 13 of the statusword are in it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import homing, objects
from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Outputs
from axisbus.drives.gim6010.can_simple.port.command_frames import FILTER, TRAPEZOID
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.profile import ModuleProfile
from axisbus.drives.gim6010.can_simple.port.setpoints import MOVES, ModuleSetPoints
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN

_M = ModeOfOperation
_CLOSE = 64  # counts to a goal, where the heartbeat does not say that a trajectory is done
_LATER = 0.02  # s after a set-point from which on a heartbeat speaks of it
_STANDS_BY = 1.0  # s in which a motor that is to be homed in place has to be seen to stand
_IN_VELOCITY = 0.05  # of the velocity asked for


@dataclass(slots=True)
class Targets:
    """What was asked for last; ``stream`` is the target position of this very cycle."""

    position: int | None = None
    velocity: int = 0
    torque: int = 0
    stream: int | None = None

    def take(self, outputs: Outputs) -> None:
        """Take those of a cycle."""
        self.stream = outputs.target_position
        self.position = self.position if outputs.target_position is None else outputs.target_position
        self.velocity = self.velocity if outputs.target_velocity is None else outputs.target_velocity
        self.torque = self.torque if outputs.target_torque is None else outputs.target_torque


@dataclass(frozen=True, slots=True)
class Means:
    """All that a mode works with."""

    settings: ModuleSettings
    hearing: ModuleFeedback
    lead: ModuleSetPoints
    profile: ModuleProfile
    targets: Targets


class ModuleMode(ABC):
    """One mode, from its beginning to the next one's; ``begin`` finds the motor as it is, and ``halt`` leaves it at rest."""

    def __init__(self, means: Means) -> None:
        self._means = means
        self._lead, self._profile, self._targets = means.lead, means.profile, means.targets

    def begin(self) -> None:
        """Come to rest, and hold."""
        self._lead.rest(self._profile.down)

    @abstractmethod
    def step(self, word: int, edge: int) -> None:
        """Do what a cycle asks for; ``edge``: the bits of the controlword that have risen. Not called while halted."""

    def halt(self, word: int, edge: int, first: bool) -> None:  # noqa: ARG002  # most modes look at no bit then
        """A cycle under halt; ``first``: the first one."""
        if first:
            self._lead.rest(self._profile.down)

    @abstractmethod
    def bits(self, halted: bool) -> int:
        """Return bits 10, 12 and 13."""

    @property
    def _rests(self) -> int:
        return sw.TARGET_REACHED if self._lead.stands else 0


class Position(ModuleMode):
    """Profile position: each rising edge of bit 4 gives the trapezoid a new goal; a halt forgets it."""

    def __init__(self, means: Means) -> None:
        super().__init__(means)
        self._waiting: float | None = None  # turns: a goal that was taken under halt
        self._acknowledged = False

    def step(self, word: int, edge: int) -> None:
        """Take a set-point and go there; what was taken under halt goes once that is over."""
        self._take(word, edge)
        goal, self._waiting = self._waiting, None
        if goal is not None:
            profile = self._profile
            self._lead.go(goal, profile.speed, profile.up, profile.down)

    def halt(self, word: int, edge: int, first: bool) -> None:
        """Come to rest; a set-point is taken all the same."""
        super().halt(word, edge, first)
        self._take(word, edge)

    def _take(self, word: int, edge: int) -> None:
        target = self._targets.position
        if edge & cw.NEW_SET_POINT and target is not None and self._profile.complete:
            self._waiting, self._acknowledged = self._means.hearing.place.turns_at(target), True
        self._acknowledged = self._acknowledged and bool(word & cw.NEW_SET_POINT)

    def bits(self, halted: bool) -> int:
        """Bit 12: the set-point is taken. Bit 10: it is reached."""
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
    """Profile velocity: the ramps are made here, since the module's own one cannot be set, and never harder than that."""

    def __init__(self, means: Means) -> None:
        super().__init__(means)
        self._ramped = 0.0  # turns/s

    def begin(self) -> None:
        """Go on as fast as the rotor is, and ramp from there."""
        self._ramped = self._lead.velocity or 0.0
        self._lead.turn(self._ramped)

    def step(self, word: int, edge: int) -> None:  # noqa: ARG002
        """Give the next velocity of the ramp."""
        self._ramp(self._wanted)

    def halt(self, word: int, edge: int, first: bool) -> None:  # noqa: ARG002
        """Ramp to 0."""
        self._ramp(0.0)

    @property
    def _wanted(self) -> float:
        most = self._means.settings.velocity_limit
        return max(-most, min(most, self._targets.velocity / TURN))

    def _ramp(self, wanted: float) -> None:
        """Slower, also through rest, with the deceleration; faster with the acceleration, and not at all without one."""
        now, most = self._ramped, self._means.settings.velocity_ramp
        slows = abs(wanted) < abs(now) or wanted * now < 0.0
        rate = min(self._profile.down if slows else self._profile.up, most)
        aim = 0.0 if wanted * now < 0.0 else wanted
        change = rate * self._means.settings.period
        self._ramped = max(now - change, aim) if aim < now else min(now + change, aim)
        self._lead.turn(self._ramped)

    def bits(self, halted: bool) -> int:
        """Bit 12: it stands. Bit 10: the velocity is reached."""
        velocity = self._lead.velocity
        if velocity is None:
            return 0
        wanted = 0.0 if halted else self._wanted
        reached = abs(velocity - wanted) <= max(MOVES, _IN_VELOCITY * abs(wanted))
        return (sw.TARGET_REACHED if reached else 0) | (sw.SPEED_ZERO if abs(velocity) <= MOVES else 0)


class Torque(ModuleMode):
    """Profile torque on the module's torque ramp; a halt brakes by velocity 0, since no torque is a brake."""

    def __init__(self, means: Means) -> None:
        super().__init__(means)
        self._ramped = 0.0  # N·m

    def begin(self) -> None:
        """Push with nothing."""
        self._ramped = 0.0
        self._lead.push(0.0)

    def step(self, word: int, edge: int) -> None:  # noqa: ARG002
        """Give the next torque of the slope."""
        wanted = self._profile.torque(self._targets.torque)
        change = self._profile.slope * self._means.settings.period
        self._ramped = max(self._ramped - change, min(self._ramped + change, wanted))
        self._lead.push(self._ramped)

    def halt(self, word: int, edge: int, first: bool) -> None:  # noqa: ARG002
        """Brake on the module's velocity ramp; the torque begins anew after it."""
        self._ramped = 0.0
        self._lead.turn(0.0)

    def bits(self, halted: bool) -> int:
        """Bit 10: the slope is at its end; halted, the motor stands."""
        reached = self._ramped == self._profile.torque(self._targets.torque)
        return self._rests if halted else sw.TARGET_REACHED if reached else 0


class ModuleCsp(ModuleMode):
    """Cyclic synchronous position: the module comes up with each target, and stays at the last one where none follows."""

    def __init__(self, means: Means) -> None:
        super().__init__(means)
        self._follows = self._given = False

    def step(self, word: int, edge: int) -> None:  # noqa: ARG002
        """Give this cycle's target; a motor that a change of mode found moving must have come to rest before."""
        target = self._targets.stream
        self._follows = self._follows or self._lead.stands
        if target is None or not self._follows:
            return
        mode = TRAPEZOID if self._means.settings.filter_bandwidth is None else FILTER
        first, self._given = not self._given, True
        self._lead.follow(mode, self._means.hearing.place.turns_at(target), first=first)

    def halt(self, word: int, edge: int, first: bool) -> None:
        """Come to rest by a trajectory."""
        super().halt(word, edge, first)
        self._follows = self._given = False

    def bits(self, halted: bool) -> int:
        """Bit 12: it follows."""
        return sw.FOLLOWS_COMMAND if self._follows and not halted else 0


class ModuleHoming(ModuleMode):
    """Homing in place (methods 35 and 37): the present place gets the position of 607Ch; nothing moves, and the module is not told.

    Set_Linear_Count would shift the estimate under a loop that holds it, which is a jump.
    """

    def __init__(self, means: Means) -> None:
        super().__init__(means)
        self._bits = 0
        self._since: float | None = None  # when it was begun; None: it is over

    def step(self, word: int, edge: int) -> None:  # noqa: ARG002
        """Home at the rising edge of bit 4, as soon as the motor is seen to stand."""
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
        """Bit 12: home is known. Bit 13: it cannot be found so. Bit 10: it stands."""
        return self._bits | self._rests


MODES: dict[int, type[ModuleMode]] = {
    _M.PROFILE_POSITION: Position,
    _M.PROFILE_VELOCITY: Velocity,
    _M.PROFILE_TORQUE: Torque,
    _M.HOMING: ModuleHoming,
    _M.CYCLIC_SYNC_POSITION: ModuleCsp,
}


_RELAYED = (_M.PROFILE_POSITION, _M.HOMING)


def modes_of(settings: ModuleSettings) -> dict[int, type[ModuleMode]]:
    """Return the modes that a module has by its settings: torques need what makes one of a current.

    On a serial line it has those alone that need one control and input mode from idle to idle: the two are registers of their own,
    and nobody knows what a module does under power between the write of one and of the other.
    """
    if settings.relayed:
        return {mode: MODES[mode] for mode in _RELAYED}
    left_out = () if settings.torque is not None else (_M.PROFILE_TORQUE,)
    return {mode: kind for mode, kind in MODES.items() if mode not in left_out}
