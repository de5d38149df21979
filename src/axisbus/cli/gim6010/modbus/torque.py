"""``axisbus gim6010 modbus torque``: enable a module, apply a torque for a time, stop it and switch it off."""

from __future__ import annotations

import math

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, axis, target_options
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.numbers import Seconds


@click.command("torque", context_settings={"ignore_unknown_options": True})
@click.argument("torque", type=float)
@target_options
@click.option("--slope", type=float, required=True, help="In N·m/s; the module's own ramp may be slower.")
@click.option("--most", type=float, required=True, help="The highest torque that is allowed, in N·m.")
@click.option(
    "--max-velocity",
    type=float,
    required=True,
    help="Velocity in turns/s above which this program stops it; nothing else does.",
)
@click.option(
    "--for", "seconds", type=Seconds(), help="How long, after it has reached it; without it, until Ctrl-C."
)
def command(
    target: ModbusTarget, torque: float, slope: float, most: float, max_velocity: float, seconds: float | None
) -> int:
    """Enable a module and apply TORQUE (N·m at the rotor) on a slope, then stop it and switch it off.

    MOVES A REAL MOTOR. If the computer or the cable fails, the torque remains: the module does not detect it. The actual torque
    depends on the module's torque constant, for which the manual has three values. Ctrl-C as in modbus move.
    """
    from axisbus.drives.gim6010.modbus.motion.course import (
        ModbusControlMode,
        require_finite,
        require_positive,
        require_torque,
    )

    require_finite(torque=torque)
    require_positive(slope=slope, most=most, max_velocity=max_velocity)
    require_torque(torque, most)
    with axis(target) as pushed:
        pushed.enable(ModbusControlMode.TORQUE)
        pushed.push(torque, slope=slope, most=most, max_velocity=max_velocity)
        say(f"module {target.node}: has a set-point of {torque:g} N·m")
        pushed.watch(math.inf if seconds is None else seconds)
    return OK
