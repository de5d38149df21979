"""The zero of an axis over Modbus, where no register sets it: by parameters, in idle, saved, and seen to hold after the restart."""

from __future__ import annotations

from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
from axisbus.drives.gim6010.modbus.words import turns
from axisbus.errors import NodeError, StateError

_OFFSET, _USED = "axis0.encoder.config.index_offset", "axis0.encoder.config.use_index_offset"
_ESTIMATE, _COUNT, _CPR = (
    "axis0.encoder.pos_estimate",
    "axis0.encoder.count_in_cpr",
    "axis0.encoder.config.cpr",
)
_NEAR = 0.02  # turns of the rotor


def set_zero(parameters: ModbusParameters) -> float:
    """Let the position of now be 0, and return the offset that was saved, in turns of the rotor; blocks for the restart.

    After a restart a module knows its place within one turn of the rotor only, so it is this turn's zero that is set.

    Raises:
        StateError: the module is not idle, or its position does not agree with its encoder's count, as where it is dead in idle.
        NodeError: no answer, or the position is not 0 after the restart.
    """
    parameters.module.require_idle("its zero is set")
    before = float(parameters.read(_OFFSET)) if parameters.read(_USED) else 0.0
    estimate = float(parameters.read(_ESTIMATE))
    _require_alive(parameters, before + estimate)
    offset = (before + estimate) % 1.0
    parameters.write(_OFFSET, offset, by_name=True)
    parameters.write(_USED, True, by_name=True)
    parameters.save()
    _require_zero(parameters)
    return offset


def _require_alive(parameters: ModbusParameters, place: float) -> None:
    """Check a position against the encoder's count, which is alive in idle."""
    cpr = int(parameters.read(_CPR))
    count = int(parameters.read(_COUNT))
    if cpr > 0 and _apart(place, count / cpr) <= _NEAR:  # a NaN is not near
        return
    raise StateError(
        f"module {parameters.module.device}: its position and its encoder's count are not of the same place; nothing was written",
        observed=f"position {turns(place)} from the encoder's zero, count {count} of {cpr}",
        remedy="the position may be dead in idle: set the zero over USB (odrv0.axis0.encoder.config.index_offset)",
    )


def _require_zero(parameters: ModbusParameters) -> None:
    estimate = float(parameters.read(_ESTIMATE))
    if not _apart(estimate, 0.0) <= _NEAR:
        raise NodeError(
            f"module {parameters.module.device} is at {turns(estimate)} after its zero was set and saved",
            node=parameters.module.device,
            remedy="somebody turned it, or this firmware counts its offset otherwise: look at index_offset before it is moved",
        )


def _apart(one: float, other: float) -> float:
    """Return how far two places are apart within a turn."""
    away = (one - other) % 1.0
    return min(away, 1.0 - away)
