"""Velocity, acceleration and jerk in every cycle of axes that the master controls, as shares of the limits, from positions."""

from __future__ import annotations

from dataclasses import dataclass, field

from kit.cell import Cell

VELOCITY, ACCELERATION, JERK = LIMITS = "max_velocity", "max_acceleration", "jerk of a way"
MOST = 1.0 + 1e-9  # of a limit, with the rounding error of the arithmetic


@dataclass
class Worst:
    """The highest share of each limit so far, and where it was seen (a line of the play)."""

    shares: dict[str, tuple[float, str]] = field(default_factory=lambda: dict.fromkeys(LIMITS, (0.0, "")))
    cycles: int = 0

    def see(self, limit: str, share: float, where: str) -> None:
        """Take a share of one limit."""
        self.shares[limit] = max(self.shares[limit], (share, where))

    def join(self, other: Worst) -> None:
        """Add the observations of another play."""
        for limit, seen in other.shares.items():
            self.see(limit, *seen)
        self.cycles += other.cycles


@dataclass
class _Seen:
    """The last places of one axis, and its velocity and acceleration by their differences."""

    place: float | None = None
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass
class Ledger:
    """Looks at each cycle of a cell; ``jerk`` (unit/s³) is that of the running motion, None without a limit.

    An axis without a motion is at standstill: its velocity and acceleration begin at 0.
    """

    cell: Cell
    period: float
    worst: Worst = field(default_factory=Worst)
    jerk: float | None = None
    what: str = ""

    def __post_init__(self) -> None:
        self._seen = {axis.name: _Seen() for axis in self.cell.machine}
        self.cell.each_cycle(self._look)

    def _look(self, _now: float, _snapshots: object) -> None:
        for name, seen in self._seen.items():
            path = self.cell.core(name).active_path
            path = path if path is None else path.commanding_path
            if path is None or path._step is None:
                seen.place, seen.velocity, seen.acceleration = None, 0.0, 0.0
                continue
            self._take(name, seen, path.last_step.position)

    def _take(self, name: str, seen: _Seen, place: float) -> None:
        before, seen.place = seen.place, place
        if before is None:
            return
        limits, worst, t = self.cell.core(name).parameters.limits, self.worst, self.period
        velocity = (place - before) / t
        acceleration = (velocity - seen.velocity) / t
        change = (acceleration - seen.acceleration) / t
        worst.cycles += 1
        worst.see(VELOCITY, abs(velocity) / limits.velocity, self.what)
        worst.see(ACCELERATION, abs(acceleration) / limits.acceleration, self.what)
        if self.jerk is not None:
            worst.see(JERK, abs(change) / self.jerk, self.what)
        seen.velocity, seen.acceleration = velocity, acceleration
