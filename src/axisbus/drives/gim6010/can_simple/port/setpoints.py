"""Set-points of a module in closed loop: position, velocity or torque, sent so that the module holds if no further frame follows.

Theory of operation
-------------------
The module stores three things that an earlier frame of another kind may have set: control and input mode, the limits of the
trapezoid, and the last input. Therefore each command sends all that it needs; if the mode changes, the mode is sent first. The
feed-forward values are always 0. If the mode changes in motion, the position at which the motor can come to rest follows at once,
in the same batch of frames: the module plans its trajectory from its present velocity.
"""

from __future__ import annotations

import math

from axisbus.cia402.modes import ModeOfOperation
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.orders import TORQUE, TRAPEZOID, VELOCITY, Orders
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.settings import FEEDS, ModuleSettings

MOVES = 0.01  # turns/s: less is noise of a rotor at standstill
_STANDS = 0.06  # s below that velocity, for standstill
_DELAY = 0.01  # s until a frame takes effect
_SPARE = 1.02  # factor on a braking distance: with a distance too short, the trapezoid would overshoot and move back
_REPEAT = 0.05  # s after which an unchanged velocity or torque is sent again
_NEAR = 1e-3  # turns
_SLOWEST = 1e-3  # turns/s, of a trapezoid
_TINY = 1e-6  # s
# The control and input mode in which a module on a serial line is enabled.
BY_LINE = {
    ModeOfOperation.PROFILE_POSITION: TRAPEZOID,
    ModeOfOperation.PROFILE_VELOCITY: VELOCITY,
    ModeOfOperation.PROFILE_TORQUE: TORQUE,
}


