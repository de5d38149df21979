"""The user's own kinematics, as their author writes them, and the calls to them with clear errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, runtime_checkable

from axisbus.errors import ArgumentError, AxisbusError, LimitError, one_line
from axisbus.machine.axis import Axis
from axisbus.motion.group.kinematics import CoreXY, Delta, Kinematics, Scara
from axisbus.motion.group.segments import Coordinates
from axisbus.motion.numbers import number, short_repr
from axisbus.wording import counted

_BUILT_IN = (CoreXY, Scara, Delta)  # known to the core


@runtime_checkable
class UserKinematics(Protocol):
    """The relation between a group's axes and its workspace; called only in the program, before anything moves.

    A workspace may have any number of coordinates, also other than the number of axes. Both functions must be smooth where the tool
    moves.
    """

    def forward(self, joints: Sequence[float], /) -> Sequence[float]:
        """Return the coordinates for the axes' positions, in their units and in the group's order."""

    def inverse(self, coordinates: Sequence[float], near: Sequence[float], /) -> Sequence[float]:
        """Return the axes' positions for a position in the workspace.

        Of several solutions, return the one that continues from ``near``, the axes' positions just before on the path. Raise
        ValueError if the position is out of reach.
        """


def kinematics_for(
    text: str, kinematics: Kinematics | UserKinematics, axes: Mapping[str, Axis], accuracy: float | None
) -> Kinematics | UserKinematicsAdapter:
    """Return kinematics as a group calls them; ``text`` is the beginning of messages.

    Raises:
        ArgumentError: they have no forward and inverse, ``accuracy`` is no distance, or it is given for kinematics of the core.
    """
    if type(kinematics) in _BUILT_IN:
        if accuracy is not None:
            raise ArgumentError(
                f"{text}: {type(kinematics).__name__} is computed exactly, so it has no accuracy",
                remedy="leave accuracy out",
            )
        return kinematics  # type: ignore[return-value]
    if not isinstance(kinematics, UserKinematics):
        raise ArgumentError(
            f"{text}: {short_repr(kinematics)} is not a kinematics object",
            observed="it has no methods forward and inverse",
            remedy="give Scara, Delta, CoreXY, or an object with forward(joints) and inverse(coordinates, near)",
        )
    if accuracy is not None and not (number(accuracy) or 0.0) > 0.0:
        raise ArgumentError(
            f"{text}: accuracy {short_repr(accuracy)} is not a distance",
            remedy="give the allowed deviation of the tool from its path between two samples, above 0; or leave it out: one "
            "increment",
        )
    return UserKinematicsAdapter(kinematics, axes, accuracy)


class UserKinematicsAdapter:
    """The user's kinematics for a group; stores no positions."""

    def __init__(self, kinematics: UserKinematics, axes: Mapping[str, Axis], accuracy: float | None) -> None:
        """``accuracy``: allowed deviation of the tool from its path (workspace units); None: its movement by one increment."""
        self._kinematics = kinematics
        self._axes = dict(axes)
        self._accuracy = accuracy
        self._increments = tuple(axis.increment for axis in axes.values())

    @property
    def axes(self) -> tuple[str, ...]:
        """The names of its axes, in their order."""
        return tuple(self._axes)

    def limits(self, start: Coordinates) -> tuple[tuple[str, str, tuple[float, float] | None], ...]:
        """Return for each axis its name, its unit, and the position limits of a path from ``start``."""
        return tuple(
            (name, axis.unit, axis.room_from(coordinates))
            for (name, axis), coordinates in zip(self._axes.items(), start, strict=True)
        )

    @property
    def name(self) -> str:
        """The name of its class."""
        return type(self._kinematics).__name__

    def forward(self, joints: Coordinates) -> Coordinates:
        """Return the coordinates for the axes' positions; raises as ``inverse``."""
        return self._called("forward", lambda: self._kinematics.forward(joints), f"at {listed(joints)}")

    def inverse(self, coordinates: Coordinates, near: Coordinates) -> Coordinates:
        """Return the axes' positions for a position in the workspace.

        Raises:
            LimitError: the user's function raised ValueError: the position is out of reach.
            ArgumentError: it raised another exception, or did not return positions.
        """
        found = self._called(
            "inverse",
            lambda: self._kinematics.inverse(coordinates, near),
            f"for the pose {listed(coordinates)}",
        )
        if len(found) != len(self._axes):
            raise ArgumentError(
                f"{self.name}.inverse returned {counted(len(found), 'position')} for the pose {listed(coordinates)}",
                observed=f"the group has {counted(len(self._axes), 'axis', 'axes')}: {', '.join(self._axes)}",
                remedy="it must return one for each, in this order; nothing has moved",
            )
        return found

    def allowed(self, joints: Coordinates, coordinates: Coordinates) -> float:
        """Return the allowed deviation of the tool near ``joints``, which correspond to ``coordinates``.

        It is the requested accuracy, otherwise the distance by which one increment of one axis moves the tool.
        """
        if self._accuracy is not None:
            return self._accuracy
        return tool_step(self.forward, joints, coordinates, self._increments)

    def require_fit(self, coordinates: Coordinates, joints: Coordinates) -> None:
        """Raise ArgumentError if ``forward`` of ``joints`` is not ``coordinates``, for which ``inverse`` returned them."""
        back = self.forward(joints)
        if len(back) != len(coordinates):
            raise ArgumentError(
                f"{self.name}.forward returned {counted(len(back), 'coordinate')} at {listed(joints)}",
                observed=f"at the present position of the axes it returned {len(coordinates)}",
                remedy="it must always return the same number of coordinates; nothing has moved",
            )
        deviation, allowed = math.dist(back, coordinates), self.allowed(joints, back)
        if deviation > allowed:
            raise ArgumentError(
                f"{self.name}.forward and inverse do not agree at {listed(coordinates)}",
                observed=f"inverse returns {listed(joints)}, from which forward computes {listed(back)}: {deviation:.3g} away, "
                f"the limit is {allowed:.3g}",
                remedy="correct them, or give accuracy = ... if the inverse is not exact; nothing has moved",
            )

    def is_same(self, joints: Coordinates, there: Coordinates) -> str:
        """Return a text about the axis that is not at ``joints`` within its start tolerance; "" if all axes are."""
        for (name, axis), a, b in zip(self._axes.items(), joints, there, strict=True):
            if abs(a - b) > axis.start_tolerance:
                return f"{name} is at {b:.6g} {axis.unit}, and must be at {a:.6g}"
        return ""

    def _called(self, method: str, call: Callable[[], Sequence[float]], where: str) -> Coordinates:
        """Return the result of a function of the user."""
        try:
            given = call()
            values = [number(value) for value in given]
        except ValueError as error:
            raise LimitError(
                f"{self.name}.{method} says {where}: {one_line(error)}",
                remedy="choose another path within the reach of the machine; nothing has moved",
            ) from error
        except Exception as error:
            raise ArgumentError(
                f"{self.name}.{method} failed {where}: {one_line(error)}",
                remedy=f"correct {self.name}.{method}; nothing has moved",
            ) from error
        if not values or None in values:
            raise ArgumentError(
                f"{self.name}.{method} returned {short_repr(given)} {where}",
                observed="each must be a finite number",
                remedy=f"correct {self.name}.{method}, or let it raise ValueError if it has no solution; nothing has moved",
            )
        return tuple(value for value in values if value is not None)


def prefixed(text: str, error: AxisbusError) -> AxisbusError:
    """Return an error with ``text``, the name of the call, in front."""
    return type(error)(f"{text}: {error.message}", observed=error.observed, remedy=error.remedy)


def listed(coordinates: Sequence[float]) -> str:
    """Return numbers as text for messages."""
    return f"({', '.join(f'{value:.6g}' for value in coordinates)})"


# -- The resolution of a workspace, by the increments of its axes ------------------------------------------------------


def tool_step(
    forward: Callable[[Coordinates], Sequence[float]],
    joints: Coordinates,
    coordinates: Sequence[float],
    increments: Sequence[float],
) -> float:
    """Return the largest distance by which one increment of an axis moves the tool, if ``joints`` correspond to ``coordinates``."""
    moved = (
        tuple(value + (step if n == axis else 0.0) for n, value in enumerate(joints))
        for axis, step in enumerate(increments)
    )
    return max(math.dist(coordinates, forward(near)) for near in moved)
