"""Settings of a module that the port needs and that no CAN Simple message reports; all at the rotor side of the gear."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from axisbus.cia402.modes import ModeOfOperation
from axisbus.drives.gim6010.can_simple.identifier import require_node
from axisbus.drives.gim6010.can_simple.messages import HIGHEST_CURRENT
from axisbus.errors import ArgumentError, LimitError

# s: the factory setting (manual v2.2, 4.1.5), and the period expected of a relay
HEARTBEAT, HEARTBEAT_BY_LINE = 0.1, 0.35
_FRESH, _FRESH_BY_LINE = 0.1, 1.0  # s; on the serial line a lost answer costs half a second
FEEDS = 4  # set-points that a module gets, at the least, within an armed time-out


@dataclass(frozen=True, slots=True)
class TorqueSettings:
    """Conversion of an axis's torque to the rotor's torque.

    ``constant`` in N·m/A is the module's ``torque_constant``; it has no default, because the manual contradicts itself. ``rated``
    in N·m is the rotor torque that corresponds to 1000 ‰: the rated output torque divided by the gear ratio. ``ramp`` in N·m/s is
    the module's ``torque_ramp_rate``. Raises ArgumentError: a value is not above 0.
    """

    constant: float
    rated: float
    ramp: float

    def __post_init__(self) -> None:
        _check(self, "torque")


@dataclass(frozen=True, slots=True)
class ModuleSettings:
    """One module: its node ID (0 to 63), its limits and its own ramps; no setting that moves or stops the motor has a default.

    ``velocity_limit`` (turns/s) and ``current_limit`` (A, at most 50) are sent with Set_Limits. ``velocity_ramp`` (turns/s²) is the
    module's ``vel_ramp_rate``: a quick stop brakes with it, and no message sets it. ``acceleration`` (turns/s²) limits the
    trapezoid that follows streamed targets if ``filter_bandwidth`` (rad/s, the module's ``input_filter_bandwidth``) is not given.
    ``period`` (s) is the scan period, ``heartbeat`` (s) the period of the module's heartbeat. If ``torque`` is None, torques are
    not available. If ``quick_stop_holds``, the module keeps its power after a quick stop and holds the position. ``remote``: the
    bus carries remote frames. ``relayed``: the module is on a serial line and a relay reads its registers one after the other
    (``modbus.can_emulation``). The relay sends all values unasked, more slowly and less reliably than a bus, and the modes are set
    only in idle. Therefore a relayed module has one mode beside homing, ``line_mode``: profile position, velocity or torque.

    Raises:
        ArgumentError: the node ID is invalid, or a value is not above 0.
        LimitError: the current is above the module's maximum.
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
    quick_stop_holds: bool = False
    remote: bool = True
    relayed: bool = False
    line_mode: ModeOfOperation = ModeOfOperation.PROFILE_POSITION

    @property
    def fresh(self) -> float:
        """Age in seconds up to which a cyclically sent value is valid."""
        return _FRESH_BY_LINE if self.relayed else _FRESH

    def __post_init__(self) -> None:
        require_node(self.node)
        _check(self, "module")
        if self.current_limit > HIGHEST_CURRENT:
            raise LimitError(
                f"current_limit: {self.current_limit:g} A is more than the module permits",
                remedy=f"give at most {HIGHEST_CURRENT:g} A (manual v2.2, 3.1.3)",
            )


def _check(settings: TorqueSettings | ModuleSettings, what: str) -> None:
    for each in fields(settings):
        value = getattr(settings, each.name)
        is_number = isinstance(value, float | int) and not isinstance(value, bool | ModeOfOperation)
        if is_number and each.name != "node" and not 0.0 < value < math.inf:
            raise ArgumentError(f"{each.name} of the {what}: {value!r} is not above 0")
