"""Maximum age of each input of a drive before it is unknown, and the inputs that must be polled by SDO for that."""

from __future__ import annotations

import math

from axisbus.bus.pdo.plan import PdoPlan, PlannedPdo
from axisbus.cia402.port import ValueTransport

SYNC_PERIODS = 5
SYNC_LEAST = 0.1  # seconds: a busy computer may skip some cycles without losing the axis
EVENT_TIMES = 3
EVENT_MARGIN = 0.05
POLLS = 3
POLL_MARGIN = 0.05

# Seconds between two SDO polls of a value.
POLL_PERIODS = {
    "statusword": 0.1,
    "mode": 0.25,
    "position": 0.1,
    "velocity": 0.25,
    "torque": 0.25,
    "demand": 0.25,
}

# Inputs that are polled although a PDO carries them, if that PDO is silent while nothing changes.
_WATCHED = frozenset({"statusword", "position"})


def polls(plan: PdoPlan) -> dict[str, float]:
    """Return the period in seconds of each input that is polled by SDO.

    These are the inputs without a PDO, and statusword and position if their PDO may stay silent. Without an event timer, silence
    proves neither that the drive is alive nor that the axis is at standstill.
    """
    return {name: period for name, period in POLL_PERIODS.items() if _is_polled(plan, name)}


def _is_polled(plan: PdoPlan, name: str) -> bool:
    source = plan.inputs.get(name, ValueTransport.NONE)
    if source is ValueTransport.EVENT_PDO:
        return name in _WATCHED and _pdo_age(plan, name, 0.0) == math.inf
    return source is ValueTransport.SDO


def max_ages(plan: PdoPlan, scan_period: float) -> dict[str, float]:
    """Return the maximum age in seconds of each input of the axis; infinite if silence has no meaning.

    ``scan_period`` (seconds) is the distance of two SYNCs.
    """
    polled = polls(plan)
    ages = {}
    for name, source in plan.inputs.items():
        if name in polled:
            ages[name] = POLLS * polled[name] + POLL_MARGIN
        elif source is not ValueTransport.NONE:
            ages[name] = _pdo_age(plan, name, scan_period)
    return ages


def _pdo_age(plan: PdoPlan, name: str, scan_period: float) -> float:
    """Return the age for the most frequent PDO among those that carry the value."""
    carriers = [pdo for pdo in plan.active if not pdo.receive and name in pdo.values]
    return min((pdo_age(pdo, scan_period) for pdo in carriers), default=math.inf)


def syncs_of(pdo: PlannedPdo) -> int:
    """Return the number of SYNCs per frame of a TPDO; 0 if it is not sent by SYNC, or not always."""
    cyclic = pdo.target.synchronous and pdo.target.transmission_type > 0 and not pdo.request
    return pdo.target.transmission_type if cyclic else 0


def pdo_age(pdo: PlannedPdo, scan_period: float) -> float:
    """Return the seconds without a TPDO after which it counts as missing; infinite if its silence has no meaning."""
    target = pdo.target
    if pdo.request:
        return POLLS * pdo.request + POLL_MARGIN
    if target.synchronous and target.transmission_type > 0:
        return max(SYNC_PERIODS * scan_period * target.transmission_type, SYNC_LEAST)
    if not target.event_timer or target.transmission_type == 0:
        return math.inf
    return EVENT_TIMES * target.event_timer / 1000 + EVENT_MARGIN
