"""A module that follows the PWM pulses of a remote control (manual v2.2, 4.4): the mapping of the pulse width, and the setup steps.

The parameter to follow is set by a reference that only USB can transfer, and the PWM input replaces the CAN interface. Therefore
the steps are for USB.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.cia301.tables import rows
from axisbus.drives.gim6010.make import GEAR_RATIO
from axisbus.drives.gim6010.settings.parameter_settings import usb_steps
from axisbus.errors import ArgumentError, LimitError
from axisbus.wording import counted

SHORTEST, LONGEST = 1.0, 2.0  # ms; 50 times a second
_USB_ONLY = ", and is reached over USB only"
_SHOWN = 5  # widths in the table
_INTERFACE = 3  # config.comm_intf_mux
_PIN = 1


class Follows(NamedTuple):
    """A row of the table: a value that can follow the pulses, by the manual's mode for it."""

    name: str
    control_mode: str
    input_mode: str
    what: str
    unit: str
    out: str
    gear: str
    note: str

    @property
    def of_output(self) -> float:
        """Factor from rotor to output."""
        return float(GEAR_RATIO) ** int(self.gear)


FOLLOWS = {row["name"]: Follows(**row) for row in rows(__package__, "pulse_inputs.tsv")}
_LOST = (
    "the manual does not describe a failure of the pulses: have an emergency stop, and try it without a load"
)
_WIRE = "the signal goes to the contact of CANH, 5 V at most, with its ground on the module's; hardware 3.10 or later"


