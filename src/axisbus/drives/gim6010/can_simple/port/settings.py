"""What a port must be told of its module, because no message of CAN Simple tells it; all of it on the rotor's side of the gear."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from axisbus.drives.gim6010.can_simple.identifier import NODES
from axisbus.drives.gim6010.can_simple.messages import HIGHEST_CURRENT
from axisbus.errors import ArgumentError, LimitError

HEARTBEAT, HEARTBEAT_BY_LINE = (
    0.1,
    0.35,
)  # s: as from the factory (manual v2.2, 4.1.5), and as a relay's are counted on
_FRESH, _FRESH_BY_LINE = 0.1, 1.0  # the line: an answer that is lost costs half a second
_MAY_BE_ZERO = frozenset({"break_timeout"})


@dataclass(frozen=True, slots=True)
class TorqueSettings:
    """What makes a torque of an axis one of the rotor.

    ``constant`` in N·m/A is what the module has as ``torque_constant`` (the manual contradicts itself: none is taken for granted),
    ``rated`` in N·m is what 1000 ‰ are, at the rotor: that of the output divided by the gear ratio. ``ramp`` in N·m/s is what the
    module has as ``torque_ramp_rate``.

    Raises:
        ArgumentError: a value is not above 0.
    """

    constant: float
    rated: float
    ramp: float

    def __post_init__(self) -> None:
        _check(self, "torque")


@dataclass(frozen=True, slots=True)
class ModuleSettings:
    """One module: its node ID (0 to 63), its limits, and its own ramps; nothing of it has a default that moves or stops anything.

    ``velocity_limit`` (turns/s) and ``current_limit`` (A, at most 50) are sent with Set_Limits. ``velocity_ramp`` (turns/s²) is
    what the module has as ``vel_ramp_rate``: a quick stop brakes with it, and no message sets it. ``acceleration`` (turns/s²) is
    that of the trapezoid which follows the targets of a stream, where ``filter_bandwidth`` (rad/s, the module's own
    ``input_filter_bandwidth``) is not told. ``period`` (s) is that of the scan, ``heartbeat`` (s) that of the module.
    ``break_timeout`` (s) is what was read back from it: 0 where it is off, or was not read. ``torque`` None: there are no torques.
    ``quick_stop_holds``: after a quick stop the module keeps its power and holds. ``remote``: the bus carries remote frames.
    ``relayed``: it is on a serial line, of which its registers are asked one after the other (``modbus.can_emulation``): it tells
    all by itself, slower and not as surely as on a bus, and is given its modes in idle alone.

    Raises:
        ArgumentError: the node ID is none, or a value is not above 0.
        LimitError: more current than the module bears.
    """

    node: int
    velocity_limit: float
    current_limit: float
    velocity_ramp: float
    acceleration: float
    period: float
    heartbeat: float = HEARTBEAT
    torque: TorqueSettings | None = None
    filter_bandwidth: float | None = None
    break_timeout: float = 0.0
    quick_stop_holds: bool = False
    remote: bool = True
    relayed: bool = False

    @property
    def fresh(self) -> float:
        """Seconds that what it has told counts, where it tells it all the time."""
        return _FRESH_BY_LINE if self.relayed else _FRESH

    def __post_init__(self) -> None:
        if isinstance(self.node, bool) or self.node not in NODES:
            raise ArgumentError(
                f"{self.node!r} is no node ID of CAN Simple", remedy="give a whole number from 0 to 63"
            )
        _check(self, "module")
        if self.current_limit > HIGHEST_CURRENT:
            raise LimitError(
                f"current_limit: {self.current_limit:g} A is more than the module bears",
                remedy=f"give at most {HIGHEST_CURRENT:g} A (manual v2.2, 3.1.3)",
            )


def _check(settings: TorqueSettings | ModuleSettings, what: str) -> None:
    for each in fields(settings):
        value = getattr(settings, each.name)
        if isinstance(value, float | int) and not isinstance(value, bool) and each.name != "node":
            lowest = 0.0 if each.name in _MAY_BE_ZERO else math.nextafter(0.0, 1.0)
            if not lowest <= value < math.inf:
                raise ArgumentError(f"{each.name} of the {what}: {value!r} is not above 0")
