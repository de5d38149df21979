"""A module that follows pulse and direction signals, like a stepper driver (manual v2.2, 4.5): the pulse size, and the setup steps.

The step/direction input replaces the CAN interface, and the modes of the pins have names only over USB. Therefore the steps are for
USB.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.drives.gim6010.make import GEAR_RATIO
from axisbus.errors import ArgumentError
from axisbus.wording import counted

FASTEST = 50_000.0  # pulses/s: the manual's recommended maximum
_INTERFACE = 2  # config.comm_intf_mux
_STEP, _DIRECTION = 6, 7  # pins
_NOTES = (
    "pulse and direction know no position to go to: a pulse that is lost or one too many shifts everything after it",
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
        """Number of pulses in the whole range."""
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
        """Remarks for the user."""
        whole = math.isclose(self.turns % GEAR_RATIO, 0.0)
        odd = (
            f"after {counted(self.turns, 'turn')} of the rotor the output is not at its start position, at {GEAR_RATIO}:1",
        )
        return (*(odd if self.circular and not whole else ()), *_NOTES)

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps over USB; the interface comes last, since afterwards the module cannot be reached over CAN."""
        controller = "odrv0.axis0.controller.config"
        return (
            "connect it by USB and open odrivetool; it must be idle",
            f"odrv0.axis0.config.step_gpio_pin = {_STEP}",
            f"odrv0.axis0.config.dir_gpio_pin = {_DIRECTION}",
            *(f"odrv0.config.gpio{pin}_mode = GPIO_MODE_DIGITAL_PULL_UP" for pin in (_STEP, _DIRECTION)),
            f"{controller}.circular_setpoints = {self.circular}",
            f"{controller}.circular_setpoint_range = {float(self.turns)!r}",
            f"{controller}.steps_per_circular_range = {self.in_all}",
            "odrv0.axis0.config.enable_step_dir = True",
            f"odrv0.config.comm_intf_mux = {_INTERFACE}",
            "odrv0.save_configuration(), after which it restarts, and is reached over USB only",
        )
