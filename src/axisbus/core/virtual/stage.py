"""The power stage of an axis without one: the state machine of CiA 402, without delays and without faults."""

from __future__ import annotations

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import statusword as sw
from axisbus.cia402.state import STATUSWORD_PATTERNS, PowerState

_S = PowerState
# Voltage is always present, and only the core controls the axis.
_ALWAYS = sw.VOLTAGE_ENABLED | sw.REMOTE
STATUSWORDS = {state: value | _ALWAYS for _, value, state in STATUSWORD_PATTERNS}
# Results of a quick stop (CiA 402-2 transitions 7, 10, 11); in other states it changes nothing.
_QUICK_STOP = {
    _S.READY_TO_SWITCH_ON: _S.SWITCH_ON_DISABLED,
    _S.SWITCHED_ON: _S.SWITCH_ON_DISABLED,
    _S.OPERATION_ENABLED: _S.QUICK_STOP_ACTIVE,
}
# Results of bits 0 and 3, one transition at a time (2, 3, 4, 5, 6, 8, 16).
_SHUTDOWN, _SWITCH_ON, _ENABLE = 0, cw.SWITCH_ON, cw.SWITCH_ON | cw.ENABLE_OPERATION
_NEXT = {
    (_S.SWITCH_ON_DISABLED, _SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.READY_TO_SWITCH_ON, _SWITCH_ON): _S.SWITCHED_ON,
    (_S.READY_TO_SWITCH_ON, _ENABLE): _S.SWITCHED_ON,
    (_S.SWITCHED_ON, _SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.SWITCHED_ON, _ENABLE): _S.OPERATION_ENABLED,
    (_S.OPERATION_ENABLED, _SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.OPERATION_ENABLED, _SWITCH_ON): _S.SWITCHED_ON,
    (_S.QUICK_STOP_ACTIVE, _ENABLE): _S.OPERATION_ENABLED,
}


def after(state: PowerState, controlword: int) -> PowerState:
    """Return the state after a controlword in ``state``."""
    if not controlword & cw.ENABLE_VOLTAGE:
        return _S.SWITCH_ON_DISABLED
    if not controlword & cw.QUICK_STOP:
        return _QUICK_STOP.get(state, state)
    wanted = controlword & _ENABLE if controlword & cw.SWITCH_ON else _SHUTDOWN
    return _NEXT.get((state, wanted), state)
