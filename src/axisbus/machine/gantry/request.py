"""Check the arguments of a gantry's call, in the axes' unit: the limits of both axes apply to the beam."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.cia402.touch_probe import Edge
from axisbus.errors import ArgumentError, LimitError
from axisbus.machine.axis import Axis
from axisbus.machine.probing import require_objects
from axisbus.machine.request import AxisCall
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.parameters import AxisLimits, AxisParameters, Defaults


class BeamRequest:
    """One call, such as ``y.move_absolute(90 mm)``; raises ArgumentError for a missing value, LimitError beyond a limit."""

    def __init__(
        self,
        pair: GantryParameters,
        axes: tuple[Axis, Axis],
        parameters: tuple[AxisParameters, AxisParameters],
        text: str,
    ) -> None:
        """``text`` names the call in messages."""
        self.text = f"{pair.name}.{text}"
        self._pair, self._axes, self._parameters = pair, axes, parameters
        self._call = text
        self._unit = parameters[0].units.position.unit

    def finite(self, what: str, value: float) -> float:
        """Return ``value``, which must be a finite number."""
        return AxisCall(self._parameters[0], self._call).finite(what, value)

    def positive(self, what: str, value: float) -> float:
        """Return ``value``, which must be above 0."""
        return AxisCall(self._parameters[0], self._call).positive(what, value)

    def place(self, position: float) -> float:
        """Return a position of the beam that both axes can reach."""
        place = self.finite("position", position)
        for axis, at in zip(self._axes, (place, place + self._pair.offset), strict=True):
            axis._absolute_increments(self._call, at)
        return place

    def named(self, position: float) -> float:
        """Return the value for the beam's present position (``set_position``), which must be in the range of both drives."""
        place = self.finite("position", position)
        for parameters, at in zip(self._parameters, (place, place + self._pair.offset), strict=True):
            AxisCall(parameters, self._call).place(at)
        return place

    def distance(self, distance: float) -> float:
        """Return a distance that is in the range of both drives."""
        for parameters in self._parameters:
            AxisCall(parameters, self._call).distance(distance)
        return float(distance)

    def velocity(self, value: float | None) -> float:
        """Return a velocity (unit/s), by default the smaller of the axes', within the limits of both."""
        return self._within(
            "velocity", value, lambda found: found.velocity, lambda limits: limits.velocity, "/s"
        )

    def acceleration(self, value: float | None) -> float:
        """Return an acceleration (unit/s²), by default the smaller of the axes', within the limits of both."""
        return self._within(
            "acceleration", value, lambda found: found.acceleration, lambda limits: limits.acceleration, "/s²"
        )

    def jerk(self, value: float | None) -> float | None:
        """Return a jerk limit (unit/s³); None if neither the call nor an axis's default gives one."""
        if value is None:
            known = [one for each in self._parameters if (one := each.defaults.jerk) is not None]
            return min(known, default=None)
        return None if isinstance(value, float) and value == float("inf") else self.positive("jerk", value)

    def homing(self) -> None:
        """Raise ArgumentError if no homing is configured, StateError if a drive has no touch probe."""
        plan, name = self._pair.homing, self._pair.name
        if plan is None:
            raise ArgumentError(
                f"{self.text}: the cell file does not say how the pair is homed",
                remedy=f"add [gantries.{name}.homing] to cell.toml; or give the position of the beam: {name}.set_position(...)",
            )
        for parameters in self._parameters[: 2 if plan.each else 1]:
            require_objects(
                AxisCall(parameters, self._call), parameters, plan.input, frozenset[Edge]({plan.edge})
            )

    def _within(
        self,
        what: str,
        value: float | None,
        default: Callable[[Defaults], float | None],
        limit: Callable[[AxisLimits], float | None],
        per: str,
    ) -> float:
        if value is None:
            value = self._default(what, default)
        found = self.positive(what, value)
        for parameters in self._parameters:
            most = limit(parameters.limits)
            if most is not None and found > most:
                raise LimitError(
                    f"{self.text}: {what} {found:g} {self._unit}{per} is beyond that of {parameters.name}",
                    observed=f"its max_{what} is {most:g} {self._unit}{per}",
                    remedy=f"give less, or change max_{what} in [axes.{parameters.name}] of cell.toml",
                )
        return found

    def _default(self, what: str, default: Callable[[Defaults], float | None]) -> float:
        found = []
        for parameters in self._parameters:
            known = default(parameters.defaults)
            if known is None:
                raise ArgumentError(
                    f"{self.text}: {what} is missing",
                    observed=f"the call does not give it, and {parameters.name} has no default",
                    remedy=f"give {what} = ... in the call, or {what} in [axes.{parameters.name}.defaults]",
                )
            found.append(known)
        return min(found)
