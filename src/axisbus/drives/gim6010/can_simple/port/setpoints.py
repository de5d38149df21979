"""What leads the motor in closed loop: a place, a velocity or a torque, given so that the module holds when nothing follows.

Theory of operation
-------------------
The module keeps three things that a frame of another kind may leave behind: control and input mode, the trapezoid's limits, and the
last input. So each way of leading sends what it needs anew, the mode first where it is another one, and feeds nothing forward.
A change of mode in motion is followed at once, in the same batch of frames, by the place at which the motor can come to rest: the
module plans from the velocity that it has.
"""

from __future__ import annotations

import math

from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.port.command_frames import TORQUE, TRAPEZOID, VELOCITY, Orders
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings

MOVES = 0.01  # turns/s: less is noise of a standing rotor
_STANDS = 0.06  # s at less than that
_DELAY = 0.01  # s until a frame takes effect
_SPARE = 1.02  # of a braking distance, which a trapezoid that comes to its end early would have to go back
_REPEAT = 0.05  # s after which a velocity or torque that has not changed is given again
_NEAR = 1e-3  # turns
_SLOWEST = 1e-3  # turns/s, of a trapezoid


class ModuleSetPoints:
    """Holds what the module was given last, and the frames that are to go out; ``now`` is that of the cycle, in s."""

    def __init__(self, settings: ModuleSettings, orders: Orders, hearing: ModuleFeedback) -> None:
        self.frames: list[Outgoing] = []
        self.now = 0.0
        self._settings = settings
        self._orders = orders
        self._place = hearing.place
        self._mode: tuple[int, int] | None = None
        self.goal: float | None = None  # turns: of a trajectory that was given
        self.goal_at = -math.inf
        self._rates = (0.0, 0.0)  # of it: up and down
        self._input: float | None = None  # velocity or torque
        self._given_at = -math.inf
        self._slow_since: float | None = None

    # What is seen.

    @property
    def velocity(self) -> float | None:
        """The rotor's velocity in turns/s; None where no fresh estimate tells it."""
        stamp = self._place.velocity_stamp
        return (
            self._place.velocity if stamp is not None and self.now - stamp <= self._settings.fresh else None
        )

    @property
    def moves(self) -> bool:
        """Whether the rotor turns; where nobody knows, it does."""
        velocity = self.velocity
        return velocity is None or abs(velocity) > MOVES

    @property
    def stands(self) -> bool:
        """Whether it has stood for a while, by what was heard over that time."""
        stamp = self._place.velocity_stamp
        return self._slow_since is not None and stamp is not None and stamp - self._slow_since >= _STANDS

    @property
    def is_braked(self) -> bool:
        """Whether it was braked by velocity 0, on a line where its mode is not changed back under power."""
        return self._settings.relayed and self._mode == VELOCITY

    def look(self, now: float) -> None:
        """A cycle begins."""
        self.now = now
        if self.moves:
            self._slow_since = None
        elif self._slow_since is None:
            self._slow_since = self._place.velocity_stamp

    # What is given.

    def forget(self) -> None:
        """The module lets go, or is another's: what it was given counts no longer."""
        self._mode, self.goal, self._input = None, None, None

    def use(self, mode: tuple[int, int]) -> bool:
        """Set control and input mode; return whether they were others before."""
        if self._mode == mode:
            return False
        self.frames.append(self._orders.mode(mode))
        self._mode, self._input = mode, None
        return True

    def go(self, turns: float, speed: float, up: float, down: float) -> None:
        """Go to a place along a trapezoid: ``speed`` in turns/s, ``up`` and ``down`` in turns/s², all above 0."""
        self.use(TRAPEZOID)
        speed = max(min(speed, self._settings.velocity_limit), _SLOWEST)
        self.frames += [*self._orders.profile(speed, up, down), self._orders.position(turns)]
        self.goal, self.goal_at, self._rates = turns, self.now, (up, down)
        self._given_at = self.now

    def follow(self, mode: tuple[int, int], turns: float, *, first: bool) -> None:
        """Give the next place of a stream, which the module comes up with in ``mode``; ``first``: none was given before it."""
        self.use(mode)
        if first and mode == TRAPEZOID:
            rate = self._settings.acceleration
            self.frames += self._orders.profile(self._settings.velocity_limit, rate, rate)
        self.frames.append(self._orders.position(turns))
        self.goal, self.goal_at, self._given_at = turns, self.now, self.now
        self._rates = (self._settings.acceleration,) * 2

    def turn(self, velocity: float) -> None:
        """Go on at a velocity, in turns/s."""
        self._give(VELOCITY, velocity)

    def push(self, torque: float) -> None:
        """Push with a torque, in N·m."""
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
        """Come to rest by a trajectory that brakes with ``down`` (turns/s², above 0), and hold there.

        Where nobody knows how fast the rotor is, by velocity 0 on the module's own ramp.
        """
        here, velocity = self._place.turns, self.velocity
        if here is None or velocity is None:
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
            return  # it brakes already, to a place before that
        self.go(end, 1.1 * speed, down, down)

    def _way_to_rest(self, here: float, velocity: float, down: float) -> tuple[float, float]:
        """Return the signed way, and the speed from which it is braked: one that may have grown since it was measured."""
        stamp = self._place.velocity_stamp or self.now
        delay = self.now - stamp + _DELAY
        ahead = 0.0 if self.goal is None else self.goal - here
        speed = abs(velocity) + (
            self._rates[0] * delay if ahead * velocity >= 0.0 and self.goal is not None else 0.0
        )
        speed = min(speed, max(self._settings.velocity_limit, abs(velocity)))
        way = speed * delay + _SPARE * speed * speed / (2.0 * down)
        return math.copysign(way, velocity or ahead), speed

    # What keeps the module's own watch over its master quiet.

    def feed(self) -> None:
        """Give an input that changes nothing, where the module lets go without any and none was given for a while."""
        timeout = self._settings.break_timeout
        if not timeout or self.now - self._given_at < timeout / 4.0:
            return
        if self._mode == TORQUE:
            self.frames.append(self._orders.torque(self._input or 0.0))
        elif self._mode in (None, VELOCITY):
            self.frames.append(self._orders.velocity(self._input or 0.0))
        else:
            self.frames.append(self._orders.torque(0.0))  # what is fed forward: nothing
        self._given_at = self.now
