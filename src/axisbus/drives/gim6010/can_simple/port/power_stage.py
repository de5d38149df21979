"""CiA 402 power state machine for a module that has only idle and closed loop: the reported state, and the effect of controlwords.

Theory of operation
-------------------
The module has two states that matter here, idle and closed loop. Its heartbeat reports the state ten times a second. The CiA 402
states below *operation enabled* exist only here, in ``_asked``, and follow the transitions of the standard. ``Power`` is the status
of closed loop:

- OFF: the module is idle.
- COMING: closed loop was requested. *Switched on* is reported until a later heartbeat reports closed loop and, after the request,
  an estimate of the position has arrived.
- ON: this program has requested closed loop and sees it. The state is *operation enabled* or *quick stop active*.
- GOING: idle was requested. The previous state is reported until a later heartbeat reports idle.
- FOUND: the module is in closed loop without a request by this program.

If the module leaves closed loop on its own, the power-up sequence starts from the beginning. Closed loop is requested again only
after controlwords have passed through *ready to switch on* and *switched on* again.
"""

from __future__ import annotations

from enum import Enum

from axisbus.cia402 import controlword as cw
from axisbus.cia402.state import STATUSWORD_PATTERNS, TRANSITIONS, PowerState
from axisbus.drives.gim6010.can_simple.messages import IDLE
from axisbus.drives.gim6010.can_simple.port.feedback import ModuleFeedback

_S, _C = PowerState, cw.PowerCommand
WORDS = {state: value for _, value, state in STATUSWORD_PATTERNS}
_NEXT: dict[tuple[PowerState | None, cw.PowerCommand], PowerState] = {
    (each.source, each.command): each.target
    for each in TRANSITIONS
    if each.command is not None and each.command is not _C.FAULT_RESET
}
_BEFORE_POWER = (_S.READY_TO_SWITCH_ON, _S.SWITCHED_ON)
_AGAIN = 0.1  # s after which the request for idle is repeated
_RETRY = 0.3  # s after which that for closed loop is: a module already in closed loop would remove power for a moment


class Power(Enum):
    """Status of closed loop."""

    OFF = "idle"
    COMING = "asked for"
    ON = "ours"
    GOING = "idle is asked for"
    FOUND = "not asked for by this program"


class ModulePowerAction(Enum):
    """Request to send to the module in this cycle."""

    NOTHING = "nothing"
    START = "closed loop"
    TAKE_OVER = "to stay in closed loop, and to follow set-points from now on"
    QUICK_STOP = "to brake"
    LET_GO = "idle"
    CLEAR = "that its errors are cleared"


def after(state: PowerState, word: int) -> PowerState:
    """Return the state that a controlword causes, one transition at a time (CiA 402-2 7.2)."""
    command = _command(word)
    if command is _C.QUICK_STOP and state in _BEFORE_POWER:
        command = _C.DISABLE_VOLTAGE  # transitions 7 and 10
    if command is _C.ENABLE_OPERATION and state is _S.READY_TO_SWITCH_ON:
        command = _C.SWITCH_ON
    return _NEXT.get((state, command), state)


def _command(word: int) -> cw.PowerCommand:
    if not word & cw.ENABLE_VOLTAGE:
        return _C.DISABLE_VOLTAGE
    if not word & cw.QUICK_STOP:
        return _C.QUICK_STOP
    if not word & cw.SWITCH_ON:
        return _C.SHUTDOWN
    return _C.ENABLE_OPERATION if word & cw.ENABLE_OPERATION else _C.SWITCH_ON


