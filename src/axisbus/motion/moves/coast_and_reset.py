"""Remove the power on request (MC_Power off by transition 9), and reset faults (MC_Reset)."""

from __future__ import annotations

from axisbus.cia402 import controlword as cw
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import DriveError, TransitionError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import Activity, SetPointSource, age_text, unknown_statusword
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.moves.power_transition import StateWalk, word_text
from axisbus.motion.parameters import AxisParameters


class Coast(Activity):
    """MC_Power(FALSE) by transition 9, which must be requested explicitly: power off at once, nothing brakes the motor."""

    def __init__(
        self,
        parameters: AxisParameters,
        before: SetPointSource | None = None,
        pending_mode_switch: ModeSwitch | None = None,
    ) -> None:
        """``before``: the trajectory that commanded the axis, and ``pending_mode_switch`` the change of mode that was to end it.

        A halt in the same cycle brakes along the trajectory, and completes the change of mode.
        """
        self._walk = StateWalk(parameters)
        self._before = before
        self._pending_mode_switch = pending_mode_switch

    @property
    def set_point_source(self) -> SetPointSource | None:
        """The previous trajectory, until something has been sent."""
        return self._before

    @property
    def pending_mode_switch(self) -> ModeSwitch | None:
        """The change of mode that was running, until something has been sent."""
        return self._pending_mode_switch

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the power stage is off (a drive in fault counts as off)."""
        self._before = self._pending_mode_switch = None
        if image.state is PowerState.FAULT:
            order.goal = PowerState.SWITCH_ON_DISABLED
            return True
        done = self._walk.step(image, order, PowerState.SWITCH_ON_DISABLED)
        if image.state in ENERGISED or image.state is PowerState.UNKNOWN:  # then it may have power
            order.word = order.stopping(cw.PowerCommand.DISABLE_VOLTAGE, image.state)
        return done


class ResetActivity(Activity):
    """MC_Reset: a rising edge of bit 7 and nothing else; never enables. Harmless without a fault."""

    clears_error = True

    def __init__(self, parameters: AxisParameters, fault: str = "") -> None:
        """``fault``: the known facts about the fault, to be reported again if it persists."""
        self._parameters = parameters
        self._fault = fault
        self._low_since: float | None = None
        self._edge_sent = False
        self._deadline: float | None = None
        self._reacts_until: float | None = None

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the drive has left *fault* (at once if it is not in fault).

        While the drive brakes because of its fault (605Eh), its time for this counts first.
        """
        if self._reacts_until is None:
            times = self._parameters.stop_times
            self._reacts_until = image.now + times.quick_stop + times.disable
        reacts = image.state is PowerState.FAULT_REACTION_ACTIVE and image.now < self._reacts_until
        if self._deadline is None or reacts:
            self._deadline = image.now + self._parameters.timing.transition
        if image.state not in (PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE, PowerState.UNKNOWN):
            if self._edge_sent:
                order.goal = PowerState.SWITCH_ON_DISABLED
            return True
        if image.now > self._deadline:
            raise self._failed(image)
        if image.state is PowerState.FAULT:
            self._edge(image, order)
        return False

    def _edge(self, image: AxisImage, order: CycleOutputs) -> None:
        """Keep bit 7 low until the drive has certainly seen it, then high until the fault is gone; if it persists, repeat."""
        order.goal = PowerState.SWITCH_ON_DISABLED
        period = self._parameters.scan_period
        if self._low_since is None:
            self._low_since = image.now
        high_from = self._low_since + 2 * period
        if image.now < high_from:
            order.word = 0
        elif image.now < high_from + max(0.5 * self._parameters.timing.transition, 4 * period):
            self._edge_sent = True
            order.word = cw.PowerCommand.FAULT_RESET.word
        else:
            self._low_since = None

    def _failed(self, image: AxisImage) -> DriveError:
        name = self._parameters.name
        if image.state is PowerState.UNKNOWN:
            return unknown_statusword(
                image,
                name,
                f"{name}: the axis cannot be reset, its statusword is unknown",
                f"statusword (6041h): {age_text(image.now - image.statusword_stamp)}",
                "check the cable and that the node is operational (axisbus scan)",
            )
        return TransitionError(
            f"{name}: the drive does not clear the fault",
            axis=name,
            observed=f"{word_text(image)} after a rising edge of controlword bit 7"
            + (f"; the fault: {self._fault}" if self._fault else ""),
            remedy="the cause is still present: remove it, then reset again; some faults need the supply switched off and on",
        )
