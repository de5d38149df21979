"""A calibration over Modbus: requested once, followed to its end, aborted by idle if it fails, and judged.

Theory of operation
-------------------
``motor_state`` shows the sub-states (4, 7 and others, never the requested 3), and idle at the end. Outside of closed loop no
register holds the position of the rotor. Therefore the count of the encoder is read by its endpoint in each round, and the module
is switched off if the rotor turns too far; this needs the list of endpoints. Signals wait for the end of a round. Any premature end
starts the stop sequence, which switches the power off, because the module is not in closed loop.
"""

from __future__ import annotations

from collections.abc import Callable

from axisbus.drives.gim6010.calibration import (
    BEGINS,
    LONGEST,
    CalibrationKind,
    CalibrationResult,
    RotorRotation,
    judge,
    strange,
    too_far,
)
from axisbus.drives.gim6010.can_simple.states import IDLE, state_words
from axisbus.drives.gim6010.modbus.motion.course import fault
from axisbus.drives.gim6010.modbus.motion.driver import PERIOD, descend
from axisbus.drives.gim6010.modbus.motion.ladder import ModbusStopSequence
from axisbus.drives.gim6010.modbus.motion.signals import ModbusSignalHandlers
from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
from axisbus.drives.gim6010.modbus.registers import named
from axisbus.drives.gim6010.modbus.requests import ModbusFunction, ModbusRequest
from axisbus.errors import CommandError, DriveError

COUNT = "axis0.encoder.count_in_cpr"


class Calibrating:
    """One calibration; holds its readings. Used once, by one thread."""

    def __init__(
        self,
        parameters: ModbusParameters,
        kind: CalibrationKind,
        *,
        tell: Callable[[str], None],
        guarded: Callable[[], bool] = lambda: True,
    ) -> None:
        """``parameters`` are open; ``tell`` is called with each new state, and after an abort with how the module was left.

        ``guarded`` returns whether the watchdog process is still running; if it is not, the calibration is aborted.
        """
        self.kind = kind
        self.turned = RotorRotation()
        self._parameters = parameters
        self._module = parameters.module
        self._tell = tell
        self._guarded = guarded
        self._signals = ModbusSignalHandlers()
        self._seen: list[int] = []
        self._begun = 0.0

    def run(self) -> CalibrationResult:
        """Calibrate: THE OUTPUT MAY TURN WITHOUT A SET-POINT. Return the result; blocks until the end, at most five minutes.

        Raises:
            StateError: the module is not idle. DriveFault: it has errors, and nothing was requested. DriveError: it was aborted.
            NodeError, AdapterError: the module or the line is gone. KeyboardInterrupt, SystemExit: a signal has ended it.
        """
        self._require_ready()
        self._signals.install()
        try:
            with self._signals.sheltered():
                self._guarded_run()
                return judge(self.kind, self._seen, self._module.errors().lines, self.turned)
        finally:
            self._signals.restore()

    def _require_ready(self) -> None:
        self._module.require_idle(f"{self.kind.words} is begun")
        if self._module.errors().any:
            raise fault(self._module, IDLE)
        self._look_where_it_is()

    def _guarded_run(self) -> None:
        """Request the calibration and follow it; any error switches the power off before it is raised."""
        try:
            self._ask()
            while not self._is_over():
                self._module.wire.sleep(PERIOD)
        except BaseException as error:
            ladder = ModbusStopSequence(None, was_closed=False)
            outcome = descend(self._module, ladder, lambda: self._signals.count)
            self._tell(f"module {self._module.device}: {outcome.text}")
            if not outcome.ok:
                error.add_note(f"module {self._module.device}: {outcome.text}; switch its supply off")
            raise

    def _ask(self) -> None:
        """Request it once: a repeated request would start it again."""
        register = named("state_control")
        self._begun = self._module.wire.now()
        # the table of the register does not allow a calibration as a value
        self._module.dialogue.write(
            ModbusRequest(ModbusFunction.WRITE_ONE, register.address, register.count, (self.kind.value,))
        )

    def _is_over(self) -> bool:
        """Read the state once; return whether the calibration has ended normally.

        Raises:
            DriveError: it fails. CommandError: the watchdog process is gone. Others: as ``run``.
        """
        self._signals.check()
        self._require_guarded()
        state = self._module.state
        self._look_where_it_is()
        if state != IDLE:
            self._note(state)
        elif self._seen or self._module.errors().any:
            return True
        elif self._passed > BEGINS:
            raise self._broken_off("the module does not begin: it still shows idle")
        if self._passed > LONGEST:
            raise self._broken_off(f"it has not ended within {LONGEST:g} s")
        return False

    def _note(self, state: int) -> None:
        why = strange(state)
        if why:
            raise self._broken_off(why)
        if state not in self._seen[-1:]:
            self._seen.append(state)
            self._tell(f"{state_words(state)}, {self._passed:.1f} s")

    def _look_where_it_is(self) -> None:
        self.turned.take(int(self._parameters.read(COUNT)))
        why = too_far(self.kind, self.turned)
        if why:
            raise self._broken_off(why)

    def _require_guarded(self) -> None:
        if not self._guarded():
            raise CommandError(
                f"module {self._module.device}: the watchdog process of this calibration has ended",
                observed="nothing would switch the module off if this program were killed",
                remedy="find out which program ended it, then repeat the command",
            )

    @property
    def _passed(self) -> float:
        return self._module.wire.now() - self._begun

    def _broken_off(self, why: str) -> DriveError:
        return DriveError(
            f"module {self._module.device}: {self.kind.words} was aborted: {why}",
            remedy=f"see what it reports: axisbus gim6010 modbus errors --node {self._module.device} ...",
        )
