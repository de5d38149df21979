"""Where a module's rotor is, in counts: by its estimates while it is in closed loop, by its encoder's counts otherwise.

Theory of operation
-------------------
Get_Encoder_Estimates (0x09) has the position over turns, and is dead until closed loop: 0, or whatever. Get_Encoder_Count (0x0A) is
alive in every state, and of it only the place within one turn can be used: its count over turns does not convert (owners' reports).
So in closed loop the place is the estimate, and in idle it goes on from there by what the count within the turn has changed, taken
the way that is nearest to how fast the rotor was. Both are joined by their difference at standstill (``_phase``).

- Whoever asks for idle shuts the estimates out at once (``shut``): the module says 0 from then on, and its heartbeat says why only
  later. Where it falls out of closed loop by itself, an estimate that no rotor can have reached since the last one is passed over.
- The first estimate since the port is there says where the module is; until then the place is that within the turn. A later first
  one must be where the counts have led: if not, the module counts anew (``lost``), and whoever was homed is not any more.
"""

from __future__ import annotations

from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN
from axisbus.units import wrap

_SAME = (
    TURN // 20
)  # counts by which both ways of counting may differ: owners saw steps of 0.14 turns after restarts
_NOISE = TURN // 10
_RESTING = 0.05  # turns/s
_TOGETHER = 0.02  # s between an estimate and a count that are compared
_AGREE = 5  # estimates in a row that no rotor can have reached, and that agree with each other
_RECENT = 0.1  # s
_SPAN = 0.1  # s over which counts tell a speed: one of two that came close together, or late, would lead the place away for ever


class RotorPosition:
    """Holds the place, how fast the rotor is, and how both ways of counting are joined; times in s, velocities in turns/s."""

    def __init__(self, fastest: float) -> None:
        """``fastest``: the velocity limit."""
        self._reach = 2.0 * fastest * TURN  # counts per s that no rotor exceeds
        self.stamp = 0.0
        self.velocity = 0.0
        self.velocity_stamp: float | None = None  # None: no estimate says it now
        self.lost = False
        self._counts: int | None = None  # as the module counts, over turns
        self._offset = 0  # from there to what is shown: it was homed
        self._phase: int | None = None
        self._live = self._joined = self._was_joined = False
        self._astray: int | None = None
        self._misses = 0
        self._from: tuple[int, float] | None = None  # counts and time from which a speed is told in idle

    @property
    def shown(self) -> int | None:
        """The position as a drive counts it (INTEGER32); None where nothing is known yet."""
        return None if self._counts is None else wrap(self._counts + self._offset)

    @property
    def joined(self) -> bool:
        """Whether the place is that of an estimate, in this closed loop."""
        return self._live and self._joined

    @property
    def turns(self) -> float | None:
        """The position as the module counts it, in turns; None before estimates say it."""
        return self._counts / TURN if self._joined and self._counts is not None else None

    def turns_at(self, shown: int) -> float:
        """Return where the module has a position that is shown, in turns; of all that wrap to it, the nearest."""
        assert self._counts is not None
        here = self._counts + self._offset
        return (self._counts + wrap(shown - here)) / TURN

    def home(self, position: int) -> None:
        """Let the present place be ``position``."""
        if self._counts is not None:
            self._offset = position - self._counts

    # What comes.

    def open(self) -> None:
        """Closed loop was seen: estimates count from now on."""
        if not self._live:
            self._live, self._joined = True, False
            self._astray, self._misses = None, 0

    def shut(self) -> None:
        """Closed loop is at its end, or about to be: estimates count no longer."""
        self._live = self._joined = False
        self.velocity_stamp = None

    def take_estimate(self, turns: float, velocity: float, at: float) -> None:
        """Take Get_Encoder_Estimates, where it counts."""
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
        """The first estimate in this closed loop."""
        tracked = self._counts if self._phase is not None else None
        if self._was_joined and tracked is not None and abs(counts - tracked) > _SAME:
            self.lost = True
        if tracked is not None and self._phase is not None and at - self.stamp <= _RECENT:
            self._phase += tracked - counts

    def _can_be(self, counts: int, velocity: float, at: float) -> bool:
        """Whether the rotor can be there; nothing but zeros, where it moved or was elsewhere, is a module that has let go."""
        assert self._counts is not None
        dead = not counts and not velocity and (abs(self._counts) > _NOISE or abs(self.velocity) > _RESTING)
        return not dead and abs(counts - self._counts) <= self._reach * (at - self.stamp) + _NOISE

    def _stray(self, counts: int) -> None:
        """An estimate that cannot be; several that agree, and are not zeros, are a module that counts anew."""
        agrees = self._astray is not None and counts and abs(counts - self._astray) <= _NOISE
        self._misses = self._misses + 1 if agrees else 1
        self._astray = counts
        self.lost = self.lost or self._misses >= _AGREE

    def _compare(self, in_turn: int, at: float) -> None:
        assert self._counts is not None
        if abs(self.velocity) <= _RESTING and abs(at - self.stamp) <= _TOGETHER:
            self._phase = in_turn - self._counts

    def _go_on(self, in_turn: int, at: float) -> None:
        """By the count within the turn, the way that is nearest to how fast the rotor was.

        Counts that two programs ask for come in pairs, and a busy computer takes some late: a speed is told over a longer time.
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
