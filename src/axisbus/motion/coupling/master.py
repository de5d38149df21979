"""Position and velocity of a coupling's master, without jumps: commanded values if the master controls it, else reported ones.

Theory of operation
-------------------
If this program controls the axis, its position is known exactly: the path of a trajectory, the last target in csp, a virtual axis.
Values reported by a drive (``MasterEstimator``) are whole increments and come at their own times. They are therefore filtered, and
extrapolated to the time at which a target takes effect.

The source of the position changes from command to command, and the sources differ by a following error or by one cycle. A drive
that controls its own motion continues during cycles that the computer misses; its slave gets no targets meanwhile and lags. Both
deviations are removed gradually (``LagCorrection``): the slave never jumps, and is synchronised again within a second or two.
"""

from __future__ import annotations

from axisbus.errors import AxisbusError, NodeError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.master_estimator import LagCorrection, MasterEstimator
from axisbus.motion.coupling.sync_options import By
from axisbus.motion.states import AxisState

_PATH, _TARGET, _TOLD = "path", "target", "told"
_UNKNOWN = frozenset({AxisState.ERRORSTOP, AxisState.HOMING})


class Master:
    """Follows one axis; ``place`` (in its unit) and ``velocity`` (per s) are those of the last step."""

    def __init__(self, core: AxisCore, by: By, period: float) -> None:
        """``period``: scan period in seconds."""
        self.core = core
        self.place = 0.0
        self.velocity = 0.0
        self._by = by
        self._period = period
        self._origin = core.image.origin  # fixed, so that a change of the origin does not move a slave
        self._kind: str | None = None
        self._target: int | None = None  # the last one, in increments
        self._debt = LagCorrection(period)
        self._told = MasterEstimator(core, by, period)

    @property
    def name(self) -> str:
        """The name of the axis."""
        return self.core.parameters.name

    def step(self) -> None:
        """Update position and velocity from the last cycle's commanded or reported values; once per cycle, before the axes.

        Raises:
            AxisbusError: the axis is lost, homing or in ErrorStop, so its position is unknown.
        """
        core, image = self.core, self.core.image
        if core.state in _UNKNOWN or image.position is None or not image.operational:
            raise self._lost()
        before, self._target = self._target, self._leads_to()
        path = core.leading_path
        if self._by is not By.COMMAND or (path is None and self._target is None):
            self._take_told()
        elif path is not None:
            place = path.last_step.position + self._moved
            self._take_led(_PATH, place, path.last_step.velocity * self._period)
        else:
            assert self._target is not None
            place = self._counted(self._target)
            self._take_led(_TARGET, place, 0.0 if before is None else place - self._counted(before))

    def _lost(self) -> AxisbusError:
        core = self.core
        if core.state is AxisState.ERRORSTOP:
            observed = "" if core.error is None else core.error.message
            return StateError(f"{self.name} is in ErrorStop", observed=observed)
        if core.state is AxisState.HOMING:
            return StateError(f"{self.name} is being homed, and will count from the new home")
        return NodeError(f"the position of {self.name} is unknown", node=core.parameters.node)

    def _leads_to(self) -> int | None:
        """Return the last target in increments; None if the drive controls its own motion, or the axis is not controlled."""
        core = self.core
        if core.parameters.encoder:
            return None
        return core.image.position if core.parameters.virtual else core.image.led.target

    @property
    def _moved(self) -> float:
        """The distance by which the axis's origin has moved since the start, in its unit."""
        origin = self.core.image.origin
        return (
            0.0
            if origin == self._origin
            else self.core.parameters.units.position.to_units(origin - self._origin)
        )

    def _counted(self, increment: int) -> float:
        return self.core.parameters.units.position.to_units(increment - self._origin)

    def _take_led(self, kind: str, place: float, went: float) -> None:
        """Use a commanded position; ``went``: distance commanded in the last cycle."""
        before, self._kind = self._kind, kind
        if before is None:
            self.place, self.velocity = place, went / self._period
            return
        if kind is not before:
            self._debt.add(self.place - (place - went) - self._debt.value, self.velocity)
        self._go_to(place)

    def _take_told(self) -> None:
        told, before = self._told, self._kind
        self._kind = _TOLD
        if before is None:
            told.begin(self._origin)
            told.step(self._origin)
            self.place, self.velocity = told.due, told.velocity
            return
        if before is not _TOLD:
            told.go_on_from(self.place - self._debt.value, self.velocity - self._debt.rate)
        self._debt.add(-told.step(self._origin), self.velocity)
        self._go_to(told.due)

    def _go_to(self, due: float) -> None:
        before, self.place = self.place, due + self._debt.step()
        self.velocity = (self.place - before) / self._period
