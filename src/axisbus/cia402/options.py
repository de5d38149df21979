"""Option codes for stopping a drive (CiA 402-2 8.4.3-8.4.8; 1029h of CiA 301): words, values and plain meanings."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.cia301 import objects as cia301
from axisbus.cia402 import objects


@dataclass(frozen=True, slots=True)
class OptionCode:
    """One option object: its location, the word in cell.toml for each value, and the plain meaning of each value."""

    key: str
    index: int
    subindex: int
    title: str
    words: dict[str, int]
    meanings: dict[int, str]

    def meaning(self, value: int) -> str:
        """Return the effect of ``value`` in plain words; an unknown value is manufacturer-specific."""
        return self.meanings.get(value, "manufacturer-specific (see the drive's manual)")


_COAST = "the motor coasts: power off at once, nothing brakes it"
_SLOW = "brakes on the slow-down ramp"
_QUICK = "brakes on the quick-stop ramp"
_CURRENT = "brakes at the current limit"
_VOLTAGE = "brakes at the voltage limit"
_OFF = ", then power off"
_HELD = ", then stays energised and holds"

QUICK_STOP = OptionCode(
    "quick_stop",
    objects.QUICK_STOP_OPTION,
    0,
    "quick stop",
    {
        "coast": 0,
        "slow-ramp": 1,
        "ramp": 2,
        "current-limit": 3,
        "voltage-limit": 4,
        "slow-ramp-hold": 5,
        "ramp-hold": 6,
        "current-limit-hold": 7,
        "voltage-limit-hold": 8,
    },
    {
        0: _COAST,
        1: _SLOW + _OFF,
        2: _QUICK + _OFF,
        3: _CURRENT + _OFF,
        4: _VOLTAGE + _OFF,
        5: _SLOW + _HELD,
        6: _QUICK + _HELD,
        7: _CURRENT + _HELD,
        8: _VOLTAGE + _HELD,
    },
)
SHUTDOWN = OptionCode(
    "shutdown",
    objects.SHUTDOWN_OPTION,
    0,
    "shutdown",
    {"coast": 0, "slow-ramp": 1},
    {0: _COAST, 1: _SLOW + _OFF},
)
DISABLE = OptionCode(
    "disable",
    objects.DISABLE_OPERATION_OPTION,
    0,
    "disable operation",
    {"coast": 0, "slow-ramp": 1},
    {0: _COAST, 1: _SLOW + _OFF},
)
HALT = OptionCode(
    "halt",
    objects.HALT_OPTION,
    0,
    "halt",
    {"slow-ramp": 1, "ramp": 2, "current-limit": 3, "voltage-limit": 4},
    {
        0: "reserved; many drives coast",
        1: _SLOW + _HELD,
        2: _QUICK + _HELD,
        3: _CURRENT + _HELD,
        4: _VOLTAGE + _HELD,
    },
)
FAULT = OptionCode(
    "fault",
    objects.FAULT_REACTION_OPTION,
    0,
    "fault",
    {"coast": 0, "slow-ramp": 1, "ramp": 2, "current-limit": 3, "voltage-limit": 4},
    {0: _COAST, 1: _SLOW + _OFF, 2: _QUICK + _OFF, 3: _CURRENT + _OFF, 4: _VOLTAGE + _OFF},
)
CONNECTION_LOSS = OptionCode(
    "connection_loss",
    objects.ABORT_CONNECTION_OPTION,
    0,
    "connection loss",
    {"nothing": 0, "fault": 1, "disable-voltage": 2, "quick-stop": 3},
    {
        0: "no action: the drive continues with the last command",
        1: "changes to fault, with its fault reaction",
        2: _COAST,
        3: "executes its quick stop",
    },
)
COMMUNICATION_ERROR = OptionCode(
    "communication_error",
    cia301.ERROR_BEHAVIOR,
    1,
    "NMT state after a communication error",
    {"pre-operational": 0, "no-change": 1, "stopped": 2},
    {0: "goes to pre-operational", 1: "does not change its NMT state", 2: "goes to stopped"},
)

ALL = (QUICK_STOP, SHUTDOWN, DISABLE, HALT, FAULT, CONNECTION_LOSS, COMMUNICATION_ERROR)
BY_KEY = {option.key: option for option in ALL}
# After a quick stop with these values the drive stays in quick stop active and holds; with lower ones it powers off.
HOLDING_QUICK_STOPS = range(5, 9)


class Ramp(Enum):
    """Deceleration of the motor on a halt or a quick stop."""

    UNKNOWN = "unknown"
    COAST = "nothing"
    SLOW = "profile deceleration (6084h)"
    QUICK = "quick-stop deceleration (6085h)"
    LIMIT = "the current or voltage limit"


_R = Ramp
# By the values of 605Dh and 605Ah (CiA 402-2 8.4.6, 8.4.3); other values are manufacturer-specific.
HALT_RAMPS = {0: _R.COAST, 1: _R.SLOW, 2: _R.QUICK, 3: _R.LIMIT, 4: _R.LIMIT}
QUICK_STOP_RAMPS = HALT_RAMPS | {5: _R.SLOW, 6: _R.QUICK, 7: _R.LIMIT, 8: _R.LIMIT}
