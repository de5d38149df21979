"""The checked options of a controller: its output, its ramps, and the number of cycles that an answer may be missing."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from typing import NamedTuple

from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import ArgumentError
from axisbus.machine.request import AxisCall
from axisbus.motion.commands import ControllerCommand, CyclicTorque
from axisbus.motion.numbers import told
from axisbus.motion.parameters import AxisParameters

_LATEST = 1000  # cycles
_WAYS = ("velocity", "torque")


class Answering(NamedTuple):
    """How answers are applied in ``mode``; ``limit`` of their magnitude (None: none); ``raw`` converts and checks one."""

    command: ControllerCommand
    mode: ModeOfOperation
    limit: float | None
    raw: Callable[[float], int]


class ControllerRamps(NamedTuple):
    """The ramps of the call: unit/s² or N·m/s; None: the defaults of the axis."""

    acceleration: float | None
    deceleration: float | None
    slope: float | None


def answering_of(parameters: AxisParameters, by: object, ramps: ControllerRamps, late: object) -> Answering:
    """Return how a controller's answers are applied to an axis.

    Raises:
        ArgumentError, LimitError: a value that a controller cannot have, or a missing value.
    """
    request = AxisCall(parameters, "controller")
    if not isinstance(by, str) or by not in _WAYS:
        raise ArgumentError(
            f"{request.text}: output {told(by)} is not known",
            remedy='give "velocity" (unit/s, in csv) or "torque" (N·m, in cst)',
        )
    if not isinstance(late, int) or isinstance(late, bool) or not 0 <= late <= _LATEST:
        raise ArgumentError(
            f"{request.text}: max_missed_cycles {told(late)} is not a number of cycles from 0 to {_LATEST}"
        )
    number = secrets.randbits(48)
    if by == "velocity":
        up, down = ramps.acceleration, ramps.deceleration
        begin = request.cyclic_velocity(0.0, up, down)
        return Answering(
            ControllerCommand(number, begin, late),
            ModeOfOperation.CYCLIC_SYNC_VELOCITY,
            parameters.limits.velocity,
            lambda value: request.cyclic_velocity(value, up, down).velocity,
        )
    push = CyclicTorque(request.torque(0.0), request.cyclic_slope(ramps.slope))
    return Answering(
        ControllerCommand(number, push, late),
        ModeOfOperation.CYCLIC_SYNC_TORQUE,
        parameters.limits.torque,
        request.torque,
    )
