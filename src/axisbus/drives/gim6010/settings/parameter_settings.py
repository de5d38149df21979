"""Settings of a module: the parameters of each, which are written and read back one by one, or listed as steps over USB.

Each function returns the parameters of one setting with its precondition and remarks; ``PATHS`` are those that show it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from axisbus.drives.gim6010.can_simple.endpoint_messages import value_bytes
from axisbus.drives.gim6010.can_simple.messages import HIGHEST_CURRENT
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.errors import ArgumentError, LimitError, StateError

Tell = Callable[[str], None]

VELOCITY, CURRENT = "axis0.controller.config.vel_limit", "axis0.motor.config.current_lim"
TERMINATED, _TERMINATION_PIN = "can.config.enable_r120", "can.config.r120_gpio_num"
BIT_RATE = "can.config.baud_rate"
_ENDSTOPS = {"min": 1, "max": 2}  # pins by the manual
_RESISTOR, _OHMS = "config.enable_brake_resistor", "config.brake_resistance"
_REGENERATION = "config.max_regen_current"
_RAMP, _RAMP_START, _RAMP_END = (
    "config.enable_dc_bus_overvoltage_ramp",
    "config.dc_bus_overvoltage_ramp_start",
    "config.dc_bus_overvoltage_ramp_end",
)
_TRIP = "config.dc_bus_overvoltage_trip_level"
PATHS: Mapping[str, tuple[str, ...]] = {
    "limits": (VELOCITY, CURRENT),
    "termination": (TERMINATED, _TERMINATION_PIN),
    "endstops": tuple(
        f"axis0.{end}_endstop.config.{what}" for end in _ENDSTOPS for what in ("gpio_num", "enabled")
    ),
    "brake-resistor": (_RESISTOR, _OHMS, _REGENERATION, _RAMP, _RAMP_START, _RAMP_END),
}


def _nothing(module: ModuleParameters) -> None:
    """Require nothing of a module, for most settings."""


def usb_steps(*lines: str, after: str = "") -> tuple[str, ...]:
    """Return lines of odrivetool as steps over USB, with connecting and saving; ``after`` describes the restart that follows."""
    return (
        "connect it by USB and open odrivetool; it must be idle",
        *lines,
        f"odrv0.save_configuration(), after which it restarts{after}",
    )


@dataclass(frozen=True, slots=True)
class ParameterBatch:
    """Parameters by path with their values, in the order of writing; ``notes`` are remarks for the user.

    ``require`` checks the module before anything is written, and raises StateError if the setting is not possible.
    """

    values: tuple[tuple[str, Value], ...]
    notes: tuple[str, ...] = ()
    require: Callable[[ModuleParameters], None] = field(default=_nothing, compare=False)

    @property
    def over_usb(self) -> tuple[str, ...]:
        """The same as steps over USB, saved at the end."""
        return usb_steps(*(f"odrv0.{path} = {value!r}" for path, value in self.values))


def check(module: ModuleParameters, wanted: ParameterBatch) -> None:
    """Check that all parameters can be written, before writing the first.

    Raises:
        ArgumentError, LimitError: a parameter does not exist, is not writable, or a value is not of its type.
        StateError: the module does not fulfil the precondition. BusError: as ``ModuleParameters.read``.
    """
    wanted.require(module)
    for path, value in wanted.values:
        endpoint = module.endpoint(path)
        rules.require_setting(endpoint, by_name=True)
        value_bytes(endpoint, value, module.widest)


def apply(module: ModuleParameters, wanted: ParameterBatch, tell: Tell) -> None:
    """Write all parameters into RAM, and read each back; ``tell`` is called for each written one. Blocks.

    Raises:
        ArgumentError, LimitError: as ``check``; nothing was written then.
        StateError: as ``check``, or the module is not idle.
        BusError: no answer, the module stores another value, or it restarted or was disconnected.
    """
    check(module, wanted)
    for path, value in wanted.values:
        before = module.read(path)
        held = module.write(path, value, by_name=True)
        tell(f"{path} = {values.show(held)} (was {values.show(before)})")


def shown(module: ModuleParameters, paths: tuple[str, ...]) -> Iterator[str]:
    """Yield the present values of parameters in RAM; blocks, raises as ``ModuleParameters.read``."""
    for path in paths:
        yield f"{path} = {values.show(module.read(path))}"


# -- The module's own limits of velocity and motor current, which apply to every kind of command (manual v2.2, 3.1.3) --


_TORQUE = (
    "the limit of velocity does not hold under torque control unless enable_torque_mode_vel_limit is set"
)


def limits(velocity: float | None, current: float | None) -> ParameterBatch:
    """Return the parameters that set the limits: ``velocity`` in rotor turns/s, ``current`` in A, at most 50; None: unchanged.

    Raises:
        ArgumentError: neither is given, or one is not above 0. LimitError: the current is above the module's maximum.
    """
    if velocity is None and current is None:
        raise ArgumentError(
            "no limit is given", remedy="give --velocity in turns/s of the rotor, --current in A, or both"
        )
    given = (("velocity", VELOCITY, velocity), ("current", CURRENT, current))
    for name, _, value in given:
        if value is not None and not 0.0 < value < math.inf:
            raise ArgumentError(
                f"limit of {name}: {value!r} is not above 0", remedy="give the intended limit"
            )
    if current is not None and current > HIGHEST_CURRENT:
        raise LimitError(
            f"limit of current: {current:g} A is more than the module permits",
            remedy=f"give at most {HIGHEST_CURRENT:g} A (manual v2.2, 3.1.3)",
        )
    return ParameterBatch(tuple((path, value) for _, path, value in given if value is not None), (_TORQUE,))


# -- Its switchable terminating resistor of 120 Ω (manual v2.2, 3.1.8) -------------------------------------------------


_PIN = 5  # by the manual
_ENDS = "a bus is terminated at its two ends and nowhere else: 60 Ω between CAN high and low, measured with everything switched off"
_FACTORY = "every module is delivered with it switched on: more than two on a bus are too many"


def termination(*, on: bool) -> ParameterBatch:
    """Return the parameters that switch the resistor on or off, if it is switched by the pin given in the manual."""
    return ParameterBatch(((TERMINATED, on),), (_ENDS, _FACTORY), _require_switch)


def _require_switch(module: ModuleParameters) -> None:
    pin = module.read(_TERMINATION_PIN)
    if pin != _PIN:
        raise StateError(
            f"{_TERMINATION_PIN} is {pin}, and the manual has {_PIN}: whether {TERMINATED} switches the resistor is not known",
            remedy=f"if nothing else is known of this module: axisbus gim6010 params set {_TERMINATION_PIN}={_PIN}",
        )


# -- Its two limit switch inputs: LW1 at the lowest position, LW2 at the highest (manual v2.2, 2.4.8 and 3.1.8) --------


_WITHOUT = (3, 7)  # latest hardware without them, by the manual
_HARDWARE = ("hw_version_major", "hw_version_minor")
_SWITCHES = (
    "a switch that is reached is an error of the axis (MIN_ENDSTOP_PRESSED, MAX_ENDSTOP_PRESSED): the program that "
    "commands it must react",
    "the manual does not say whether it stops the motor: try it slowly before you rely on it",
    "pulse and direction inputs use the same place: only one of both can be set",
)


def endstops(lowest: bool | None, highest: bool | None) -> ParameterBatch:
    """Return the parameters that switch each input on or off, if the hardware has them; None: unchanged.

    Raises:
        ArgumentError: neither is given.
    """
    if lowest is None and highest is None:
        raise ArgumentError("no switch is named", remedy="give --min on or off, --max on or off, or both")
    found: list[tuple[str, Value]] = []
    for end, on in (("min", lowest), ("max", highest)):
        config = f"axis0.{end}_endstop.config"
        found += [(f"{config}.gpio_num", _ENDSTOPS[end])] if on else []
        found += [] if on is None else [(f"{config}.enabled", on)]
    return ParameterBatch(tuple(found), _SWITCHES if lowest or highest else (), _require_inputs)


def _require_inputs(module: ModuleParameters) -> None:
    """Check the hardware version, if the endpoint list contains it."""
    if not all(path in module.listed.endpoints for path in _HARDWARE):
        return
    major, minor = (int(module.read(path)) for path in _HARDWARE)
    if (major, minor) <= _WITHOUT:
        raise StateError(
            f"hardware {major}.{minor} has no limit switches (manual v2.2, 3.1.8)",
            remedy="home the axis against a stop, or by a switch that the master reads",
        )


# -- The brake resistor, which dissipates the energy of a braking motor (manual v2.2, 2.4.7 and 3.1.8) -----------------


_OFF = "the energy of a braking motor now flows back into the supply: a supply that cannot absorb it switches off or trips"


def brake_resistor(ohms: float, current: float | None, ramp: tuple[float, float] | None) -> ParameterBatch:
    """Return the parameters that switch a resistor on, if the ramp ends below the module's overvoltage trip level.

    Args:
        ohms: its resistance, in Ω.
        current: maximum current into the supply, in A (0 or more); the excess goes into the resistor. None: unchanged.
        ramp: supply voltages in V at which the resistor current begins, and at which it gets all current. None: unchanged.

    Raises:
        ArgumentError: a value is invalid, or neither current nor ramp is given.
    """
    if current is None and ramp is None:
        raise ArgumentError(
            "no condition for the use of the resistor is given",
            remedy="give --max-regen in A, --ramp in V, or both",
        )
    _require("resistance", ohms, above=True)
    if current is not None:
        _require("current into the supply", current, above=False)
    found: list[tuple[str, Value]] = [(_OHMS, ohms)]
    found += [] if current is None else [(_REGENERATION, current)]
    if ramp is None:
        return ParameterBatch((*found, (_RESISTOR, True)))
    start, end = ramp
    _require("voltage at which the ramp begins", start, above=True)
    if not start < end < math.inf:
        raise ArgumentError(
            f"the ramp ends at {end!r} V, and begins at {start!r} V", remedy="give --ramp BEGIN END in V"
        )

    def require_below_trip(module: ModuleParameters) -> None:
        trip = float(module.read(_TRIP))
        if not end < trip:
            raise StateError(
                f"the ramp ends at {end:g} V, and the module switches its motor off at {trip:g} V ({_TRIP})",
                remedy="end it below that voltage, and begin it above the voltage of the supply",
            )

    found += [(_RAMP_START, start), (_RAMP_END, end), (_RAMP, True), (_RESISTOR, True)]
    bears = f"at {end:g} V it takes {end / ohms:.3g} A and {end * end / ohms:.3g} W: make sure that it can dissipate this"
    return ParameterBatch(tuple(found), (bears,), require_below_trip)


def no_brake_resistor() -> ParameterBatch:
    """Return the parameters that switch it off, and with it the ramp of its current."""
    return ParameterBatch(((_RESISTOR, False), (_RAMP, False)), (_OFF,))


def _require(what: str, value: float, *, above: bool) -> None:
    if not math.isfinite(value) or value < 0.0 or (above and value == 0.0):
        raise ArgumentError(
            f"{what}: {value!r} is not {'above 0' if above else '0 or more'}",
            remedy="give the intended value",
        )


# -- Its bit rate, which takes effect with the next restart, so that it is saved at once -------------------------------


# Bit rates of CiA 301, from 125 kbit/s up to the module's 1 Mbit/s (manual v2.2, 4.1); the manual names the last two.
RATES = (125_000, 250_000, 500_000, 1_000_000)
_UNNAMED = "the manual names only 500000 and 1000000 bit/s: if the module rejects this rate, it can be reached over USB only"


def bit_rate(rate: int) -> ParameterBatch:
    """Return the parameters that set a bit rate (bit/s). Raises ArgumentError: the bit rate is not in ``RATES``."""
    if rate not in RATES:
        raise ArgumentError(f"{rate} bit/s cannot be set", remedy=f"give one of {', '.join(map(str, RATES))}")
    return ParameterBatch(((BIT_RATE, rate),), () if rate in RATES[2:] else (_UNNAMED,))


# -- The protocol on CAN, which takes effect with the next restart too -------------------------------------------------


PROTOCOL = "can.config.protocol"
CAN_SIMPLE, CANOPEN = 1, 2
SEARCH = "switch it off and on, and search for it: axisbus gim6010 find"  # the last step over USB


def protocol(value: int) -> ParameterBatch:
    """Return the parameters that set the protocol, ``CAN_SIMPLE`` or ``CANOPEN``."""
    return ParameterBatch(((PROTOCOL, value),))
