"""A slave axis coupled to a master, in cyclic synchronous position mode; and a released slave, which keeps its speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from axisbus.errors import AxisbusError, LimitError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.commands import PhaseBy
from axisbus.motion.coupling.master import Master
from axisbus.motion.group.start_barrier import OPEN
from axisbus.motion.moves.follow import Follow, Foreseen
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import LimitExceeded, PathSample
from axisbus.motion.position_limits import PositionRange, rest_beyond
from axisbus.motion.superimposed import Shift

_ENDLESS = 1e9  # seconds


class SlaveSetPointSource(Protocol):
    """The source of a slave's set-points (``Engagement``)."""

    failure: AxisbusError | None
    refused: bool
    is_synchronised: bool
    master: Master
    phase: PhaseShift
    position: float

    def require_start(self, position: float, velocity: float) -> None:
        """Raise AxisbusError if a slave at ``position`` with ``velocity`` (unit/s) cannot be coupled."""

    def begin_commanding(self, position: float, velocity: float) -> None:
        """Command the slave from the next cycle on; it is at ``position``, with ``velocity`` (unit/s)."""


class _NoClock:
    """The clock of a slave: it does not advance, because the master determines the slave's path."""

    t = 0.0
    braking = False
    stopped = False

    def as_text(self, _: float) -> str:
        return "this moment"

    def advance(self, period: float) -> None:
        """Do nothing."""


class _SlaveSetPoint:
    """The set-point of a slave, as a path to follow."""

    duration = _ENDLESS

    def __init__(self, source: SlaveSetPointSource) -> None:
        self._source = source

    def position(self, _: float) -> float:
        return self._source.position


@dataclass(frozen=True, slots=True)
class _Steady:
    """Continue at the constant velocity of ``start``."""

    start: PathSample
    duration: float = _ENDLESS

    def position(self, t: float) -> float:
        return self.start.position + self.start.velocity * t


class Coupled(Follow):
    """One slave. A halt ends the coupling, and brakes the axis at its own deceleration.

    Its command ends as done when the slave is synchronised; the slave then continues to follow its master.
    """

    keeps_moving = True
    ends_at_rest = False

    def __init__(
        self, source: SlaveSetPointSource, parameters: AxisParameters, before: Follow | None
    ) -> None:
        """``before``: the path that commands the axis now; None if there is none."""
        super().__init__(_SlaveSetPoint(source), parameters, OPEN)
        self._source = source
        self._own_clock = False
        self.clock = _NoClock()
        self.brakes_along = True
        self._is_commanding = before is None
        self._is_synchronised = False  # synchronised: its command has ended
        if before is not None:
            self.resume(before)

    def require_start(self, core: AxisCore) -> None:
        """Raise AxisbusError if the axis cannot be coupled at its present position; the axis is then unchanged."""
        if not self._is_commanding:
            self._source.require_start(*self.last_step)
        elif core.image.position is not None:
            position = self.reference(core.image) - core.image.origin
            self._source.require_start(core.parameters.units.position.to_units(position), 0.0)

    @property
    def master(self) -> AxisCore:
        """The master of this slave."""
        return self._source.master.core

    @property
    def is_coupled(self) -> bool:
        """Whether the slave still follows its master."""
        return self._running and not self.clock.braking

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the axis is synchronised with its master and no phase shift is in progress."""
        if not self.clock.braking and self._source.failure is not None:
            self._stepped, self.refused = True, self._source.refused
            raise self._source.failure
        if not self._is_commanding:
            self._is_commanding = True
            self._source.begin_commanding(*self.last_step)
        super().step(image, order)
        self._is_synchronised = self._source.is_synchronised and self._source.phase.over
        return self._is_synchronised

    def phase_by(self, command: PhaseBy, name: str) -> None:
        """Shift the phase of the master as this slave sees it, gradually.

        Raises:
            StateError: the axis is not yet synchronised with its master.
        """
        if not self._source.is_synchronised:
            raise StateError(
                f"{name}: {self._parameters.name} is not synchronised with {self._source.master.name} yet",
                remedy="wait until it is synchronised: then the handle of gear_in or cam_in is done",
            )
        self._source.phase.change(command)
        self._is_synchronised = False

    def foresee(self) -> Foreseen | None:
        """Return the next target, as ``Follow`` does, as long as the axis is synchronised and can stop within its limits."""
        source, limits = self._source, self._limits
        if source.failure is not None or not self._is_synchronised:
            return None
        if (
            limits is not None
            and self._step is not None
            and self._stop_outside(source.position + self.shifted, limits) is not None
        ):
            return None
        return super().foresee()

    def begin_braking(self) -> bool:
        """Begin to brake at the axis's own deceleration; False if it does not run or no deceleration is known."""
        return self.brake_alone()

    def _start(self, image: AxisImage) -> None:
        units = self._parameters.units.position
        self._source.begin_commanding(units.to_units(self.reference(image) - image.origin), 0.0)
        super()._start(image)

    def _record_step(self, value: float) -> None:
        if self._step is not None and not self.clock.braking and self._limits is not None:
            stop = self._stop_outside(value, self._limits)
            if stop is not None:
                raise self._leaves_limits(value, stop)
        super()._record_step(value)

    def _stop_outside(self, value: float, limits: PositionRange) -> float | None:
        """Return the position to which the axis would brake if that is outside its limits; the master's next motion is unknown."""
        speed = (value - self.last_step.position) / self._period
        deceleration = self._parameters.path_deceleration
        assert deceleration  # without it the axis would not have been coupled
        return rest_beyond(limits, value, speed, deceleration)

    def _leaves_limits(self, value: float, stop: float) -> LimitError:
        speed = (value - self.last_step.position) / self._period
        name, unit, limits = self._parameters.name, self._parameters.units.position.unit, self._edges
        seen = f"at {value:g} {unit}, with {speed:g} {unit}/s, it would stop at {stop:g} {unit}"
        if limits is None:
            return self._count_exceeded("the motion of its master", seen, "braked")
        return LimitError(
            f"{name}: the motion of its master would take it out of the position limits",
            observed=f"{seen}; the allowed range is {limits[0]:g} to {limits[1]:g}",
            remedy=f"check the motion of the master and how {name} is coupled to it, or change position_limits in "
            f"[axes.{name}] of cell.toml; the axis was braked, to stop within them",
        )

    def _limit_exceeded(self, found: LimitExceeded, _: float) -> LimitError:
        name = self._parameters.name
        return LimitError(
            f"{name}: the motion of its master would make it {found.what}",
            observed=found.seen,
            remedy="move the master more slowly, use another ratio, give the slave a longer distance to synchronise "
            f"(master_start_distance = ...), or raise the limit in [axes.{name}] of cell.toml; the axis was braked",
        )


