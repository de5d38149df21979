"""Enable the power stage of one axis in a mode at standstill (MC_Power)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

from axisbus.cia402 import modes, objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, TARGETS, PowerState
from axisbus.errors import DriveError, ModeError, MotionTimeout, StateError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.modes import ADDS_OFFSETS, WAITS_FOR_COMMAND
from axisbus.motion.moves.activity import Activity, preload, require_position
from axisbus.motion.moves.adopt_enabled_drive import DriveAdoption
from axisbus.motion.moves.interpolation import no_offsets
from axisbus.motion.moves.power_transition import StateWalk, word_text
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.standstill import StandstillCheck
from axisbus.motion.stop.standstill_monitor import StandstillMonitor

# The states without power, the lowest first.
_POWERLESS = (PowerState.SWITCH_ON_DISABLED, PowerState.READY_TO_SWITCH_ON, PowerState.SWITCHED_ON)
_STEADY = 3  # statuswords with an unchanged state, after which no word of an earlier command acts any more


class _EnableStep(Enum):
    MODE = 1
    SWITCH_ON = 2
    ENABLE = 3


class EnableActivity(Activity):
    """MC_Power(TRUE): choose a resting mode, preload every target, and bring the power stage to *operation enabled*.

    The targets follow the actual position until the drive is enabled, so that nothing jumps, whatever the drive's mode. Then they
    stay: a target that kept following the position would excite a soft load through the delay of the bus.
    """

    def __init__(
        self,
        parameters: AxisParameters,
        candidates: Sequence[ModeOfOperation],
        gate: StartBarrier = OPEN,
        takeover: DriveAdoption | None = None,
        *,
        moving: bool = False,
    ) -> None:
        """``candidates``: the modes in which to enable, best first. ``gate``: the start barrier of several axes.

        ``takeover``: for a drive found enabled in a mode that follows its targets. ``moving``: do not wait for an axis that moves.
        """
        self._parameters = parameters
        self._takeover = takeover
        self._taken_over = takeover is None
        self._has_left_mode = False  # the mode in which it was found
        self._moving = moving
        self._target: int | None = None  # as preloaded last
        self._choose(candidates)
        self._rest = EnableRest(parameters, moving)
        self._walk = StateWalk(parameters)
        self._offsets = no_offsets(parameters)
        self._gate = gate
        self._position_deadline: float | None = None
        self._mode_deadline: float | None = None
        self._confirm_deadline: float | None = None
        self._standstill_deadline: float | None = None
        self._enabled = False
        self._found_enabled: bool | None = None
        self._step = _EnableStep.MODE
        self._lowest: PowerState | None = None  # state without power that was seen
        self._shown = PowerState.UNKNOWN
        self._unchanged = 0  # statuswords (by event: cycles) for which the state has not changed
        self._stamp = -math.inf  # of the last statusword

    def _choose(self, candidates: Sequence[ModeOfOperation]) -> None:
        self._others = list(candidates)
        self._mode = self._others.pop(0) if candidates else None
        self._tried = list(candidates[:1])

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the drive is enabled, in the resting mode."""
        self._refuse(image)
        self._watch_state(image)
        if not self._taken_over and not self._targets_known(image, order):
            return False
        if self._awaits_position(image, order) or self._awaits_rest(image, order):
            return False
        self._preload(image, order)
        if self._confirm_deadline is not None and image.now > self._confirm_deadline:
            self._withdraw(image, order)
            return False
        if self._found_enabled is None:
            self._found_enabled = image.state is PowerState.OPERATION_ENABLED
        if (
            self._step is _EnableStep.MODE
            and self._mode_settled(image)
            and self._offsets_settled(image, order)
            and (image.state not in _POWERLESS or self._unchanged >= _STEADY)
        ):
            self._step = _EnableStep.SWITCH_ON
        if self._step is _EnableStep.MODE:
            self._stay(image, order)
            return False
        if self._step is _EnableStep.SWITCH_ON and not self._switched_on(image, order):
            return False
        self._step = _EnableStep.ENABLE
        if not self._walk.step(image, order, PowerState.OPERATION_ENABLED):
            self._check_power_kept(image)
            return False
        self._enabled = True
        rests = self._rest.after(image, found=self._found_enabled)
        return self._confirmed(image) and self._braked(image, order) and rests

    def _watch_state(self, image: AxisImage) -> None:
        if image.state in _POWERLESS:
            seen = image.state if self._lowest is None else self._lowest
            self._lowest = min(image.state, seen, key=_POWERLESS.index)
        if image.state is not self._shown:
            self._shown, self._unchanged = image.state, 0
        elif image.statusword_by_event or image.statusword_stamp > self._stamp:
            self._unchanged += 1
        self._stamp = image.statusword_stamp

    def _stay(self, image: AxisImage, order: CycleOutputs) -> None:
        """Keep the drive in its state; without power, in the lowest state seen, so that each cycle sends the same word.

        Controlwords of a command that has ended may still be in transit, and change the state. If the master sent a new word after
        each change, that word would be late as well: the changes would repeat until the drive gets its power and loses it again.
        """
        if image.state in _POWERLESS:
            order.goal = self._lowest
        else:
            order.goal = image.state if image.state in TARGETS else None

    def _braked(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether a drive found moving has come to rest: its halt brakes it on its own ramp, whatever the cause of the motion."""
        if not self._found_enabled or image.standstill or image.position is None:
            return True
        order.halt = True
        if self._standstill_deadline is None:
            self._standstill_deadline = image.now + self._parameters.stop_times.halt
        if image.now > self._standstill_deadline:
            raise DriveError(
                f"{self._parameters.name}: the axis was found moving, and does not halt",
                axis=self._parameters.name,
                observed=f"no standstill {self._parameters.stop_times.halt:g} s after the halt bit was set",
                remedy=(
                    "look for another master that commands it; the axis was stopped by the later steps of its stop "
                    "sequence"
                ),
            )
        return False

    def _refuse(self, image: AxisImage) -> None:
        if image.state in (PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE):
            raise StateError(
                f"{self._parameters.name}: the axis cannot be enabled while its drive is in state {image.state.value!r}",
                observed=word_text(image),
                remedy="reset first: axis.reset()",
            )

    def _targets_known(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether the drive's targets and offsets are known; until then nothing is sent to it."""
        assert self._takeover is not None
        if image.state is PowerState.OPERATION_ENABLED and not self._takeover.step(image, order):
            return False
        self._taken_over = True
        if image.state is not PowerState.OPERATION_ENABLED:  # another master has switched it off meanwhile
            self._takeover.cancel(order)
            self._takeover = None
        else:
            self._choose(self._takeover.choose(image, [*self._tried, *self._others]))
        return True

    def _awaits_position(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether the targets cannot follow the position now; a late position is awaited, without a step towards power."""
        if image.position is not None or image.state in ENERGISED or not self._needs_position:
            self._position_deadline = None
            return False
        if self._position_deadline is None:
            self._position_deadline = image.now + self._parameters.timing.transition
        if image.now > self._position_deadline:
            require_position(image, self._parameters.name, "enabling")
        preload(order, None)
        self._stay(image, order)
        self._walk.hold(image)
        return True

    def _awaits_rest(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether the axis still moves without power (coasts, sags, is turned): it is enabled in motion only on request."""
        if not self._rest.before(image):
            return False
        preload(order, None)
        self._stay(image, order)
        self._walk.hold(image)
        return True

    def _preload(self, image: AxisImage, order: CycleOutputs) -> None:
        if self._holds_targets(image):
            assert self._takeover is not None
            self._takeover.hold(image, order)
        elif image.state in ENERGISED:
            if not self._keeps_target(image):
                self._target = image.reference
            preload(order, self._target)
        elif self._needs_position:
            self._target = require_position(image, self._parameters.name, "enabling")
            preload(order, self._target)
        else:
            preload(order, None)
        order.mode = self._mode

    def _keeps_target(self, image: AxisImage) -> bool:
        """Whether the drive holds the preloaded target; one found enabled or in motion is braked first, and 6062h is exact."""
        holds = image.state is PowerState.OPERATION_ENABLED and not self._found_enabled and not self._moving
        return holds and self._target is not None and image.demand is None

    def _holds_targets(self, image: AxisImage) -> bool:
        """Whether the drive is still in the mode in which it was found, and its targets have an effect."""
        if self._takeover is None or image.state is not PowerState.OPERATION_ENABLED:
            return False
        self._has_left_mode = self._has_left_mode or image.mode == self._mode != self._takeover.mode
        return not self._has_left_mode and self._takeover.holds_until(self._mode)

    @property
    def _needs_position(self) -> bool:
        """Whether a position is required: a drive without 6064h is enabled in a mode that takes no position before a command."""
        return self._parameters.has(objects.POSITION_ACTUAL) or self._mode not in WAITS_FOR_COMMAND

    def _mode_settled(self, image: AxisImage) -> bool:
        """Whether the drive has the mode, or takes it only when it is enabled: until then it shows 6061h = 0, or its last mode.

        A last mode other than homing, in which nothing moves before bit 4 rises, must have ended, or be one of the candidates.
        """
        if self._mode is None or image.mode == self._mode or self._has_one_mode:
            return True
        if self._mode_deadline is None:
            self._mode_deadline = image.now + self._parameters.timing.mode
        if image.now <= self._mode_deadline:
            return False
        if image.mode in (None, ModeOfOperation.NONE) and self._takeover is None:
            return True
        if not self._others:
            if image.mode == ModeOfOperation.HOMING and image.state in _POWERLESS:
                self._mode = self._tried[0]
                return True
            raise self._mode_refused(image)
        self._mode, self._mode_deadline = self._others.pop(0), None
        self._tried.append(self._mode)
        return False

    def _offsets_settled(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether the offsets of a cyclic mode are 0 before they have an effect: the drive adds them from the first SYNC on.

        They are set before there is power; on a drive found enabled, in a mode other than the one in which it added them.
        """
        if image.state is PowerState.OPERATION_ENABLED:
            return self._offsets.step(image, order) if self._has_left_mode else True
        if self._mode not in ADDS_OFFSETS:
            return True
        return self._offsets.step(image, order)

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued transfers."""
        if self._takeover is not None:
            self._takeover.cancel(order)
        self._offsets.cancel(order)

    @property
    def _has_one_mode(self) -> bool:
        """Whether the drive has only one mode: without 6061h it is always in this mode."""
        return not self._parameters.has(objects.MODES_OF_OPERATION_DISPLAY)

    def _switched_on(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Wait for the other axes of a group in *switched on*; all then take the last step in one SYNC.

        A drive that is already energised keeps its power: from *quick stop active* it takes transition 16 at standstill.
        """
        if image.state is PowerState.QUICK_STOP_ACTIVE and not self._is_at_standstill(image, order):
            return False
        if image.state not in ENERGISED and not self._walk.step(image, order, PowerState.SWITCHED_ON):
            return False
        if not self._gate.pass_through(self):
            self._walk.hold(image)
            order.goal = image.state
            return False
        return True

    def _is_at_standstill(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether a running quick stop has come to rest; without 6064h this is unknown, and the drive decides."""
        if image.standstill or image.position is None:
            return True
        order.goal = image.state
        if self._standstill_deadline is None:
            self._standstill_deadline = image.now + self._parameters.stop_times.quick_stop
        if image.now > self._standstill_deadline:
            raise StateError(
                f"{self._parameters.name}: the axis cannot be enabled, it still moves in quick stop active",
                observed=f"no standstill for {self._parameters.stop_times.quick_stop:g} s",
                remedy="wait until it is at standstill, or disable it: axis.disable()",
            )
        return False

    def _check_power_kept(self, image: AxisImage) -> None:
        """Raise DriveError if power was lost while the mode was awaited: it is not switched on a second time."""
        if self._enabled and image.state is not PowerState.UNKNOWN:
            raise DriveError(
                f"{self._parameters.name}: the drive left operation enabled right after it was enabled",
                axis=self._parameters.name,
                observed=f"state {image.state.value!r}, {word_text(image)}",
                remedy="check for safe torque off, an enable input, a drop of the supply, or another master that stopped it",
            )

    def _confirmed(self, image: AxisImage) -> bool:
        if self._mode is None or image.mode in (self._mode, None):
            self._confirm_deadline = None
            return True
        if self._confirm_deadline is None:
            self._confirm_deadline = image.now + self._parameters.timing.mode
        return False

    def _withdraw(self, image: AxisImage, order: CycleOutputs) -> None:
        """Take the power of a drive that has just got it and takes no mode; then raise ModeError. One found enabled keeps it."""
        assert self._confirm_deadline is not None
        late = image.now > self._confirm_deadline + self._parameters.timing.transition
        if self._found_enabled or late or image.state not in ENERGISED:
            raise self._mode_refused(image)
        order.goal = PowerState.SWITCHED_ON

    def _mode_refused(self, image: AxisImage) -> ModeError:
        name = self._parameters.name
        tried = ", ".join(f"{int(mode)} ({modes.short(mode)})" for mode in self._tried)
        shown = (
            "is unknown"
            if image.mode is None
            else f"stays at {image.mode} ({modes.short(ModeOfOperation(image.mode))})"
        )
        return ModeError(
            f"{name}: the axis cannot be enabled, because the drive accepts no mode in which the axis can hold standstill",
            axis=name,
            observed=f"6060h was set to {tried}; 6061h {shown}",
            remedy="check in the drive's manual when it accepts a mode (a commissioning tool may prevent it); modes = [...] "
            f"in [axes.{name}] names the modes to try",
        )


# -- Check standstill around an enable: the axis must be at standstill before the power is switched on, and after it ----


class EnableRest:
    """Holds the standstill checks before and after the power is switched on, and the deadline of each."""

    __slots__ = ("_after", "_before", "_deadline", "_done", "_moving", "_parameters", "_watch")

    def __init__(self, parameters: AxisParameters, moving: bool) -> None:
        """``moving``: an axis that moves is enabled in motion, on purpose."""
        self._parameters = parameters
        self._moving = moving
        self._before: StandstillCheck | None = None
        self._after: StandstillCheck | None = None
        self._watch = StandstillMonitor(parameters)
        self._deadline = math.inf
        self._done = moving or not parameters.has(objects.POSITION_ACTUAL)

    def before(self, image: AxisImage) -> bool:
        """Return whether the power must wait, because the axis was not yet seen at standstill.

        Raises:
            StateError: the axis continues to move.
        """
        if self._done or image.state in ENERGISED:
            return False
        if self._before is None:
            self._before = StandstillCheck(self._parameters, image.now)
            self._deadline = image.now + self._parameters.timing.transition
        self._done = self._before.seen(image)
        if not self._done and image.now > self._deadline:
            raise self._refused(self._before.why_not(image))
        return not self._done

    def after(self, image: AxisImage, *, found: bool) -> bool:
        """Return whether the axis is at standstill with its power on; ``found``: it was found enabled, and may have been moving.

        Raises:
            UncommandedMotion: it was at rest and begins to move.
            MotionTimeout: it does not come to rest.
        """
        if self._after is None:
            self._after = StandstillCheck(self._parameters, image.now)
            self._deadline = image.now + self._parameters.timing.transition
        at_standstill = self._after.seen(image)
        unrest = None if found or self._moving else self._watch.error(image)
        if unrest is not None:
            raise unrest
        if not at_standstill and image.now > self._deadline:
            raise self._restless(self._after.why_not(image))
        return at_standstill

    def _refused(self, why: str) -> StateError:
        name, time = self._parameters.name, self._parameters.timing.transition
        return StateError(
            f"{name}: the axis was not enabled, because it moves",
            observed=f"without power it did not come to standstill within {time:g} s: {why}",
            remedy="wait until it is at standstill, or find the cause of the motion (it coasts, or its load sinks); "
            f"axis.enable(allow_moving=True) catches it in motion; standstill_velocity in [axes.{name}] defines "
            "standstill",
        )

    def _restless(self, why: str) -> MotionTimeout:
        name = self._parameters.name
        return MotionTimeout(
            f"{name}: the axis is enabled, but not at standstill",
            axis=name,
            observed=f"{self._parameters.timing.transition:g} s after it was enabled: {why}",
            remedy="check whether its load is too heavy, its tuning oscillates, or another master commands it; if its 6062h "
            f"is not a demand in the units of 6064h, a wide standstill_window in [axes.{name}] disables the "
            "comparison; the axis was stopped",
        )
