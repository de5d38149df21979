"""One module that is enabled over Modbus; however its ``with`` block ends, the module is stopped and switched off.

Theory of operation
-------------------
The modes are set and read back in idle; then closed loop is requested once. Nothing is commanded before closed loop was seen and
the motor has kept its position. The mode is changed under power only to brake. In each round, state, error flags, position and
velocity are read again. Any value that contradicts the command raises an error, which starts the stop sequence. Signals wait for
the end of a round. No function of the module notices a dead master: ``DEAD_MASTER`` is reported when the module is opened.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable
from types import TracebackType
from typing import Self

from axisbus.drives.gim6010.can_simple.states import CLOSED_LOOP, IDLE, state_words
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.module import ModbusModule, StatusRead, look
from axisbus.drives.gim6010.modbus.motion.course import (
    ModbusCommand,
    ModbusControlMode,
    ModbusMotionStatus,
    fault,
    turns,
    wrong,
)
from axisbus.drives.gim6010.modbus.motion.driver import PERIOD, descend, is_idle, not_stopped
from axisbus.drives.gim6010.modbus.motion.ladder import ModbusStopSequence, ModbusStopStep, StopOutcome
from axisbus.drives.gim6010.modbus.motion.signals import ModbusSignalHandlers
from axisbus.drives.gim6010.modbus.registers import named
from axisbus.errors import CommandError, StateError, TransitionError, UncommandedMotion

DEAD_MASTER = (
    "nothing in this module is known to notice a dead master over Modbus: without a master a velocity or a torque "
    "continues and a position is held; keep an emergency stop within reach"
)
TRIES = 2  # attempts for each request during a motion
PLACE = 0.25  # turns of the rotor: allowed deviation of a held position
_STARTS = 2.0  # s until closed loop is seen
_KEEPS = 0.2  # s for which it must keep its position before anything is commanded


class PoweredModule:
    """Enables and stops one module in a ``with`` block; every method blocks. Positions and velocities are those of the rotor."""

    def __init__(
        self,
        module: ModbusModule,
        *,
        tell: Callable[[str], None],
        guarded: Callable[[], bool] = lambda: True,
    ) -> None:
        """``tell`` is called with texts for the user: that no function notices a dead master, and how the module was left.

        ``guarded`` returns whether the watchdog process is still running; if it is not, the motion ends.
        """
        self.module = module
        self._tell = tell
        self._guarded = guarded
        self._signals = ModbusSignalHandlers()
        self._course: ModbusCommand | None = None  # None: this object has not enabled it
        self._open = self._powered = self._was_closed = False
        self._velocity_limit = 0.0

    def __enter__(self) -> Self:
        """Take over the signals, check that the module answers, and report that a dead master is not noticed. Enables nothing.

        Raises:
            NodeError: it does not answer. AdapterError: the line is gone.
        """
        found = look(self.module, TRIES)
        self._say(DEAD_MASTER)
        if found.state != IDLE:
            self._say(f"it is in {state_words(found.state)}, and stays in this state unless it is stopped")
        self._signals.install()
        atexit.register(self._last_resort)
        self._open = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the module by the stop sequence if this object has enabled it, and restore the signal handlers.

        Raises:
            DriveError: it is not confirmed as stopped. If the block ends with another error, that error gets a note instead.
        """
        try:
            with self._signals.sheltered():
                outcome = self._stop(hold=False) if self._powered else None
        finally:
            atexit.unregister(self._last_resort)
            self._signals.restore()
            self._open = False
        if outcome is not None and not outcome.ok:
            if error is None:
                raise not_stopped(self.module, outcome)
            error.add_note(f"module {self.module.device}: {outcome.text}")
        if error is None:
            self._signals.check()

    @property
    def control(self) -> ModbusControlMode | None:
        """The control mode for which this object has enabled the module; None if it has not."""
        return None if self._course is None else self._course.control

    def enable(self, control: ModbusControlMode) -> None:
        """Enable the module in one control mode; nothing moves. Returns when closed loop was seen and the position was kept.

        Raises:
            StateError: it is not in idle, or a limit is 0. DriveFault: it has errors. TransitionError: it does not enable.
            UncommandedMotion: it moves without a command. NodeError: no answer.
        """
        self._require_open()
        with self._signals.sheltered():
            if self._course is not None:
                raise StateError(
                    "it is already enabled", remedy="disable it before the control mode is changed"
                )
            self.module.require_idle("it is enabled")
            self._require_well(look(self.module, TRIES), IDLE)
            self._require_limits()
            self._preset(control)
            self._signals.check()
            self._powered, self._was_closed, self._course = True, False, ModbusCommand(control)
            self._close()
            self._keep_place(self._course)

    def halt(self) -> None:
        """Brake to standstill and hold there in closed loop.

        Raises:
            StateError: it is not enabled. DriveError: it had to be switched off, or is not confirmed as stopped.
        """
        self._enabled()
        with self._signals.sheltered():
            outcome = self._stop(hold=True)
            if not outcome.ok or outcome.is_off:
                raise not_stopped(self.module, outcome)
            self._signals.check()

    def disable(self) -> None:
        """Brake to standstill, then switch the power off; harmless if it is not enabled. A hanging load falls.

        Raises:
            DriveError: it is not confirmed as stopped.
        """
        self._require_open()
        with self._signals.sheltered():
            outcome = self._stop(hold=False) if self._powered else None
            if outcome is not None and not outcome.ok:
                raise not_stopped(self.module, outcome)
            self._signals.check()

    def quick_stop(self) -> None:
        """Brake on the module's own ramp, then go to idle; also if another program has enabled the module, or it does not answer.

        Raises:
            DriveError: it is not confirmed as stopped.
        """
        self._require_open()
        with self._signals.sheltered():
            if not self._powered and is_idle(self.module):
                self._say("it is in idle: there is no power to be stopped")
                return
            self._course, self._powered, self._was_closed = None, True, True
        self.disable()

    # Rounds.

    def _round(self) -> StatusRead:
        """Read the module once; raise an error if it does not follow its command, or a signal has arrived."""
        self._signals.check()
        if not self._guarded():
            raise CommandError(
                f"module {self.module.device}: the watchdog process of this motion has ended",
                observed="nothing would stop the module if this program were killed",
                remedy="find out which program ended it, then repeat the command",
            )
        course, seen = self._enabled(), look(self.module, TRIES)
        self._require_well(seen, CLOSED_LOOP)
        if seen.position is None or seen.velocity is None:
            raise wrong(self.module, ModbusMotionStatus.BLIND, seen, course)
        if course.is_too_fast(seen.velocity):
            raise wrong(self.module, ModbusMotionStatus.TOO_FAST, seen, course)
        self.module.wire.sleep(PERIOD)
        return seen

    def _place(self) -> float:
        """Return its position in turns."""
        position = self._round().position
        assert position is not None, "a round raises without it"
        return position

    # The steps of enabling.

    def _require_limits(self) -> None:
        limits = {name: float(self.module.read(name)) for name in ("velocity_limit", "current_limit")}
        for name, value in limits.items():
            if not value > 0.0:
                raise StateError(
                    f"module {self.module.device}: its {name} is {value:g}, so it cannot move",
                    remedy=f"write it: axisbus gim6010 modbus write {name}=...",
                )
        self._velocity_limit = limits["velocity_limit"]

    def _preset(self, control: ModbusControlMode) -> None:
        """Write set-points of 0 and the modes, without power. No position is written: none is valid in idle."""
        control_mode, input_mode = control.value
        for name, value in (
            ("velocity_setpoint", 0.0),
            ("torque_setpoint", 0.0),
            ("control_mode", control_mode),
            ("input_mode", input_mode),
        ):
            self.module.put(requests.write(named(name), value))

    def _close(self) -> None:
        """Request closed loop once, and wait until it is seen."""
        taken = self.module.dialogue.write(requests.write(named("state_control"), CLOSED_LOOP))
        end = self.module.wire.now() + _STARTS
        while True:
            seen = look(self.module, TRIES)
            self._was_closed |= seen.is_closed
            self._require_well(seen)
            if seen.is_closed and seen.position is not None:
                return
            self._signals.check()
            if self.module.wire.now() > end:
                raise self._not_enabled(seen, taken)
            self.module.wire.sleep(PERIOD)

    def _keep_place(self, course: ModbusCommand) -> None:
        """Check that it keeps the position at which it was enabled."""
        place = self._place()
        if course.control is ModbusControlMode.POSITION:
            asked = float(self.module.read("position_setpoint"))
            if not abs(asked - place) <= PLACE:
                raise UncommandedMotion(
                    f"module {self.module.device} was enabled at {turns(place)} with a set-point of {turns(asked)}",
                    remedy="its firmware stores an old set-point, to which it would move: do not use positions over Modbus with it",
                )
            course.target = place
        end = self.module.wire.now() + _KEEPS
        while self.module.wire.now() < end:
            now = self._place()
            if abs(now - place) > PLACE:
                raise UncommandedMotion(
                    f"module {self.module.device} moves without a command",
                    observed=f"it was enabled at {turns(place)}, and is at {turns(now)}",
                    remedy="find out what turns it: a load, another master, one of its inputs (PWM, pulse/direction)",
                )

    # Stopping.

    def _stop(self, *, hold: bool) -> StopOutcome:
        """Run the stop sequence; afterwards the module is enabled only if it holds its position."""
        course = self._course
        ladder = ModbusStopSequence(
            None if course is None else course.halting, hold=hold, was_closed=self._was_closed
        )
        outcome = descend(self.module, ladder, lambda: self._signals.count)
        if course is not None and outcome.ok and not outcome.is_off:
            if outcome.rung is ModbusStopStep.BRAKE:
                self._course = ModbusCommand(ModbusControlMode.VELOCITY, fastest=course.fastest)
            elif course.control is ModbusControlMode.POSITION:
                course.target = course.target if ladder.value is None else ladder.value
            course.commanded = 0.0
            return outcome
        self._powered, self._course = not outcome.is_off, None
        self._say(outcome.text)
        return outcome

    def _last_resort(self) -> None:
        """Stop the module if the interpreter ends before the block does."""
        if self._powered:
            self._stop(hold=False)

    def _not_enabled(self, seen: StatusRead, taken: bool) -> TransitionError:
        return TransitionError(
            f"module {self.module.device} does not go to closed loop",
            observed=f"state 8 was written and {'taken' if taken else 'not answered'}; after {_STARTS:g} s it is in "
            f"{state_words(seen.state)}, without an error",
            remedy="some firmware refuses silently: check its calibration, and for a latched error (axisbus gim6010 modbus errors)",
        )

    # Preconditions.

    def _require_open(self) -> None:
        if not self._open:
            raise StateError("the axis is not open", remedy="use it in a with block: its end stops the axis")

    def _enabled(self, control: ModbusControlMode | None = None) -> ModbusCommand:
        """Return its present command; raise StateError if it is not enabled (in ``control``, if that is given)."""
        self._require_open()
        if self._course is None or control not in (None, self._course.control):
            wanted = "" if control is None else f" for {control.name.lower()}"
            raise StateError(
                f"module {self.module.device} is not enabled{wanted}",
                remedy="enable it in this control mode; disable it first if it is enabled in another one",
            )
        return self._course

    def _require_well(self, seen: StatusRead, state: int | None = None) -> None:
        if seen.flags or state not in (None, seen.state):
            raise fault(self.module, seen.state)

    def _say(self, text: str) -> None:
        self._tell(f"module {self.module.device}: {text}")
