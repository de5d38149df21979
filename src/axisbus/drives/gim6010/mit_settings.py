"""Settings of a module under MIT control; none of them has a default."""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.drives.gim6010.can_simple import mit
from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.can_simple.identifier import require_node
from axisbus.drives.gim6010.can_simple.mit import MitRanges
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.errors import ArgumentError

_SHORTEST, _LONGEST = 0.001, 0.1  # s: limits of the period
_STEPS = 4095  # steps of a gain on the wire
_FIXED_UP_TO = Firmware(0, 6, 0)  # from this version on the ranges are parameters
_PATHS = tuple(f"axis0.controller.config.mit_max_{name}" for name in ("pos", "vel", "kp", "kd", "torque"))


@dataclass(frozen=True, slots=True)
class MitSettings:
    """One module under MIT control.

    ``node`` is 0 to 63. ``ranges`` are those of its firmware: the manual's up to 0.5.14, parameters in later versions; wrong ranges
    give values that are wrong by their ratio. ``gear`` is in turns of the rotor per turn of the output. ``damping`` is the kd, in
    the firmware's unit, for braking at every shutdown. ``period`` (0.001 to 0.1 s) is the period of the frames. If the program
    gives no command for ``command_timeout`` (s, at least two periods, at most 1), it is considered dead.

    Raises:
        ArgumentError: a value is invalid.
    """

    node: int
    ranges: MitRanges
    gear: float
    damping: float
    period: float
    command_timeout: float

    def __post_init__(self) -> None:
        require_node(self.node)
        if not isinstance(self.ranges, MitRanges):
            raise ArgumentError(
                "ranges of MIT control are not given", remedy="give MitRanges as the module has them"
            )
        least = self.ranges.kd / _STEPS
        self._check("gear", 1e-3, 1e3, "turns of the rotor per turn of the output")
        self._check("damping", least, self.ranges.kd, "the damping of every stop: above 0")
        self._check("period", _SHORTEST, _LONGEST, "seconds")
        self._check("command_timeout", 2.0 * self.period, 1.0, "seconds, two periods at the least")

    def _check(self, name: str, low: float, high: float, what: str) -> None:
        value = getattr(self, name)
        good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not good or not low <= value <= high:
            raise ArgumentError(
                f"{name} of MIT control: {value!r}", remedy=f"give {low:.4g} to {high:.4g}: {what}"
            )

    def stiffness(self, kp: float) -> float:
        """Return the stiffness at the output for a gain ``kp``, in N·m/rad, by the gear."""
        return mit.output_stiffness(kp, self.gear)

    def kp_for(self, stiffness: float) -> float:
        """Return the gain ``kp`` for a stiffness at the output, in N·m/rad."""
        return stiffness * math.tau / self.gear

    def output_damping(self, kd: float) -> float:
        """Return the damping at the output for a gain ``kd``, in N·m per rad/s, by the gear."""
        return mit.output_damping(kd, self.gear)


def ranges_of(module: ModuleParameters) -> MitRanges:
    """Return the ranges of a module: its parameters, or the manual's, which are fixed up to firmware 0.5.14. Blocks.

    Raises:
        ArgumentError: a range is invalid. BusError: as ``ModuleParameters.read``.
    """
    if module.firmware < _FIXED_UP_TO:
        return MitRanges()
    return MitRanges(*(float(module.read(path)) for path in _PATHS))
