"""Stops a module outside the scan: velocity 0 on its own ramp, idle, ESTOP, until standstill is seen.

Theory of operation
-------------------
The steps go from soft to hard, and the sequence never returns to a softer one. Each command is repeated. BRAKE ends when
standstill is seen. It also ends if no position is known for two seconds, or if the motor has not become slower for a second after
that time: a slow ramp is waited for, at most for ``longest`` seconds. In a state other than closed loop and idle (a calibration) a
module ignores set-points, and is switched off at once. IDLE and ESTOP end when the module is seen in idle, and at standstill by
the counts of its encoder. If no counts are available (``counts``), the standstill must have been seen before, in closed loop.
"""

from __future__ import annotations

from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.messages import IDLE
from axisbus.drives.gim6010.can_simple.orders import Orders
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.setpoints import MOVES
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings

_AGAIN = 0.05  # s between two commands, which are repeated because another master may be alive and command the module
_STILL = 0.1  # s without motion, for standstill
_SLOWER = 0.05  # turns/s by which the lowest speed must fall
_STUCK = 1.0  # s within which it must
_STATE_COMES = 0.3  # s to wait for the state of a module without counts: in idle it gets nothing
_LONGEST = 6.0  # s: a program waits 15 s for its watchdog process, which goes through all steps in that time


class RescueStep(Enum):
    """Step of the stop sequence, with its deadline in seconds."""

    BRAKE = 2.0
    IDLE = 3.0
    ESTOP = 3.0001  # members with equal values would be aliases


class ModuleRescue:
    """Stop sequence of one module, a pure function of frames and time; ``text`` is the final state, empty until it is known."""

    def __init__(self, settings: ModuleSettings, *, counts: bool = True, longest: float = _LONGEST) -> None:
        """``counts``: the module's encoder counts are available in idle. ``longest`` (s): limit of BRAKE on a slow ramp."""
        self._settings = settings
        self._longest = longest
        self._counts = counts
        self._hearing = ModuleFeedback(settings)
        self._orders = Orders(settings.node)
        self.rung = RescueStep.BRAKE
        self.ok = False
        self.text = ""
        self._since: float | None = None
        self._sent = self._still_since = 0.0
        self._was_still = False
        self._stood = self._was_closed = False  # seen in closed loop: standstill, anything
        self._slowest: float | None = None  # turns/s, in this step
        self._slower_at = 0.0

    def receive(self, frame: CanFrame, time: float) -> None:
        """Take a frame received at ``time`` (s, the clock of ``step``)."""
        self._hearing.take(frame, time)

    def escalate(self, now: float) -> None:
        """Go to the next step at once; harmless in the last one."""
        if self.rung is not RescueStep.ESTOP and not self.text:
            self._go(RescueStep.IDLE if self.rung is RescueStep.BRAKE else RescueStep.ESTOP, now)

    def step(self, now: float) -> list[Outgoing]:
        """Return the frames to send at ``now`` (s); call it every few ms until there is a ``text``."""
        if self._since is None:
            self._since, self._sent = now, now - _AGAIN
        if self.rung is not RescueStep.BRAKE:
            self._hearing.let_go()
        self._look(now)
        self._judge(now)
        if self.text:
            return []
        return [*self._due(now), *self._hearing.ask(now)]

    def _due(self, now: float) -> list[Outgoing]:
        assert self._since is not None
        unknown = self._hearing.beat is None or self._is_off
        if unknown and not self._counts and now - self._since < _STATE_COMES:
            return []
        if now - self._sent < _AGAIN:
            return []
        self._sent, orders = now, self._orders
        if self.rung is RescueStep.BRAKE:
            return orders.brake()
        return [orders.idle() if self.rung is RescueStep.IDLE else orders.estop()]

    def _look(self, now: float) -> None:
        place = self._hearing.place
        heard = place.shown is not None and now - place.stamp <= self._settings.fresh
        still = heard and abs(place.velocity) <= MOVES
        if not still or not self._was_still:
            self._still_since = place.stamp
        self._was_still = still
        self._was_closed |= self._hearing.closed
        if heard and (self._slowest is None or abs(place.velocity) < self._slowest - _SLOWER):
            self._slowest, self._slower_at = abs(place.velocity), now

    @property
    def _is_off(self) -> bool:
        beat = self._hearing.beat
        return beat is not None and beat.state == IDLE

    def _judge(self, now: float) -> None:
        assert self._since is not None
        heard = self._hearing.beat_at > self._since
        told = self._hearing.place.stamp
        stands = self._was_still and told - max(self._still_since, self._since) >= _STILL
        if heard and self._is_off and (stands or not self._counts):
            self._end_in_idle(stands)
        elif heard and not self._hearing.closed and not self._is_off and self.rung is RescueStep.BRAKE:
            self._go(RescueStep.IDLE, now)
        elif heard and stands and self._hearing.closed and self.rung is RescueStep.BRAKE:
            self._stood = True
            if self._settings.quick_stop_holds:
                self._end(True, "is at standstill, and its module holds it")
            else:
                self._go(RescueStep.IDLE, now)
        elif now - self._since > self.rung.value and not self._becomes_slower(now):
            self._late(now)

    def _becomes_slower(self, now: float) -> bool:
        """Whether the brake acts, so that it is waited for."""
        assert self._since is not None
        in_time = now - self._slower_at <= _STUCK and now - self._since <= self._longest
        return self.rung is RescueStep.BRAKE and self._slowest is not None and in_time

    def _end_in_idle(self, stands: bool) -> None:
        latched = "; ESTOP latches an error until it is cleared" if self.rung is RescueStep.ESTOP else ""
        if stands or self._stood:
            self._end(True, f"stands, without power{latched}")
        elif not self._was_closed:
            self._end(True, f"is in idle, without power, and was not seen in closed loop{latched}")
        else:
            self._end(
                False,
                "is in idle, without power; whether it is at standstill is NOT known: in idle it does not report its position"
                + latched,
            )

    def _late(self, now: float) -> None:
        if self.rung is RescueStep.ESTOP:
            heard = (
                "sends heartbeats, but its standstill was not observed"
                if not self._hearing.overdue(now)
                else "is not heard"
            )
            self._end(False, f"NOT CONFIRMED as stopped: its module {heard} after velocity 0, idle and ESTOP")
        else:
            self._go(RescueStep.IDLE if self.rung is RescueStep.BRAKE else RescueStep.ESTOP, now)

    def _go(self, rung: RescueStep, now: float) -> None:
        self.rung, self._since, self._sent = rung, now, now - _AGAIN
        self._slowest = None

    def _end(self, ok: bool, text: str) -> None:
        self.ok, self.text = ok, text