@dataclass(frozen=True, slots=True)
class PulseMapping:
    """Maps a pulse of 1 ms to ``low`` and of 2 ms to ``high`` of ``follows``, in units of the rotor."""

    follows: Follows
    low: float
    high: float

    def __post_init__(self) -> None:
        for value in (self.low, self.high):
            if not math.isfinite(value):
                raise ArgumentError(f"{value!r} is not a value to be mapped to", remedy="give a number")
        if self.low == self.high:
            raise ArgumentError(
                f"both ends of the mapping are {self.low:g}", remedy="give two values that differ"
            )

    def at(self, width: float) -> float:
        """Return the value for a pulse of ``width`` in ms.

        Raises:
            LimitError: the width is not 1 to 2 ms, the range of the manual's mapping.
        """
        if not SHORTEST <= width <= LONGEST:
            raise LimitError(
                f"a pulse of {width:g} ms is not within {SHORTEST:g} to {LONGEST:g} ms",
                remedy="give one in this range",
            )
        share = (width - SHORTEST) / (LONGEST - SHORTEST)
        return self.low + share * (self.high - self.low)

    @property
    def zero(self) -> float | None:
        """Pulse width in ms at which the value is 0; None if there is none."""
        width = SHORTEST - self.low / (self.high - self.low) * (LONGEST - SHORTEST)
        return width if SHORTEST <= width <= LONGEST else None

    @property
    def table(self) -> Iterator[str]:
        """The mapping as lines, at widths distributed over its range."""
        kind = self.follows
        for number in range(_SHOWN):
            width = SHORTEST + number * (LONGEST - SHORTEST) / (_SHOWN - 1)
            value = self.at(width)
            yield f"{width:.2f} ms: {value:g} {kind.unit} of the rotor, {value * kind.of_output:g} {kind.out}"

    @property
    def notes(self) -> tuple[str, ...]:
        never = () if self.zero is not None else ("no pulse means 0: a pulse never means standstill",)
        return (self.follows.note, *never, _LOST, _WIRE)

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps over USB; the interface comes last, since afterwards the module cannot be reached over CAN."""
        kind, mapping = self.follows, f"odrv0.config.gpio{_PIN}_pwm_mapping"
        return usb_steps(
            f"odrv0.axis0.controller.config.control_mode = {kind.control_mode}",
            f"odrv0.axis0.controller.config.input_mode = {kind.input_mode}",
            f"{mapping}.endpoint = odrv0.axis0.controller._input_{kind.what}_property",
            f"{mapping}.min = {self.low!r}",
            f"{mapping}.max = {self.high!r}",
            f"odrv0.config.gpio{_PIN}_mode = GPIO_MODE_PWM",
            f"odrv0.config.comm_intf_mux = {_INTERFACE}",
            after=_USB_ONLY,
        )


# ----------------------------------------------------------------------------------------------------------------------
# A module that follows pulse and direction signals, like a stepper driver (manual v2.2, 4.5): the pulse size, and the setup
# steps.
#
# The step/direction input replaces the CAN interface, and the modes of the pins have names only over USB. Therefore the steps are
# for USB.


FASTEST = 50_000.0  # pulses/s: the manual's recommended maximum
_PULSES_INTERFACE = 2  # config.comm_intf_mux
_STEP, _DIRECTION = 6, 7  # pins
_NOTES = (
    "pulse and direction give no absolute position: a lost or additional pulse shifts all positions after it",
    "limit switches use the same place: only one of both can be set",
    "step goes to the contact of CANH, direction to that of CANL, 5 V at most, with their grounds on the module's",
    "it is for hardware 3.10 or later",
    "to end it: enable_step_dir = False, then idle, then closed loop",
)


@dataclass(frozen=True, slots=True)
class Pulses:
    """``per_turn`` pulses are one turn of the rotor; if ``circular``, set-points wrap around after ``turns``."""

    per_turn: int
    turns: int
    circular: bool

    def __post_init__(self) -> None:
        for name, value in (("pulses per turn", self.per_turn), ("turns", self.turns)):
            if value < 1:
                raise ArgumentError(f"{name}: {value} is not above 0", remedy="give a whole number above 0")
        if self.in_all > 0x7FFF_FFFF:
            raise ArgumentError(
                f"{self.in_all} pulses in {counted(self.turns, 'turn')} are more than fit into 31 bits",
                remedy="give fewer turns, or fewer pulses per turn",
            )

    @property
    def in_all(self) -> int:
        return self.per_turn * self.turns

    @property
    def table(self) -> tuple[str, ...]:
        """Size of a pulse and the maximum velocity, as lines."""
        output = self.per_turn * GEAR_RATIO
        fastest = FASTEST / self.per_turn
        return (
            f"a pulse: {360.0 / self.per_turn:.6g}° of the rotor, {360.0 / output:.6g}° of the output",
            f"a turn of the output: {output:g} pulses",
            f"{FASTEST:g} pulses/s: {fastest:.6g} turns/s of the rotor, {fastest / GEAR_RATIO:.6g} turns/s of the output",
        )

    @property
    def notes(self) -> tuple[str, ...]:
        whole = math.isclose(self.turns % GEAR_RATIO, 0.0)
        odd = (
            f"after {counted(self.turns, 'turn')} of the rotor the output is not at its start position, at {GEAR_RATIO}:1",
        )
        return (*(odd if self.circular and not whole else ()), *_NOTES)

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps over USB; the interface comes last, since afterwards the module cannot be reached over CAN."""
        controller = "odrv0.axis0.controller.config"
        return usb_steps(
            f"odrv0.axis0.config.step_gpio_pin = {_STEP}",
            f"odrv0.axis0.config.dir_gpio_pin = {_DIRECTION}",
            *(f"odrv0.config.gpio{pin}_mode = GPIO_MODE_DIGITAL_PULL_UP" for pin in (_STEP, _DIRECTION)),
            f"{controller}.circular_setpoints = {self.circular}",
            f"{controller}.circular_setpoint_range = {float(self.turns)!r}",
            f"{controller}.steps_per_circular_range = {self.in_all}",
            "odrv0.axis0.config.enable_step_dir = True",
            f"odrv0.config.comm_intf_mux = {_PULSES_INTERFACE}",
            after=_USB_ONLY,
        )
