"""Power stage of the simulated drive: CiA 402-2 7.2 from the drive's side.

Theory of operation
-------------------
``ARROWS`` contains the transitions 0 to 16, ``_COMMANDS`` the transitions that the controlword requests in each state. An accepted
transition waits for the ramp of its option code (the motion part brakes as ``effort`` says), then for its delay; then the state
changes. The controlword works by its level, except fault reset, which needs a rising edge of bit 7. Transitions without a command
(0, 1, 12 after a quick stop, 13, 14) are pending in the same way. Transition 12 without a command has one more condition: *quick
stop active* must last long enough to be seen, even if there was nothing to brake.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Protocol

from axisbus.sim.control_bits import CW_ENABLE_VOLTAGE, CW_FAULT_RESET, CW_QUICK_STOP_LOW
from axisbus.sim.fault_injection import NEVER, DriveFaults


class Stage(IntEnum):
    """A state of the power stage, numbered for this module only."""

    NOT_READY = 0
    SWITCH_ON_DISABLED = 1
    READY = 2
    SWITCHED_ON = 3
    ENABLED = 4
    QUICK_STOP = 5
    FAULT_REACTION = 6
    FAULT = 7


class Effort(IntEnum):
    """Action of the motor."""

    OFF = 0  # not energised
    RUN = 1  # follow the mode of operation
    SLOW = 2  # brake on the slow-down ramp
    QUICK = 3  # brake on the quick-stop ramp
    LIMIT = 4  # brake at the current or voltage limit


# Bits 0-3, 5, 6 of the statusword; CiA 402-2 table 29.
PATTERN = (0x0000, 0x0040, 0x0021, 0x0023, 0x0027, 0x0007, 0x000F, 0x0008)

# Transition: (from, to). 0 and 13 start anywhere.
ARROWS = {
    0: (Stage.NOT_READY, Stage.NOT_READY),
    1: (Stage.NOT_READY, Stage.SWITCH_ON_DISABLED),
    2: (Stage.SWITCH_ON_DISABLED, Stage.READY),
    3: (Stage.READY, Stage.SWITCHED_ON),
    4: (Stage.SWITCHED_ON, Stage.ENABLED),
    5: (Stage.ENABLED, Stage.SWITCHED_ON),
    6: (Stage.SWITCHED_ON, Stage.READY),
    7: (Stage.READY, Stage.SWITCH_ON_DISABLED),
    8: (Stage.ENABLED, Stage.READY),
    9: (Stage.ENABLED, Stage.SWITCH_ON_DISABLED),
    10: (Stage.SWITCHED_ON, Stage.SWITCH_ON_DISABLED),
    11: (Stage.ENABLED, Stage.QUICK_STOP),
    12: (Stage.QUICK_STOP, Stage.SWITCH_ON_DISABLED),
    13: (Stage.ENABLED, Stage.FAULT_REACTION),
    14: (Stage.FAULT_REACTION, Stage.FAULT),
    15: (Stage.FAULT, Stage.SWITCH_ON_DISABLED),
    16: (Stage.QUICK_STOP, Stage.ENABLED),
}

# (mask, value, transition) by state; the rows of a state exclude each other or are in order. Table 27 requires bit 7 low.
_COMMANDS: dict[Stage, tuple[tuple[int, int, int], ...]] = {
    Stage.SWITCH_ON_DISABLED: ((0x87, 0x06, 2),),
    Stage.READY: ((0x82, 0x00, 7), (0x86, 0x02, 7), (0x87, 0x07, 3)),
    Stage.SWITCHED_ON: ((0x82, 0x00, 10), (0x86, 0x02, 10), (0x87, 0x06, 6), (0x8F, 0x0F, 4)),
    Stage.ENABLED: ((0x82, 0x00, 9), (0x86, 0x02, 11), (0x87, 0x06, 8), (0x8F, 0x07, 5)),
    Stage.QUICK_STOP: ((0x82, 0x00, 12), (0x8F, 0x0F, 16)),
}

# Efforts by option code: quick stop 605Ah, fault reaction 605Eh, and shutdown 605Bh and disable operation 605Ch.
_QUICK_STOP = (
    Effort.OFF,
    Effort.SLOW,
    Effort.QUICK,
    Effort.LIMIT,
    Effort.LIMIT,
    Effort.SLOW,
    Effort.QUICK,
    Effort.LIMIT,
    Effort.LIMIT,
)
_FAULT = (Effort.OFF, Effort.SLOW, Effort.QUICK, Effort.LIMIT, Effort.LIMIT)
_ENERGISED = (Stage.ENABLED, Stage.QUICK_STOP, Stage.FAULT_REACTION)
_HOLDS = range(5, 9)
_AFTER_STANDSTILL = (5, 8, 12, 14)  # these wait for the end of their ramp

# Delay in seconds by transition; 1 is the self-test. The brake's times are added: opening to 4, closing to those after a ramp.
DELAYS: Mapping[int, float] = {1: 0.01, 3: 0.002, 4: 0.002}
_SHOWN = 0.02  # s: minimum duration of quick stop active
_SHOWN_AT_MOST = 1.0  # s for which it waits at most to be sent in TPDOs


def by_option(table: tuple[Effort, ...], option: int) -> Effort:
    """Return the effort of an option code; a code unknown to the standard brakes on the slow-down ramp."""
    return table[option] if 0 <= option < len(table) else Effort.SLOW


class Options(Protocol):
    """Option codes of the power stage: 605Ah, 605Bh, 605Ch, 605Eh."""

    quick_stop_option: int
    shutdown_option: int
    disable_option: int
    fault_option: int


class PowerStage:
    """The state and the pending transition."""

    __slots__ = (
        "_automatic",
        "_brake_closes",
        "_brake_opens",
        "_delays",
        "_dials",
        "_edge",
        "_ignored_word",
        "_options",
        "_shown",
        "_timer",
        "_unsent",
        "_word",
        "brake_in_time",
        "effort",
        "last_transition",
        "pending",
        "stage",
        "to_be_sent",
    )

    def __init__(
        self,
        options: Options,
        dials: DriveFaults,
        delays: Mapping[int, float] = DELAYS,
        brake: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Begin in *not ready to switch on*; ``brake``: times of the brake to open and to close, in seconds."""
        self._options = options
        self._dials = dials
        self._delays = delays
        self._brake_opens, self._brake_closes = brake
        self.stage = Stage.NOT_READY
        self.effort = Effort.OFF
        self.last_transition = 0
        self.brake_in_time = False  # the brake closes before the torque is removed
        # By TPDO: how often it must send quick stop active before the drive may leave that state automatically; times left.
        self.to_be_sent: dict[int, int] = {}
        self._unsent: dict[int, int] = {}
        self._shown = 0.0  # seconds for which the present state has lasted
        self._automatic = False  # transition 12 is pending without a command
        self._word = 0
        self._edge = False
        self._ignored_word: int | None = None
        self.pending: int | None = 1
        self._timer = self._delay(1)

    @property
    def pattern(self) -> int:
        """The state's bits of the statusword."""
        return PATTERN[self.stage]

    def command(self, word: int) -> None:
        """Take a controlword; it may make a transition pending, which ``step`` then executes."""
        if word & CW_FAULT_RESET and not self._word & CW_FAULT_RESET:
            self._edge = True
        if word != self._word:
            self._ignored_word = None
        self._word = word
        self._accept_requested()

    def step(self, dt: float, at_standstill: bool) -> None:
        """Advance by ``dt`` seconds (>= 0); ``at_standstill``: a braking motor has reached standstill."""
        guard = 8  # transitions that follow each other without a delay
        self._shown += dt
        while self.pending is not None and guard:
            if self.effort > Effort.RUN and not at_standstill and self.pending in _AFTER_STANDSTILL:
                return
            if self._automatic and not self._was_seen:
                return
            self._timer -= dt
            dt = 0.0
            if self._timer > 1e-12:
                return
            self._execute(self.pending)
            self._accept_requested()
            guard -= 1

    def stop_waiting_for_tpdos(self) -> None:
        """Note that the node sends no TPDOs any more: the drive does not wait for them."""
        self.to_be_sent, self._unsent = {}, {}

    def sent(self, tpdo: int) -> None:
        """Note that a TPDO has transmitted the state."""
        if self._unsent.get(tpdo):
            self._unsent[tpdo] -= 1

    @property
    def _was_seen(self) -> bool:
        """Whether the state has lasted long enough for a master to see it."""
        waits = any(self._unsent.values()) and self._shown < _SHOWN_AT_MOST - 1e-9
        return self._shown >= _SHOWN - 1e-9 and not waits

    def fault(self) -> None:
        """Execute transition 13: a fault was detected, in any state."""
        if self.stage in (Stage.FAULT, Stage.FAULT_REACTION):
            return
        energised = self.stage in _ENERGISED
        self.last_transition = 13
        self.stage = Stage.FAULT_REACTION
        self.effort = by_option(_FAULT, self._options.fault_option) if energised else Effort.OFF
        self._set_pending(14)
        self._edge = False

    def force(self, transition: int) -> None:
        """Make transition 9 or 11 without a command (abort connection option code); only a changed controlword acts afterwards."""
        if self.stage is not Stage.ENABLED:
            return
        self._ignored_word = self._word
        self._accept(transition)

    def start_enabled(self, word: int) -> None:
        """Start in operation enabled, like a drive that another master enabled before."""
        self.stage, self.effort, self.pending = Stage.ENABLED, Effort.RUN, None
        self._word = word

    def _accept_requested(self) -> None:
        """Accept the transition that the controlword requests now."""
        if self.stage is Stage.FAULT:
            if self._edge and not self._dials.fault_persists:
                self._accept(15)
            self._edge = False
            return
        self._edge = False
        if self._word == self._ignored_word:
            return
        wanted = self._wanted()
        if wanted is None:
            self._drop_ramp()
        elif self._interrupts(wanted):
            self._accept(wanted)

    def _wanted(self) -> int | None:
        word = self._word
        if self._dials.ignore_disable_voltage and not word & CW_ENABLE_VOLTAGE:
            return None
        if self._dials.ignore_quick_stop and word & CW_ENABLE_VOLTAGE and not word & CW_QUICK_STOP_LOW:
            return None
        for mask, value, transition in _COMMANDS.get(self.stage, ()):
            if word & mask == value:
                return transition if self._allowed(transition) else None
        return None

    def _allowed(self, transition: int) -> bool:
        if self._dials.transition_delay.get(transition, 0.0) == NEVER:
            return False
        if transition == 16:
            return self._options.quick_stop_option in _HOLDS
        return transition not in (3, 4) or not self._dials.no_voltage

    def _interrupts(self, wanted: int) -> bool:
        """Whether a command replaces the pending transition: any during a ramp, otherwise only disable voltage and quick stop."""
        if wanted == self.pending:
            return wanted == 12 and (self.effort > Effort.RUN or self._automatic)  # it shortens a quick stop
        return self.pending is None or self.effort > Effort.RUN or wanted in (7, 9, 10, 11, 12)

    def _drop_ramp(self) -> None:
        """Continue operation if enable operation is commanded again while transition 5 or 8 is still braking."""
        if self.pending in (5, 8) and self._word & 0x8F == 0x0F:
            self.pending, self.effort = None, Effort.RUN

    def _accept(self, transition: int) -> None:
        if transition == 5:
            self.effort = Effort.SLOW if self._options.disable_option else Effort.OFF
        elif transition == 8:
            self.effort = Effort.SLOW if self._options.shutdown_option else Effort.OFF
        elif transition in (9, 12):
            self.effort = Effort.OFF
        elif transition == 16:
            self.effort = Effort.RUN
        self._set_pending(transition)

    def _set_pending(self, transition: int) -> None:
        self.pending = transition
        self._automatic = False
        self._timer = self._delay(transition)

    def _delay(self, transition: int) -> float:
        time = self._delays.get(transition, 0.0) + self._dials.transition_delay.get(transition, 0.0)
        if transition == 4:
            time += self._brake_opens
        self.brake_in_time = transition in _AFTER_STANDSTILL and self.effort > Effort.RUN
        if self.brake_in_time:
            time += self._brake_closes
        return time

    def _execute(self, transition: int) -> None:
        self.last_transition = transition
        self.pending = None
        stage = ARROWS[transition][1]
        self.stage = stage
        self._automatic = False
        self._shown, self._unsent = 0.0, dict(self.to_be_sent)
        if stage is Stage.ENABLED:
            self.effort = Effort.RUN
        elif stage is Stage.QUICK_STOP:
            self.effort = by_option(_QUICK_STOP, self._options.quick_stop_option)
            if self._options.quick_stop_option not in _HOLDS:
                self._set_pending(12)
                self._automatic = self.effort is not Effort.OFF  # option 0 removes the power at once
        else:
            self.effort = Effort.OFF