class ModuleSetPoints:
    """The last set-points sent, and the frames to be sent; ``now`` is the time of the cycle, in s."""

    def __init__(self, settings: ModuleSettings, orders: Orders, hearing: ModuleFeedback) -> None:
        self.frames: list[Outgoing] = []
        self.now = 0.0
        self._settings = settings
        self._orders = orders
        self._place = hearing.place
        self._mode: tuple[int, int] | None = None
        self.goal: float | None = None  # turns: end of the trajectory that was commanded
        self.goal_at = -math.inf
        self._rates = (0.0, 0.0)  # its acceleration and deceleration, turns/s²
        self._input: float | None = None  # velocity or torque
        self._given_at = -math.inf
        self._slow_since: float | None = None
        self._timeout = 0.0  # s: the shortest armed time-out of the module

    # Observed motion.

    @property
    def velocity(self) -> float | None:
        """Velocity of the rotor in turns/s; None if no recent estimate is known."""
        stamp = self._place.velocity_stamp
        return (
            self._place.velocity if stamp is not None and self.now - stamp <= self._settings.fresh else None
        )

    @property
    def moves(self) -> bool:
        """Whether the rotor turns; True also if the velocity is unknown."""
        velocity = self.velocity
        return velocity is None or abs(velocity) > MOVES

    @property
    def stands(self) -> bool:
        """Whether the rotor has been at standstill for ``_STANDS``, by the estimates received over that time."""
        stamp = self._place.velocity_stamp
        return self._slow_since is not None and stamp is not None and stamp - self._slow_since >= _STANDS

    @property
    def is_braked(self) -> bool:
        """Whether the module was braked by velocity 0 on a serial line, where its mode is not changed back under power."""
        return (
            self._settings.relayed
            and self._mode == VELOCITY
            and self._settings.line_mode is not ModeOfOperation.PROFILE_VELOCITY
        )

    @property
    def is_pushed(self) -> bool:
        """Whether the module is in torque control."""
        return self._mode == TORQUE

    def look(self, now: float) -> None:
        self.now = now
        if self.moves:
            self._slow_since = None
        elif self._slow_since is None:
            self._slow_since = self._place.velocity_stamp

    # Commands.

    def forget(self) -> None:
        """Discard the last set-points: the module is switching to idle, or another master controls it."""
        self._mode, self.goal, self._input = None, None, None

    def lose(self) -> None:
        """Note that the last frames did not reach the module: no set-point counts as sent."""
        self.forget()
        self._given_at = -math.inf

    def use(self, mode: tuple[int, int]) -> bool:
        if self._mode == mode:
            return False
        self.frames.append(self._orders.mode(mode))
        self._mode, self._input = mode, None
        return True

    def go(self, turns: float, speed: float, up: float, down: float) -> None:
        """Move to a position along a trapezoid: ``speed`` in turns/s, ``up`` and ``down`` in turns/s², all above 0."""
        self.use(TRAPEZOID)
        speed = max(min(speed, self._settings.velocity_limit), _SLOWEST)
        self.frames += [*self._orders.profile(speed, up, down), self._orders.position(turns)]
        self.goal, self.goal_at, self._rates = turns, self.now, (up, down)
        self._given_at = self.now

    def follow(self, mode: tuple[int, int], turns: float, *, first: bool) -> None:
        """Send the next position of a stream, for the module to approach in ``mode``; ``first``: none was sent before it."""
        self.use(mode)
        if first and mode == TRAPEZOID:
            rate = self._settings.acceleration
            self.frames += self._orders.profile(self._settings.velocity_limit, rate, rate)
        self.frames.append(self._orders.position(turns))
        self.goal, self.goal_at, self._given_at = turns, self.now, self.now
        self._rates = (self._settings.acceleration,) * 2

    def turn(self, velocity: float) -> None:
        """Command a velocity in turns/s."""
        self._give(VELOCITY, velocity)

    def push(self, torque: float) -> None:
        """Command a torque in N·m."""
        self._give(TORQUE, torque)

    def _give(self, mode: tuple[int, int], value: float) -> None:
        self.use(mode)
        self.goal = None
        if value == self._input and self.now - self._given_at < _REPEAT:
            return
        make = self._orders.velocity if mode == VELOCITY else self._orders.torque
        self.frames.append(make(value))
        self._input, self._given_at = value, self.now

    def rest(self, down: float) -> None:
        """Brake to standstill along a trajectory with deceleration ``down`` (turns/s², above 0), and hold there.

        If position or velocity is unknown, or a module on a serial line is not in position control, command velocity 0 on the
        module's own ramp.
        """
        here, velocity = self._place.turns, self.velocity
        has_positions = not self._settings.relayed or BY_LINE[self._settings.line_mode] == TRAPEZOID
        if here is None or velocity is None or not has_positions:
            self.turn(0.0)
            return
        if abs(velocity) <= MOVES and (self.goal is None or abs(self.goal - here) <= _NEAR):
            self.use(TRAPEZOID)
            return
        way, speed = self._way_to_rest(here, velocity, down)
        end = here + way
        if (
            self._mode == TRAPEZOID
            and self.goal is not None
            and (self.goal - end) * way < 0.0 < (self.goal - here) * way
        ):
            return  # it already brakes, to a position before that one
        self.go(end, 1.1 * speed, down, down)

    def _way_to_rest(self, here: float, velocity: float, down: float) -> tuple[float, float]:
        """Return the signed braking distance and the initial speed, which may have increased since the last measurement."""
        stamp = self._place.velocity_stamp or self.now
        delay = self.now - stamp + _DELAY
        ahead = 0.0 if self.goal is None else self.goal - here
        speed = abs(velocity) + (
            self._rates[0] * delay if ahead * velocity >= 0.0 and self.goal is not None else 0.0
        )
        speed = min(speed, max(self._settings.velocity_limit, abs(velocity)))
        way = speed * delay + _SPARE * speed * speed / (2.0 * down)
        return math.copysign(way, velocity or ahead), speed

    # Keeping the module's watchdogs for its master from expiring.

    def feed_within(self, timeout: float) -> None:
        """Set the shortest armed time-out, as read from the module, in s; 0: none is armed, or it was not read."""
        self._timeout = timeout

    def feed(self, *, at_once: bool = False) -> None:
        """Repeat an input without effect, if a time-out is armed and a quarter of it would pass before the next cycle.

        ``at_once``: feed even if an input was sent in this quarter.
        """
        if not self._timeout:
            return
        next_cycle = self.now + self._settings.period
        if not at_once and next_cycle - self._given_at <= self._timeout / FEEDS + _TINY:
            return
        if self._mode == TORQUE:
            self.frames.append(self._orders.torque(self._input or 0.0))
        elif self._mode in (None, VELOCITY):
            self.frames.append(self._orders.velocity(self._input or 0.0))
        else:
            self.frames.append(self._orders.torque(0.0))  # feed-forward 0
        self._given_at = self.now