class ModulePowerStage:
    """The requested power state of one module, and the times of the requests."""

    def __init__(self, hearing: ModuleFeedback) -> None:
        self._hearing = hearing
        self.power = Power.OFF
        self._asked = _S.SWITCH_ON_DISABLED
        self._leaving = _S.SWITCHED_ON  # the state that is reported in GOING
        self._since = self._sent = 0.0  # times of the first and the last request for closed loop or idle
        self._word = 0

    @property
    def shown(self) -> PowerState:
        """The state as in 6041h; valid only after a heartbeat was received."""
        hearing = self._hearing
        if hearing.faulty:
            return _S.FAULT_REACTION_ACTIVE if hearing.closed else _S.FAULT
        if self.power is Power.FOUND:
            return _S.OPERATION_ENABLED
        if self.power is Power.GOING:
            return self._shown_going
        idle = hearing.beat is not None and hearing.beat.state == IDLE
        if self.power is Power.OFF and not idle:
            return _S.NOT_READY_TO_SWITCH_ON  # a calibration, or a state that the manual does not name
        return self._asked

    @property
    def _shown_going(self) -> PowerState:
        if self._hearing.beat_at <= self._since:
            return self._leaving
        return self._leaving if self._leaving is not _S.SWITCHED_ON else _S.OPERATION_ENABLED

    @property
    def is_on(self) -> bool:
        """Whether this program has requested closed loop and a heartbeat reports it."""
        return self.power is Power.ON

    def look(self) -> None:
        hearing = self._hearing
        heard = hearing.beat_at > self._since
        closed = hearing.closed
        if hearing.faulty:
            self._fall()
        elif self.power is Power.COMING and heard and closed and self._is_placed:
            self.power, self._asked = Power.ON, _S.OPERATION_ENABLED
        elif self.power is Power.ON and heard and not closed:
            self.power, self._asked = Power.OFF, _S.SWITCH_ON_DISABLED
        elif self.power in (Power.GOING, Power.FOUND) and heard and not closed:
            self.power = Power.OFF
        elif self.power is Power.OFF and closed and heard:
            self.power = Power.FOUND

    def _fall(self) -> None:
        self._asked = _S.SWITCH_ON_DISABLED
        if self.power is not Power.FOUND or not self._hearing.closed:
            self.power = Power.GOING if self._hearing.closed else Power.OFF

    @property
    def _is_placed(self) -> bool:
        stamp = self._hearing.place.velocity_stamp
        return stamp is not None and stamp > self._since

    def obey(self, word: int, now: float) -> ModulePowerAction:
        """Take the controlword of this cycle and return the request that it causes."""
        before, self._word = self._word, word
        if self._hearing.faulty:
            return self._in_fault(word & ~before & cw.FAULT_RESET, now)
        return _OBEY[self.power](self, word, now)

    def lose(self, now: float) -> None:
        """Note that the module was switched to idle by other means than a controlword."""
        if self.power is not Power.OFF:
            self._leaving, self._asked = self.shown, _S.SWITCH_ON_DISABLED
            self.power, self._since, self._sent = Power.GOING, now, now

    def _in_fault(self, reset: int, now: float) -> ModulePowerAction:
        if self._hearing.closed:
            return self._repeat(now)
        return ModulePowerAction.CLEAR if reset else ModulePowerAction.NOTHING

    def _off(self, word: int, now: float) -> ModulePowerAction:
        if self.shown is _S.NOT_READY_TO_SWITCH_ON:
            return ModulePowerAction.NOTHING
        wanted = after(self._asked, word)
        if wanted is _S.OPERATION_ENABLED:
            self.power, self._since, self._sent = Power.COMING, now, now
            return ModulePowerAction.START
        self._asked = wanted
        return ModulePowerAction.NOTHING

    def _coming(self, word: int, now: float) -> ModulePowerAction:
        wanted = after(_S.SWITCHED_ON, word)
        if wanted is not _S.OPERATION_ENABLED:
            return self._go(_S.SWITCHED_ON, wanted, now)
        if now - self._sent < _RETRY or self._hearing.closed or self._hearing.beat_at <= self._sent:
            return ModulePowerAction.NOTHING
        self._sent = now
        return ModulePowerAction.START

    def _on(self, word: int, now: float) -> ModulePowerAction:
        before, wanted = self._asked, after(self._asked, word)
        if wanted is before:
            return ModulePowerAction.NOTHING
        if wanted is _S.QUICK_STOP_ACTIVE or wanted is _S.OPERATION_ENABLED:
            self._asked = wanted
            return (
                ModulePowerAction.QUICK_STOP
                if wanted is _S.QUICK_STOP_ACTIVE
                else ModulePowerAction.TAKE_OVER
            )
        return self._go(before, wanted, now)

    def _go(self, leaving: PowerState, asked: PowerState, now: float) -> ModulePowerAction:
        self._leaving, self._asked = leaving, asked
        self.power, self._since, self._sent = Power.GOING, now, now
        return ModulePowerAction.LET_GO

    def _going(self, word: int, now: float) -> ModulePowerAction:
        wanted = after(self._asked, word)
        self._asked = self._asked if wanted is _S.OPERATION_ENABLED else wanted
        return self._repeat(now)

    def _repeat(self, now: float) -> ModulePowerAction:
        if now - self._sent < _AGAIN:
            return ModulePowerAction.NOTHING
        self._sent = now
        return ModulePowerAction.LET_GO

    def _found(self, word: int, now: float) -> ModulePowerAction:
        wanted = after(_S.OPERATION_ENABLED, word)
        if wanted is _S.QUICK_STOP_ACTIVE or wanted is _S.OPERATION_ENABLED:
            self.power, self._asked = Power.ON, wanted
            return (
                ModulePowerAction.QUICK_STOP
                if wanted is _S.QUICK_STOP_ACTIVE
                else ModulePowerAction.TAKE_OVER
            )
        return self._go(_S.OPERATION_ENABLED, wanted, now)


_OBEY = {
    Power.OFF: ModulePowerStage._off,
    Power.COMING: ModulePowerStage._coming,
    Power.ON: ModulePowerStage._on,
    Power.GOING: ModulePowerStage._going,
    Power.FOUND: ModulePowerStage._found,
}
