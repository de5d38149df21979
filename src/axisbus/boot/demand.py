"""Describe how the master uses 6062h (position demand value), and what it uses if 6062h is not used."""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402.port import ValueTransport
from axisbus.motion.parameters import AxisParameters, DemandUse

_ELSE = "in csp the target from the master is used, in other modes none"


def demand_text(parameters: AxisParameters, source: ValueTransport) -> str:
    """Return the report's line for one axis; ``source``: how 6062h is transferred."""
    parts = [_use(parameters, source)]
    if not parameters.compares_demand:
        parts.append('not compared in motion (following_error = "off")')
    own = parameters.drive_following_error
    if own is not None:
        window = abs(parameters.units.position.to_units(own))
        parts.append(
            f"the drive itself watches its following error: {window:g} {parameters.units.position.unit} (6065h) for "
            f"{parameters.drive_following_time:g} s (6066h)"
        )
    return "; ".join(parts)


def _use(parameters: AxisParameters, source: ValueTransport) -> str:
    if source is ValueTransport.NONE or not parameters.has(objects.POSITION_DEMAND):
        return f"6062h is not transmitted: {_ELSE}"
    if parameters.demand is DemandUse.IGNORE:
        return f'6062h is not used (demand = "ignore"): {_ELSE}'
    if parameters.demand is DemandUse.USE:
        return '6062h is used from the beginning (demand = "use")'
    return f"6062h is used after it was seen to follow the set-points; until then {_ELSE}"