class Disengaged(Follow):
    """An axis that has left its master, and continues at its last velocity (MC_GearOut)."""

    keeps_moving = True
    ends_at_rest = False
    foresees = False

    def __init__(self, before: Follow, parameters: AxisParameters) -> None:
        super().__init__(_Steady(before.last_step), parameters, OPEN)
        self.resume(before)

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True: the command ends at once, and the axis continues on its own."""
        super().step(image, order)
        return True


# -- Chains of couplings: a slave may be the master of other slaves, but not of its own master -------------------------


def require_no_ring(master: AxisCore, slave: AxisCore, name: str) -> None:
    """Raise StateError if ``master`` follows ``slave``, directly or through others; ``name``: the command, for the message."""
    chain = [slave.parameters.name]
    current: AxisCore | None = master
    while current is not None:
        chain.append(current.parameters.name)
        if current is slave:
            raise StateError(
                f"{name}: an axis cannot be its own master, directly or over other axes",
                observed=" is led by ".join(chain),
                remedy=f"release one of the couplings first: {master.parameters.name}.halt()",
            )
        activity = current.activity
        current = activity.master if isinstance(activity, Coupled) else None


# -- The phase shift between a slave and its master, which can be changed while both move (MC_PhasingRelative) ---------


class PhaseShift:
    """Holds the shift (``value``, in units of the master) and its change in progress."""

    def __init__(self, period: float) -> None:
        """``period``: scan period in seconds."""
        self._shift = Shift(period)

    @property
    def value(self) -> float:
        """The present shift in units of the master."""
        return self._shift.value

    @property
    def over(self) -> bool:
        """Whether no change is in progress."""
        return self._shift.at_rest

    def change(self, command: PhaseBy) -> None:
        """Change the shift by ``command.shift`` more, from its present value and rate; the rest of an earlier change is added."""
        end = self._shift.end + command.shift
        self._shift.aim(end, command.velocity, command.acceleration, command.acceleration)

    def step(self) -> None:
        """Advance by one cycle of the synchronised slave."""
        if not self._shift.at_rest:
            self._shift.go(self._shift.wanted())
