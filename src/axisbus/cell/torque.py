"""The torque of a drive by its objects: the rated torque compared with cell.toml, and the highest allowed torque."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from axisbus.cell.scale_proposal import ScaleReport
from axisbus.cia402 import objects as o
from axisbus.motion.parameters import AxisLimits

_MILLI = 1000  # 6076h is in mN·m, 6072h in 0.1 % of rated torque (CiA 402-2 16.4)
_TOLERANCE = 0.01

Read = Callable[[int], int | None]


def compare(rated: float | None, drive: int | None) -> ScaleReport | None:
    """Compare ``rated_torque`` (N·m, with or without a sign) with 6076h; None if the cell file does not give it.

    Torques are sent as parts of the rated torque: if the two differ, the motor's torque differs from the commanded torque.
    """
    if rated is None:
        return None
    configured = f"{abs(rated):g} N·m"
    if not drive:
        return ScaleReport(configured, "the drive's objects suggest nothing (6076h is missing or 0)", None)
    agrees = abs(abs(rated) - drive / _MILLI) <= _TOLERANCE * abs(rated)
    if agrees:
        return ScaleReport(configured, "agrees with the drive's object (6076h)", agrees)
    ratio = drive / _MILLI / abs(rated)
    text = f"6076h has {drive / _MILLI:g} N·m: if it is right, the motor gives {ratio:.3g} times the commanded torque"
    return ScaleReport(configured, text, agrees)


def limited(limits: AxisLimits, rated: float | None, read: Read) -> AxisLimits:
    """Return ``limits`` with the drive's own highest torque (6072h) if the cell file gives none; ``rated`` in N·m."""
    most = read(o.MAX_TORQUE)
    if limits.torque is not None or rated is None or not most:
        return limits
    return replace(limits, torque=most / _MILLI * abs(rated), torque_key="the drive's 6072h")
