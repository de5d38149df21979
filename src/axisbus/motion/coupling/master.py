"""Where the master of a slave is, and how fast, without a jump: by what leads it where that is ours, else by what its drive tells.

Theory of operation
-------------------
What this program itself leads is known to any fraction: the path of a trajectory, the last target in csp, a virtual axis. What a
drive tells (``Told``) comes in whole increments, and at moments of its own; so it is filtered, and carried on to where a target
would be.

What leads the master changes from command to command, and the kinds differ by a following error or a cycle. A drive that leads
itself goes on through cycles that this computer was too late for, and its slave, which had no targets meanwhile, is behind. Both
are debts, taken back little by little (``Debt``): the slave never jumps, and is in step again within a second or two.
"""

from __future__ import annotations

from typing import NamedTuple

from axisbus.errors import AxisbusError, NodeError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.entries import By
from axisbus.motion.coupling.told import Debt, Told
from axisbus.motion.states import AxisState

_PATH, _TARGET, _TOLD = "path", "target", "told"


class _Led(NamedTuple):
    """By what kind of value a master is led, where to in the last cycle, and in the one before that."""

    kind: str
    place: float
    before: float


class Master:
    """Follows one axis; ``place`` (its unit) and ``velocity`` (per s) are those of the last step."""

    def __init__(self, core: AxisCore, by: By, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self.core = core
        self.place = 0.0
        self.velocity = 0.0
        self._by = by
        self._period = period
        self._origin = core.image.origin  # what is counted anew meanwhile moves no slave
        self._kind: str | None = None
        self._target: float | None = None  # the last one
        self._debt = Debt(period)
        self._told = Told(core, by, period)

    @property
    def name(self) -> str:
        """The axis."""
        return self.core.parameters.name

    def step(self) -> None:
        """Once per cycle, before the axes: see where it was led to, or is, in the cycle before.

        Raises:
            AxisbusError: it is lost: nobody knows where it will be.
        """
        lost = self._lost()
        if lost is not None:
            raise lost
        led = self._led() if self._by is By.COMMAND else None
        if led is None:
            self._take_told()
        else:
            self._take_led(led)

    def _lost(self) -> AxisbusError | None:
        core, image = self.core, self.core.image
        if core.state is AxisState.ERRORSTOP:
            observed = "" if core.error is None else core.error.message
            return StateError(f"{self.name} is in ErrorStop", observed=observed)
        if core.state is AxisState.HOMING:
            return StateError(f"{self.name} is being homed, and counts anew")
        if image.position is None or not image.operational:
            return NodeError(f"nobody knows where {self.name} is", node=core.parameters.node)
        return None

    def _led(self) -> _Led | None:
        """Return where it is led to exactly; None where its drive leads itself, or nothing does."""
        path, core, units = self.core.leading_path, self.core, self.core.parameters.units.position
        if core.parameters.encoder:
            return None
        target = core.image.position if core.parameters.virtual else core.image.led.target
        before, self._target = self._target, None if target is None else units.to_units(target - self._origin)
        if path is not None:
            place = path.last_step.position + units.to_units(core.image.origin - self._origin)
            return _Led(_PATH, place, place - path.last_step.velocity * self._period)
        if self._target is None:
            return None
        return _Led(_TARGET, self._target, self._target if before is None else before)

    def _take_led(self, led: _Led) -> None:
        before, self._kind = self._kind, led.kind
        if before is None:
            self.place, self.velocity = led.place, (led.place - led.before) / self._period
            return
        if led.kind != before:
            self._debt.add(self.place - led.before - self._debt.value, self.velocity)
        self._go_to(led.place)

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
