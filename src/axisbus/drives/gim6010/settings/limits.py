"""The module's own limits of velocity and motor current, which apply to every kind of command (manual v2.2, 3.1.3)."""

from __future__ import annotations

import math

from axisbus.drives.gim6010.can_simple.messages import HIGHEST_CURRENT
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.drives.gim6010.settings.parameter_batch import ParameterBatch
from axisbus.errors import ArgumentError, LimitError

VELOCITY, CURRENT = "axis0.controller.config.vel_limit", "axis0.motor.config.current_lim"
PATHS = (VELOCITY, CURRENT)
_TORQUE = (
    "the limit of velocity does not hold under torque control unless enable_torque_mode_vel_limit is set"
)


def wanted(velocity: float | None, current: float | None) -> ParameterBatch:
    """Return the parameters that set the limits: ``velocity`` in rotor turns/s, ``current`` in A, at most 50; None: unchanged.

    Raises:
        ArgumentError: neither is given, or one is not above 0. LimitError: the current is above the module's maximum.
    """
    check(velocity, current)
    given: dict[str, Value | None] = {VELOCITY: velocity, CURRENT: current}
    return ParameterBatch(
        tuple((path, value) for path, value in given.items() if value is not None), (_TORQUE,)
    )


def check(velocity: float | None, current: float | None) -> None:
    """Check limits before setting them; raises as ``wanted``."""
    if velocity is None and current is None:
        raise ArgumentError(
            "no limit is given", remedy="give --velocity in turns/s of the rotor, --current in A, or both"
        )
    for name, value in (("velocity", velocity), ("current", current)):
        if value is not None and not 0.0 < value < math.inf:
            raise ArgumentError(
                f"limit of {name}: {value!r} is not above 0", remedy="give the intended limit"
            )
    if current is not None and current > HIGHEST_CURRENT:
        raise LimitError(
            f"limit of current: {current:g} A is more than the module permits",
            remedy=f"give at most {HIGHEST_CURRENT:g} A (manual v2.2, 3.1.3)",
        )
