"""Enabling, disabling and fault reset: the power stage of one axis (MC_Power, MC_Reset)."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import modes, objects, statusword
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, TARGETS, State
from axisbus.errors import DriveError, ModeError, StaleError, StateError, TransitionError
from axisbus.motion.activity import Activity, preload, require_position
from axisbus.motion.gate import OPEN, Gate
from axisbus.motion.image import Image
from axisbus.motion.interpolation import no_offsets
from axisbus.motion.order import Order
from axisbus.motion.parameters import AxisParameters

# The mode that a drive is enabled in: the first that it has, from the one that stands still most surely.
RESTING_MODES = (
    ModeOfOperation.PROFILE_POSITION,
    ModeOfOperation.CYCLIC_SYNC_POSITION,
    ModeOfOperation.PROFILE_VELOCITY,
    ModeOfOperation.CYCLIC_SYNC_VELOCITY,
    ModeOfOperation.PROFILE_TORQUE,
)


# In these the drive stands until a set-point, velocity or torque is given to it.
_WAITS_FOR_COMMAND = frozenset(
    {ModeOfOperation.PROFILE_POSITION, ModeOfOperation.PROFILE_VELOCITY, ModeOfOperation.PROFILE_TORQUE}
)
_ADDS_OFFSETS = frozenset(
    {
        ModeOfOperation.CYCLIC_SYNC_POSITION,
        ModeOfOperation.CYCLIC_SYNC_VELOCITY,
        ModeOfOperation.CYCLIC_SYNC_TORQUE,
    }
)


class StateWalk:
    """Walks the power stage to a goal and watches that every step is taken in time; holds the step's deadline.

    Only a state that was not seen before gets a time of its own: a drive that falls back again and again is given up.
    """

    __slots__ = ("_deadline", "_last", "_parameters", "path")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._deadline = 0.0
        self._last: State | None = None
        self.path: list[State] = []

    def step(self, image: Image, order: Order, goal: State) -> bool:
        """Return True when ``goal`` is seen.

        Raises:
            TransitionError: the drive stays in one state past the deadline.
        """
        order.goal = goal
        if image.state is goal:
            return True
        if image.state is not self._last:
            if image.state not in self.path:
                self._deadline = image.now + self._parameters.timing.transition
            self._last = image.state
            self.path.append(image.state)
        if image.now > self._deadline:
            raise self._stuck(image, order, goal)
        return False

    def hold(self, image: Image) -> None:
        """Start the step's time again: the walk waits for something else."""
        self._deadline = image.now + self._parameters.timing.transition

    def _stuck(self, image: Image, order: Order, goal: State) -> DriveError:
        if image.statusword is None:
            return _blind(self._parameters, goal)
        name, word = self._parameters.name, image.statusword
        sent = order.controlword(image.state)
        command = (
            "nothing was sent" if sent is None else f"controlword 0x{sent:04X} ({cw.words(sent)}) was sent"
        )
        return TransitionError(
            f"{name}: the drive does not go on from {image.state.value!r} to {goal.value!r}",
            axis=name,
            observed=f"{command}, statusword 0x{word:04X} for {self._parameters.timing.transition:g} s; "
            f"path: {' > '.join(state.value for state in self.path[-8:])}",
            remedy="; ".join(statusword.hints(word))
            or "check enable inputs, safe torque off and supply of the drive; some drives need longer to release a brake "
            "(raise transition_time)",
        )


def _blind(parameters: AxisParameters, goal: State) -> StaleError:
    return StaleError(
        f"{parameters.name}: cannot be led to {goal.value!r}: its statusword (6041h) is unknown",
        axis=parameters.name,
        observed=f"no fresh statusword for {parameters.timing.transition:g} s, so nothing was sent",
        remedy=f"check the cable, and that node {parameters.node} is operational and sends its TPDO (axisbus monitor)",
    )


class _EnableStep(Enum):
    MODE = 1
    SWITCH_ON = 2
    ENABLE = 3


