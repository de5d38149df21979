"""Position of a module's rotor in counts: from its estimates in closed loop, from its encoder's counts otherwise.

Theory of operation
-------------------
Get_Encoder_Estimates (0x09) contains the position over turns, but is valid only in closed loop: otherwise it is 0 or arbitrary.
Get_Encoder_Count (0x0A) is valid in every state, but only its position within one turn can be used: its count over turns does not
convert (owners' reports). Therefore the position is the estimate in closed loop. In idle, it continues from there by the change of
the count within the turn, and of the possible turns the one nearest to the expected motion is chosen. The offset between both
(``_phase``) is measured at standstill.

- When idle is requested, estimates are ignored at once (``shut``): the module sends 0 from then on, and its heartbeat shows the
  reason only later. If the module leaves closed loop on its own, an estimate that no rotor can have reached is ignored.
- The first estimate of all determines the position of the module; before it, only the position within the turn is known. The first
  estimate of a later closed loop must agree with the counts. If it does not, the module has a new zero (``lost``), and a homed axis
  is no longer homed.
"""

from __future__ import annotations

from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN
from axisbus.units import wrap

# Counts by which estimate and count may differ: owners saw steps of 0.14 turns after restarts.
_SAME = TURN // 20
_NOISE = TURN // 10
_RESTING = 0.05  # turns/s
_TOGETHER = 0.02  # s at most between an estimate and a count for comparing them
_AGREE = 5  # consecutive impossible estimates that agree with each other
_RECENT = 0.1  # s
_SPAN = 0.1  # s for measuring a velocity by counts: with two close or late counts, the position error would be permanent


class RotorPosition:
    """Position and velocity of the rotor, and the offset between estimates and counts; times in s, velocities in turns/s."""

    def __init__(self, fastest: float) -> None:
        """``fastest``: the velocity limit, in turns/s."""
        self._reach = 2.0 * fastest * TURN  # counts per s that no rotor exceeds
        self.stamp = 0.0
        self.velocity = 0.0
        self.velocity_stamp: float | None = None  # None: no valid estimate now
        self.lost = False
        self._counts: int | None = None  # in the module's count, over turns
        self._offset = 0  # added for the drive's position: set by homing
        self._phase: int | None = None
        self._live = self._joined = self._was_joined = False
        self._astray: int | None = None
        self._misses = 0
        self._from: tuple[int, float] | None = None  # counts, time: start of a velocity measurement in idle

    @property
    def shown(self) -> int | None:
        """The position as a drive counts it (INTEGER32); None while unknown."""
        return None if self._counts is None else wrap(self._counts + self._offset)

    @property
    def joined(self) -> bool:
        """Whether the position is from an estimate of the present closed loop."""
        return self._live and self._joined

    @property
    def turns(self) -> float | None:
        """The position as the module counts it, in turns; None before the first estimate."""
        return self._counts / TURN if self._joined and self._counts is not None else None

    def turns_at(self, shown: int) -> float:
        """Convert a position of the drive into turns of the module; of all that wrap to it, the nearest."""
        assert self._counts is not None
        here = self._counts + self._offset
        return (self._counts + wrap(shown - here)) / TURN

    def home(self, position: int) -> None:
        """Define the present position as ``position``."""
        if self._counts is not None:
            self._offset = position - self._counts

    # Reception.

    def open(self) -> None:
        """Note that the module is in closed-loop control: estimates are valid from now on."""
        if not self._live:
            self._live, self._joined = True, False
            self._astray, self._misses = None, 0

    def shut(self) -> None:
        """Note that closed loop has ended or is about to end: estimates are no longer valid."""
        self._live = self._joined = False
        self.velocity_stamp = None

    def take_estimate(self, turns: float, velocity: float, at: float) -> None:
        """Take Get_Encoder_Estimates, if estimates are valid."""
        if not self._live:
            return
        counts = round(turns * TURN)
        if not self._joined:
            self._join(counts, at)
        elif not self._can_be(counts, velocity, at):
            self._stray(counts)
            return
        self._counts, self._joined, self._was_joined = counts, True, True
        self._from = None
        self._astray, self._misses = None, 0
        self.velocity, self.stamp, self.velocity_stamp = velocity, at, at

    def take_count(self, in_turn: int, at: float) -> None:
        """Take Count_In_Cpr of Get_Encoder_Count."""
        if self._counts is None:
            self._counts, self._phase, self.stamp = in_turn, 0, at
        elif self.joined:
            self._compare(in_turn, at)
        elif self._phase is None:
            self._phase, self.stamp = in_turn - self._counts, at
        else:
            self._go_on(in_turn, at)

    def _join(self, counts: int, at: float) -> None:
        """Take the first estimate of the present closed loop."""
        tracked = self._counts if self._phase is not None else None
        if self._was_joined and tracked is not None and abs(counts - tracked) > _SAME:
            self.lost = True
        if tracked is not None and self._phase is not None and at - self.stamp <= _RECENT:
            self._phase += tracked - counts

    def _can_be(self, counts: int, velocity: float, at: float) -> bool:
        """Whether the rotor can be at this position. All zeros, after motion or at another position, are a module in idle."""
        assert self._counts is not None
        dead = not counts and not velocity and (abs(self._counts) > _NOISE or abs(self.velocity) > _RESTING)
        return not dead and abs(counts - self._counts) <= self._reach * (at - self.stamp) + _NOISE

    def _stray(self, counts: int) -> None:
        """Take an impossible estimate; several that agree and are not zero mean that the module has a new zero."""
        agrees = self._astray is not None and counts and abs(counts - self._astray) <= _NOISE
        self._misses = self._misses + 1 if agrees else 1
        self._astray = counts
        self.lost = self.lost or self._misses >= _AGREE

    def _compare(self, in_turn: int, at: float) -> None:
        assert self._counts is not None
        if abs(self.velocity) <= _RESTING and abs(at - self.stamp) <= _TOGETHER:
            self._phase = in_turn - self._counts

    def _go_on(self, in_turn: int, at: float) -> None:
        """Advance the position by the count within the turn, to the position nearest to the expected motion.

        The velocity is measured over ``_SPAN``: counts requested by two programs arrive in pairs, and a busy computer reads some
        late.
        """
        assert self._counts is not None
        assert self._phase is not None
        dt = at - self.stamp
        if dt <= 0.0:
            return
        if self._from is None:
            self._from = self._counts, self.stamp
        expected = self._counts + round(self.velocity * TURN * dt)
        away = (in_turn - self._phase - expected + TURN // 2) % TURN - TURN // 2
        self._counts, self.stamp = expected + away, at
        before, since = self._from
        if at - since >= _SPAN:
            self.velocity = (self._counts - before) / TURN / (at - since)
            self._from = self._counts, at
