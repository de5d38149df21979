"""A motor with its load, advanced by dt: it tracks a demand with a small lag, or is driven by torque, or coasts.

Theory of operation
-------------------
Positions are increments of the motor's own count (no home offset, no polarity), velocities increments/s, torques per mille of the
rated torque. There are two functions to advance by ``dt``. Both use closed formulas, so that 0.1 ms and 20 ms give the same motion:

- ``track``: a position controller. The error to a demand that moves evenly within the step decays with the time constant ``lag``;
  at constant speed the motor trails by ``speed * lag``. If that would need more torque than allowed, the motor is *pursued* in
  small steps at the torque limit instead, as a drive in current limit does.
- ``push``: torque against load, dry and viscous friction and the brake. The velocity decays exponentially between two instants at
  which dry friction changes its sign; a motor at rest stays at rest until the torque overcomes friction.

End stops, a blocked rotor, the closed brake and the breakaway torque act in both. ``compliant`` contains a motor on a spring.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_PURSUIT_STEP = 0.001  # s
_BRAKE_TORQUE = 10_000.0  # ‰ of rated torque: more than any motor has
_AT_REST = 1e-3  # increments: a tracking error below it counts as 0


@dataclass(frozen=True, slots=True)
class MotorParams:
    """Motor, load and machine, in increments of position, seconds, and per mille of rated torque.

    ``rated_acceleration`` (increments/s²) is the acceleration of the load by the rated torque; ``coasting`` (s) the time constant
    of viscous friction; ``friction`` dry friction; ``load`` a constant force towards negative positions, as in a vertical axis.
    ``velocity_unit`` and ``acceleration_unit`` are the drive's velocity and acceleration increments per increment/s and
    increment/s². Switches and stops are positions in the motor's count, which begins at ``start_position``; None: not present. A
    home switch is active between its two positions, limit switches from theirs outwards. ``noise`` is added to the measured
    position, evenly distributed in ±noise. ``stiffness`` (‰ of rated torque per increment) makes it a motor on a spring that rings
    with ``damping`` (share of the critical damping, below 1); 0: the controller leaves no error at rest, independent of the load.
    ``wraps``: whether the drive takes the shorter way to a target past the end of its INTEGER32 count; some go the long way round.
    """

    increments_per_turn: int = 16384
    start_position: float = 0.0
    lag: float = 0.002
    rated_acceleration: float = 2.0e6
    max_torque: float = 3000.0
    friction: float = 20.0
    coasting: float = 0.5
    load: float = 0.0
    velocity_unit: float = 1.0
    acceleration_unit: float = 1.0
    end_stops: tuple[float | None, float | None] = (None, None)
    limit_switches: tuple[float | None, float | None] = (None, None)
    home_switch: tuple[float, float] | None = None
    index_offset: float = 0.0
    brake: bool = False
    brake_opens: float = 0.02
    brake_closes: float = 0.02
    noise: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.2
    wraps: bool = True


class Motor:
    """Position, velocity and torque of one motor: the mechanical state."""

    __slots__ = (
        "_decay",
        "_decay_dt",
        "_demand",
        "_gain",
        "_high",
        "_lag",
        "_low",
        "_tolerance",
        "_viscous",
        "blocked",
        "brake_closed",
        "feed_forward",
        "params",
        "position",
        "pull",
        "saturated",
        "sticks",
        "torque",
        "velocity",
    )

    def __init__(self, params: MotorParams) -> None:
        self.params = params
        self.position = params.start_position
        self.velocity = 0.0
        self.torque = 0.0
        self.brake_closed = params.brake
        self.blocked = False  # the rotor is held mechanically
        self.pull = 0.0  # ‰ of rated torque towards negative positions, beside the load: by coupled motors
        self.sticks = 0.0  # breakaway torque in ‰ of rated torque, in addition to friction
        self.feed_forward = 0.0  # velocity feed-forward of the last step
        self.saturated = False  # the last step ran at the torque limit
        self._lag = max(params.lag, 1e-5)
        self._gain = params.rated_acceleration / 1000.0  # increments/s² per ‰
        self._tolerance = self._gain * self._lag * self._lag
        self._viscous = 1.0 / params.coasting if params.coasting > 0 else 0.0  # 1/s
        low, high = params.end_stops
        self._low = -math.inf if low is None else low
        self._high = math.inf if high is None else high
        self._demand = self.position
        self._decay_dt = self._decay = 0.0

    @property
    def load(self) -> float:
        """Force towards negative positions in ‰ of rated torque: of its load, and of coupled motors."""
        return self.params.load + self.pull

    @property
    def error(self) -> float:
        """Demand of the last ``track`` minus position."""
        return self._demand - self.position

    def restart_tracking(self) -> float:
        """Begin tracking from the motor's position and velocity; return the matching demand (one lag ahead of it)."""
        self._demand = self.position + self.velocity * self._lag
        self.feed_forward = 0.0
        return self._demand

    def rewind(self, velocity: float) -> float:
        """Discard the error that a blocked motor has accumulated (a velocity controller has none); return the matching demand."""
        self._demand = self.position + velocity * self._lag
        self.feed_forward = 0.0
        return self._demand

    def track(
        self,
        demand: float,
        dt: float,
        limit: float,
        feed_forward: float = 0.0,
        push: float = 0.0,  # noqa: ARG002
    ) -> None:
        """Follow a demand that moves evenly to ``demand`` within ``dt`` (> 0 s), with at most ``limit`` ‰ of torque.

        ``feed_forward`` (increments/s) is a velocity feed-forward, for which the controller needs no error. The controller
        compensates an additional torque (``push``, ‰) at once: it has no effect.
        """
        before, self._demand = self._demand, demand
        previous_feed_forward, self.feed_forward = self.feed_forward, feed_forward
        rate = (demand - before) / dt
        if self.sticks > 0.0 and self._stuck(limit):
            return
        trailing = (rate - feed_forward) * self._lag
        if dt != self._decay_dt:
            self._decay_dt, self._decay = dt, math.exp(-dt / self._lag)
        error = trailing + (before - self.position - trailing) * self._decay
        if rate == feed_forward == 0.0 and -_AT_REST < error < _AT_REST:
            error = 0.0
        velocity = error / self._lag + feed_forward
        position = demand - error
        torque = self._torque_for((velocity - self.velocity) / dt, velocity)
        misfit = (
            before - self.position - (self.velocity - previous_feed_forward) * self._lag
        )  # 0 unless demand or motor has jumped
        if (
            -limit <= torque <= limit
            and abs(misfit) <= limit * self._tolerance
            and not (self.blocked or self.brake_closed)
            and self._low <= position <= self._high
        ):
            self.position, self.velocity, self.torque, self.saturated = position, velocity, torque, False
            return
        self._pursue(before, rate, dt, limit)

    def _stuck(self, limit: float) -> bool:
        """Whether a motor at standstill does not move: the controller's torque is the error times its stiffness."""
        if self.velocity != 0.0:
            return False
        wanted = self.error / self._tolerance
        if abs(wanted) > self.sticks and self.sticks < limit:
            return False
        self.torque = max(-limit, min(limit, wanted + self.load))
        self.saturated = abs(wanted) >= limit
        return True

    def push(self, torque: float, dt: float) -> None:
        """Apply a torque of ``torque`` ‰ for ``dt`` seconds (0: the motor coasts)."""
        self.torque = torque
        self._demand = self.position
        self.feed_forward = 0.0
        self.saturated = False
        if self.blocked:
            self.velocity = 0.0
            return
        dry = self._dry_friction()
        while dt > 0.0:
            dt = self._push_piece(torque - self.load, dry, dt)
        self._stop_at_ends()
        self._demand = self.position

    def _push_piece(self, net: float, dry: float, dt: float) -> float:
        """Advance to the next instant at which friction changes its direction, at most ``dt``; return the time left."""
        velocity = self.velocity
        if velocity == 0.0:
            if abs(net) <= dry + self.sticks:
                return 0.0
            direction = 1.0 if net > 0.0 else -1.0
        else:
            direction = 1.0 if velocity > 0.0 else -1.0
        push = (net - direction * dry) * self._gain
        time = self._time_to_rest(velocity, push, direction)
        ends = time <= dt
        time = min(time, dt)
        if self._viscous > 0.0:
            final = push / self._viscous
            decay = math.exp(-self._viscous * time)
            self.position += final * time + (velocity - final) * (1.0 - decay) / self._viscous
            self.velocity = final + (velocity - final) * decay
        else:
            self.position += (velocity + 0.5 * push * time) * time
            self.velocity = velocity + push * time
        if ends:
            self.velocity = 0.0
        return dt - time

    def _time_to_rest(self, velocity: float, push: float, direction: float) -> float:
        """Return the time until the velocity is zero, infinity if it never is."""
        if velocity == 0.0 or push * direction >= 0.0:
            return math.inf
        if self._viscous <= 0.0:
            return -velocity / push
        final = push / self._viscous
        return math.log((velocity - final) / -final) / self._viscous

    def _pursue(self, before: float, rate: float, dt: float, limit: float) -> None:
        """Pursue the demand with limited torque, in small steps."""
        self.saturated = True
        if self.blocked:
            self.velocity = 0.0
            self.torque = math.copysign(limit, self.error) if abs(self.error) > 1.0 else 0.0
            return
        dry = self._dry_friction()
        spare = max(0.1 * limit, limit - abs(self.load) - dry) * self._gain
        steps = max(1, math.ceil(dt / _PURSUIT_STEP - 1e-9))
        h = dt / steps
        for number in range(1, steps + 1):
            error = before + rate * h * number - self.position
            speed = min(abs(error) / (self._lag + h), math.sqrt(spare * abs(error)))
            wanted = rate + math.copysign(speed, error)
            torque = self._torque_for((wanted - self.velocity) / h, wanted)
            self._push_limited(max(-limit, min(limit, torque)), dry, wanted, h)
        self._stop_at_ends()

    def _push_limited(self, torque: float, dry: float, wanted: float, h: float) -> None:
        """Advance one small step with a given torque; a closed brake or friction may hold the motor."""
        velocity = self.velocity
        self.torque = torque
        net = torque - self.load
        if velocity == 0.0 and abs(net) <= dry + self.sticks:
            return
        direction = math.copysign(1.0, velocity if velocity else net)
        acceleration = (net - direction * dry) * self._gain - velocity * self._viscous
        after = velocity + acceleration * h
        if velocity and after * velocity < 0.0 and abs(net) <= dry:
            after = 0.0
        if (wanted - velocity) * (wanted - after) < 0.0 and not self.brake_closed:
            after = wanted
        self.velocity = after
        self.position += 0.5 * (velocity + after) * h

    def _torque_for(self, acceleration: float, velocity: float) -> float:
        torque = self.load + (acceleration + velocity * self._viscous) / self._gain
        if velocity > 0.0:
            return torque + self.params.friction
        if velocity < 0.0:
            return torque - self.params.friction
        return torque

    def _dry_friction(self) -> float:
        return self.params.friction + self._brake_torque()

    def _brake_torque(self) -> float:
        return _BRAKE_TORQUE if self.brake_closed else 0.0

    def _stop_at_ends(self) -> None:
        if not self._low <= self.position <= self._high:
            self.position = min(max(self.position, self._low), self._high)
            self.velocity = 0.0
