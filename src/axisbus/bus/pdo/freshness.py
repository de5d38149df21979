"""How old each input of a drive may be before it counts as unknown, and which inputs must be polled by SDO for it."""

from __future__ import annotations

import math

from axisbus.bus.pdo.plan import PdoPlan, PlannedPdo
from axisbus.cia402.port import ValueTransport

SYNC_PERIODS = 5
SYNC_LEAST = 0.1  # seconds: a busy computer may skip some cycles without the axis being lost
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

    Those are the inputs without a PDO, and statusword and position where their PDO may stay silent: without an event timer silence
    says nothing, neither that the drive lives nor that the axis stands.
    """
    return {name: period for name, period in POLL_PERIODS.items() if _is_polled(plan, name)}


def _is_polled(plan: PdoPlan, name: str) -> bool:
    source = plan.inputs.get(name, ValueTransport.NONE)
    if source is ValueTransport.EVENT_PDO:
        return name in _WATCHED and _pdo_age(plan, name, 0.0) == math.inf
    return source is ValueTransport.SDO


def max_ages(plan: PdoPlan, scan_period: float) -> dict[str, float]:
    """Return the maximum age in seconds of each input that the axis has; infinite where silence says nothing.

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
    """The age by the PDO that comes most often among those that carry the value."""
    carriers = [pdo for pdo in plan.active if not pdo.receive and name in pdo.values]
    return min((pdo_age(pdo, scan_period) for pdo in carriers), default=math.inf)


def syncs_of(pdo: PlannedPdo) -> int:
    """Return with every how many SYNCs a TPDO comes; 0 where it does not come by SYNC, or not always."""
    cyclic = pdo.target.synchronous and pdo.target.transmission_type > 0 and not pdo.request
    return pdo.target.transmission_type if cyclic else 0


def pdo_age(pdo: PlannedPdo, scan_period: float) -> float:
    """Return how long a TPDO may stay away (seconds) before it counts as missing; infinite where its silence says nothing."""
    target = pdo.target
    if pdo.request:
        return POLLS * pdo.request + POLL_MARGIN
    if target.synchronous and target.transmission_type > 0:
        return max(SYNC_PERIODS * scan_period * target.transmission_type, SYNC_LEAST)
    if not target.event_timer or target.transmission_type == 0:
        return math.inf
    return EVENT_TIMES * target.event_timer / 1000 + EVENT_MARGIN
