"""Stops a module when the scan that controlled it has ended: velocity 0 on its own ramp, idle, ESTOP, until standstill is seen."""

from __future__ import annotations

from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback
from axisbus.drives.gim6010.can_simple.port.setpoints import MOVES, Orders
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings

_AGAIN = 0.05  # s between two commands, which are repeated because another master may be alive and command the module
_STILL = 0.1  # s without motion, for standstill


class RescueStep(Enum):
    """Step of the stop sequence, with its deadline in seconds."""

    BRAKE = 2.0
    IDLE = 3.0
    ESTOP = 3.0001  # members with equal values would be aliases


class ModuleRescue:
    """Stop sequence of one module, a pure function of frames and time; ``text`` is the final state, empty until it is known."""

    def __init__(self, settings: ModuleSettings) -> None:
        self._settings = settings
        self._hearing = ModuleFeedback(settings)
        self._orders = Orders(settings)
        self.rung = RescueStep.BRAKE
        self.ok = False
        self.text = ""
        self._since: float | None = None
        self._sent = self._still_since = 0.0
        self._was_still = False

    def receive(self, frame: CanFrame, time: float) -> None:
        """Take a frame received at ``time`` (s, the clock of ``step``)."""
        self._hearing.take(frame, time)

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

    def _judge(self, now: float) -> None:
        assert self._since is not None
        heard = self._hearing.beat_at > self._since
        told = self._hearing.place.stamp
        stands = self._was_still and told - max(self._still_since, self._since) >= _STILL
        if heard and stands and not self._hearing.closed:
            self._end(True, "stands, without power")
        elif heard and stands and self.rung is RescueStep.BRAKE:
            if self._settings.quick_stop_holds:
                self._end(True, "is at standstill, and its module holds it")
            else:
                self._go(RescueStep.IDLE, now)
        elif now - self._since > self.rung.value:
            self._late(now)

    def _late(self, now: float) -> None:
        if self.rung is RescueStep.ESTOP:
            heard = (
                "sends heartbeats, but its standstill was not observed"
                if not self._hearing.is_silent(now)
                else "is not heard"
            )
            self._end(False, f"NOT CONFIRMED as stopped: its module {heard} after velocity 0, idle and ESTOP")
        else:
            self._go(RescueStep.IDLE if self.rung is RescueStep.BRAKE else RescueStep.ESTOP, now)

    def _go(self, rung: RescueStep, now: float) -> None:
        self.rung, self._since, self._sent = rung, now, now - _AGAIN

    def _end(self, ok: bool, text: str) -> None:
        self.ok, self.text = ok, text
