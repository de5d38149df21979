"""The brake resistor, which dissipates the energy of a braking motor (manual v2.2, 2.4.7 and 3.1.8): its settings and its load."""

from __future__ import annotations

import math

from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.drives.gim6010.settings.parameter_batch import ParameterBatch
from axisbus.errors import ArgumentError, StateError

_CONFIG = "config."
ENABLED, OHMS = f"{_CONFIG}enable_brake_resistor", f"{_CONFIG}brake_resistance"
CURRENT = f"{_CONFIG}max_regen_current"
RAMP, START, END = (
    f"{_CONFIG}enable_dc_bus_overvoltage_ramp",
    f"{_CONFIG}dc_bus_overvoltage_ramp_start",
    f"{_CONFIG}dc_bus_overvoltage_ramp_end",
)
PATHS = (ENABLED, OHMS, CURRENT, RAMP, START, END)
TRIP = f"{_CONFIG}dc_bus_overvoltage_trip_level"
_OFF = "the energy of a braking motor now flows back into the supply: a supply that cannot absorb it switches off or trips"


def wanted(ohms: float, current: float | None, ramp: tuple[float, float] | None) -> ParameterBatch:
    """Return the parameters that switch a resistor on.

    Args:
        ohms: its resistance, in Ω.
        current: maximum current into the supply, in A (0 or more); the excess goes into the resistor. None: unchanged.
        ramp: supply voltages in V at which the resistor current begins, and at which it gets all current. None: unchanged.

    Raises:
        ArgumentError: a value is invalid, or neither current nor ramp is given.
    """
    if current is None and ramp is None:
        raise ArgumentError(
            "it is not specified when the resistor is used",
            remedy="give --max-regen in A, --ramp in V, or both",
        )
    _require("resistance", ohms, above=True)
    if current is not None:
        _require("current into the supply", current, above=False)
    values: list[tuple[str, Value]] = [(OHMS, ohms)]
    values += [] if current is None else [(CURRENT, current)]
    if ramp is not None:
        _require_ramp(*ramp)
        values += [(START, ramp[0]), (END, ramp[1]), (RAMP, True)]
    notes = () if ramp is None else (bears(ohms, ramp[1]),)
    return ParameterBatch((*values, (ENABLED, True)), notes)


def off() -> ParameterBatch:
    """Return the parameters that switch it off, and with it the ramp of its current."""
    return ParameterBatch(((ENABLED, False), (RAMP, False)), (_OFF,))


def bears(ohms: float, volts: float) -> str:
    """Return a text with current and power of a resistor at the supply's voltage."""
    return f"at {volts:g} V it takes {volts / ohms:.3g} A and {volts * volts / ohms:.3g} W: make sure that it can dissipate this"


def require_below_trip(module: ModuleParameters, ramp: tuple[float, float] | None) -> None:
    """Check that the ramp ends below the module's overvoltage trip level; blocks.

    Raises:
        StateError: it does not. BusError: as ``ModuleParameters.read``.
    """
    if ramp is None:
        return
    trip = float(module.read(TRIP))
    if not ramp[1] < trip:
        raise StateError(
            f"the ramp ends at {ramp[1]:g} V, and the module switches its motor off at {trip:g} V ({TRIP})",
            remedy="end it below that voltage, and begin it above the voltage of the supply",
        )


def _require(what: str, value: float, *, above: bool) -> None:
    if not math.isfinite(value) or value < 0.0 or (above and value == 0.0):
        raise ArgumentError(
            f"{what}: {value!r} is not {'above 0' if above else '0 or more'}",
            remedy="give the intended value",
        )


def _require_ramp(start: float, end: float) -> None:
    _require("voltage at which the ramp begins", start, above=True)
    if not start < end < math.inf:
        raise ArgumentError(
            f"the ramp ends at {end!r} V, and begins at {start!r} V", remedy="give --ramp BEGIN END in V"
        )
