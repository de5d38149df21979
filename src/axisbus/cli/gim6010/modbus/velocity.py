"""``axisbus gim6010 modbus velocity``: enable a module, turn it for a time, stop it and switch it off."""

from __future__ import annotations

import math

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, axis, target_options
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.numbers import Seconds


@click.command("velocity", context_settings={"ignore_unknown_options": True})
@click.argument("velocity", type=float)
@target_options
@click.option(
    "--acceleration", type=float, required=True, help="In turns/s²; the module's own ramp may be slower."
)
@click.option(
    "--for", "seconds", type=Seconds(), help="How long, after it has reached it; without it, until Ctrl-C."
)
def command(target: ModbusTarget, velocity: float, acceleration: float, seconds: float | None) -> int:
    """Enable a module and turn it at VELOCITY (turns/s of the rotor) on a ramp, then stop it and switch it off.

    MOVES A REAL MOTOR. If the computer or the cable fails, it keeps turning: the module does not detect it. Ctrl-C as in modbus
    move.
    """
    from axisbus.drives.gim6010.modbus.motion.course import (
        ModbusControlMode,
        require_finite,
        require_positive,
    )

    require_finite(velocity=velocity)
    require_positive(acceleration=acceleration)
    with axis(target) as turned:
        turned.enable(ModbusControlMode.VELOCITY)
        turned.turn(velocity, acceleration=acceleration)
        say(f"module {target.node}: has {velocity:g} turns/s")
        turned.watch(math.inf if seconds is None else seconds)
    return OK