class Enable(Activity):
    """MC_Power(TRUE): choose a resting mode, preload every target, walk to *operation enabled*.

    The targets follow the actual position until the drive is enabled, so that nothing jumps in whatever mode it wakes up.
    """

    def __init__(
        self, parameters: AxisParameters, candidates: Sequence[ModeOfOperation], gate: Gate = OPEN
    ) -> None:
        """``candidates``: the modes to be enabled in, best first. ``gate``: where several axes wait for each other."""
        self._parameters = parameters
        self._others = list(candidates)
        self._mode = self._others.pop(0) if candidates else None
        self._tried = list(candidates[:1])
        self._walk = StateWalk(parameters)
        self._offsets = no_offsets(parameters)
        self._gate = gate
        self._mode_deadline: float | None = None
        self._confirm_deadline: float | None = None
        self._stand_deadline: float | None = None
        self._enabled = False
        self._found_enabled: bool | None = None
        self._step = _EnableStep.MODE

    def step(self, image: Image, order: Order) -> bool:
        """Return True when the drive is enabled, in the resting mode."""
        self._refuse(image)
        self._preload(image, order)
        if self._found_enabled is None:
            self._found_enabled = image.state is State.OPERATION_ENABLED
        if (
            self._step is _EnableStep.MODE
            and self._mode_settled(image)
            and self._offsets_settled(image, order)
        ):
            self._step = _EnableStep.SWITCH_ON
        if self._step is _EnableStep.MODE:
            order.goal = image.state if image.state in TARGETS else None
            return False
        if self._step is _EnableStep.SWITCH_ON and not self._switched_on(image, order):
            return False
        self._step = _EnableStep.ENABLE
        if not self._walk.step(image, order, State.OPERATION_ENABLED):
            self._check_kept(image)
            return False
        self._enabled = True
        return self._confirmed(image) and self._braked(image, order)

    def _braked(self, image: Image, order: Order) -> bool:
        """Whether a drive that was found moving has come to rest: its halt brakes it on its own ramp, whatever moved it."""
        if not self._found_enabled or image.standstill or image.position is None:
            return True
        order.halt = True
        if self._stand_deadline is None:
            self._stand_deadline = image.now + self._parameters.stop_times.halt
        if image.now > self._stand_deadline:
            raise DriveError(
                f"{self._parameters.name}: was found moving, and does not halt",
                axis=self._parameters.name,
                observed=f"no standstill {self._parameters.stop_times.halt:g} s after the halt bit was set",
                remedy="look for another master that commands it; the axis was stopped by the harder rungs of its ladder",
            )
        return False

    def _refuse(self, image: Image) -> None:
        if image.state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
            raise StateError(
                f"{self._parameters.name}: cannot be enabled, the drive is in state {image.state.value!r}",
                observed=_word(image),
                remedy="reset first: axis.reset()",
            )

    def _preload(self, image: Image, order: Order) -> None:
        if image.state in ENERGISED:
            preload(order, image.reference)
        elif self._needs_position:
            preload(order, require_position(image, self._parameters.name, "enabling"))
        else:
            preload(order, None)
        order.mode = self._mode

    @property
    def _needs_position(self) -> bool:
        """A drive that has no 6064h at all is enabled in a mode that takes no position by itself."""
        return self._parameters.has(objects.POSITION_ACTUAL) or self._mode not in _WAITS_FOR_COMMAND

    def _mode_settled(self, image: Image) -> bool:
        """A drive may show its mode only when enabled (6061h = 0 until then); any other mode must have gone."""
        if self._mode is None or image.mode == self._mode or self._has_one_mode:
            return True
        if self._mode_deadline is None:
            self._mode_deadline = image.now + self._parameters.timing.mode
        if image.now <= self._mode_deadline:
            return False
        if image.mode in (None, ModeOfOperation.NONE):
            return True
        if not self._others:
            raise self._mode_refused(image)
        self._mode, self._mode_deadline = self._others.pop(0), None
        self._tried.append(self._mode)
        return False

    def _offsets_settled(self, image: Image, order: Order) -> bool:
        """A cyclic mode adds its offsets to the target from the first SYNC on: they are taken back before there is power."""
        if self._mode not in _ADDS_OFFSETS or image.state in ENERGISED:
            return True
        return self._offsets.step(image, order)

    def cancel(self, order: Order) -> None:
        """Take back what is queued."""
        self._offsets.cancel(order)

    @property
    def _has_one_mode(self) -> bool:
        """A drive without 6061h has one mode, and is in it."""
        return not self._parameters.has(objects.MODES_OF_OPERATION_DISPLAY)

    def _switched_on(self, image: Image, order: Order) -> bool:
        """Wait for the others of a group in *switched on*; the last step is then taken in one SYNC.

        A drive that is energised already keeps its power: from *quick stop active* it takes transition 16, once it stands.
        """
        if image.state is State.QUICK_STOP_ACTIVE and not self._stands(image, order):
            return False
        if image.state not in ENERGISED and not self._walk.step(image, order, State.SWITCHED_ON):
            return False
        if not self._gate.pass_through(self):
            self._walk.hold(image)
            order.goal = image.state
            return False
        return True

    def _stands(self, image: Image, order: Order) -> bool:
        """Whether a quick stop that was under way has come to rest; without 6064h nobody knows, and the drive decides."""
        if image.standstill or image.position is None:
            return True
        order.goal = image.state
        if self._stand_deadline is None:
            self._stand_deadline = image.now + self._parameters.stop_times.quick_stop
        if image.now > self._stand_deadline:
            raise StateError(
                f"{self._parameters.name}: cannot be enabled, it still moves in quick stop active",
                observed=f"no standstill for {self._parameters.stop_times.quick_stop:g} s",
                remedy="wait until it stands, or disable it: axis.disable()",
            )
        return False

    def _check_kept(self, image: Image) -> None:
        """Power that was lost while the mode was awaited is not switched on a second time."""
        if self._enabled and image.state is not State.UNKNOWN:
            raise DriveError(
                f"{self._parameters.name}: the drive left operation enabled right after it was enabled",
                axis=self._parameters.name,
                observed=f"state {image.state.value!r}, {_word(image)}",
                remedy="look for safe torque off, an enable input, a supply that dropped, or another master that stopped it",
            )

    def _confirmed(self, image: Image) -> bool:
        if self._mode is None or image.mode in (self._mode, None):
            return True
        if self._confirm_deadline is None:
            self._confirm_deadline = image.now + self._parameters.timing.mode
        if image.now > self._confirm_deadline:
            raise self._mode_refused(image)
        return False

    def _mode_refused(self, image: Image) -> ModeError:
        name = self._parameters.name
        tried = ", ".join(f"{int(mode)} ({modes.short(mode)})" for mode in self._tried)
        shown = (
            "is unknown"
            if image.mode is None
            else f"stays at {image.mode} ({modes.short(ModeOfOperation(image.mode))})"
        )
        return ModeError(
            f"{name}: cannot be enabled in a mode that stands still: the drive takes none",
            axis=name,
            observed=f"6060h was set to {tried}; 6061h {shown}",
            remedy="check in the drive's manual when it takes a mode (a commissioning tool may hold it); "
            f"modes = [...] in [axes.{name}] names the modes to try",
        )


