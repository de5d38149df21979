"""``axisbus gim6010 modbus move``: enable a module, move it with a trapezoidal profile, stop it and switch it off."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, axis, target_options
from axisbus.cli.shared.common import OK, say


@click.command("move")
@target_options
@click.option("--to", type=float, metavar="TURNS", help="The position to move to.")
@click.option("--by", type=float, metavar="TURNS", help="The distance to move by.")
@click.option("--velocity", type=float, required=True, help="Highest velocity in turns/s.")
@click.option("--acceleration", type=float, required=True, help="In turns/s².")
@click.option("--deceleration", type=float, required=True, help="In turns/s².")
def command(
    target: ModbusTarget,
    to: float | None,
    by: float | None,
    velocity: float,
    acceleration: float,
    deceleration: float,
) -> int:
    """Enable a module, move it --to a position or --by a distance (turns of the rotor), then switch it off.

    MOVES A REAL MOTOR. Ctrl-C halts it, each further Ctrl-C is the next step of the stop sequence: velocity 0, idle, emergency
    stop. In the end it has no power: a hanging load falls.
    """
    from axisbus.drives.gim6010.modbus.constants import turns
    from axisbus.drives.gim6010.modbus.motion.course import (
        ModbusControlMode,
        require_finite,
        require_positive,
    )

    if (to is None) == (by is None):
        raise click.UsageError("give a position with --to, or a distance with --by")
    wanted, relative = (to, False) if to is not None else (by or 0.0, True)
    require_finite(position=wanted)
    require_positive(velocity=velocity, acceleration=acceleration, deceleration=deceleration)
    with axis(target) as moved:
        moved.enable(ModbusControlMode.POSITION)
        say(f"module {target.node}: enabled; moving {'by' if relative else 'to'} {turns(wanted)}")
        found = moved.move(
            wanted, velocity=velocity, acceleration=acceleration, deceleration=deceleration, relative=relative
        )
        say(f"module {target.node}: at {turns(found)}")
    return OK