class Coast(Activity):
    """MC_Power(FALSE) by transition 9, which must be asked for by name: power off at once, nothing brakes the motor."""

    def __init__(self, parameters: AxisParameters) -> None:
        self._walk = StateWalk(parameters)

    def step(self, image: Image, order: Order) -> bool:
        """Return True when the power stage is off (a drive in fault counts as off)."""
        if image.state is State.FAULT:
            order.goal = State.SWITCH_ON_DISABLED
            return True
        done = self._walk.step(image, order, State.SWITCH_ON_DISABLED)
        if image.state in ENERGISED:
            order.word = cw.Command.DISABLE_VOLTAGE.word
        return done


class Reset(Activity):
    """MC_Reset: a rising edge of bit 7 and nothing else; never enables. Harmless where there is no fault."""

    clears_error = True

    def __init__(self, parameters: AxisParameters, fault: str = "") -> None:
        """``fault``: what is known of the fault, to be told again where it does not go away."""
        self._parameters = parameters
        self._fault = fault
        self._low_since: float | None = None
        self._edge_sent = False
        self._deadline: float | None = None

    def step(self, image: Image, order: Order) -> bool:
        """Return True when the drive has left *fault* (at once where it is in none)."""
        if self._deadline is None:
            self._deadline = image.now + self._parameters.timing.transition
        if image.state not in (State.FAULT, State.FAULT_REACTION_ACTIVE, State.UNKNOWN):
            if self._edge_sent:
                order.goal = State.SWITCH_ON_DISABLED
            return True
        if image.now > self._deadline:
            raise self._failed(image)
        if image.state is State.FAULT:
            self._edge(image, order)
        return False

    def _edge(self, image: Image, order: Order) -> None:
        """Bit 7 low until the drive has surely seen it, then high until the fault is gone, then (once) again."""
        order.goal = State.SWITCH_ON_DISABLED
        period = self._parameters.scan_period
        if self._low_since is None:
            self._low_since = image.now
        high_from = self._low_since + 2 * period
        if image.now < high_from:
            order.word = 0
        elif image.now < high_from + max(0.5 * self._parameters.timing.transition, 4 * period):
            self._edge_sent = True
            order.word = cw.Command.FAULT_RESET.word
        else:
            self._low_since = None

    def _failed(self, image: Image) -> DriveError:
        name = self._parameters.name
        if image.state is State.UNKNOWN:
            return StaleError(
                f"{name}: cannot be reset, its statusword is unknown",
                axis=name,
                observed="no fresh 6041h",
                remedy="check the cable and that the node is operational (axisbus scan)",
            )
        return TransitionError(
            f"{name}: the fault does not go away",
            axis=name,
            observed=f"{_word(image)} after a rising edge of controlword bit 7"
            + (f"; the fault: {self._fault}" if self._fault else ""),
            remedy="its cause is still there: remove it, then reset again; some faults need the supply switched off and on",
        )


def _word(image: Image) -> str:
    return "no fresh statusword" if image.statusword is None else f"statusword 0x{image.statusword:04X}"
