"""``axisbus gim6010 modbus``: the commands that move a module, and ``stop``."""

from __future__ import annotations

import math

import click

from axisbus.cli.shared.common import OK, say, say_note
from axisbus.cli.shared.options import Seconds
from axisbus.drives.gim6010.calibration import CalibrationKind, explanation
from axisbus.drives.gim6010.cli.calibrate import PRE_CALIBRATED, tell_judged
from axisbus.drives.gim6010.cli.confirm import ask, yes_option
from axisbus.drives.gim6010.cli.modbus.target_module import (
    ModbusTarget,
    axis,
    guard,
    list_options,
    opened,
    parameters,
    read_list,
    target_options,
)
from axisbus.drives.gim6010.modbus.motion import driver
from axisbus.drives.gim6010.modbus.motion.calibrating import Calibrating
from axisbus.drives.gim6010.modbus.motion.course import (
    ModbusControlMode,
    require_finite,
    require_positive,
    require_torque,
    turns,
)

# -- ``axisbus gim6010 modbus move``: enable a module, move it with a trapezoidal profile, stop it and switch it off ----


@click.command("move")
@target_options
@click.option("--to", type=float, metavar="TURNS", help="The position to move to.")
@click.option("--by", type=float, metavar="TURNS", help="The distance to move by.")
@click.option("--velocity", type=float, required=True, help="Highest velocity in turns/s.")
@click.option("--acceleration", type=float, required=True, help="In turns/s².")
@click.option("--deceleration", type=float, required=True, help="In turns/s².")
def move_command(
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


# -- ``axisbus gim6010 modbus velocity``: enable a module, turn it for a time, stop it and switch it off ---------------


@click.command("velocity", context_settings={"ignore_unknown_options": True})
@click.argument("velocity", type=float)
@target_options
@click.option(
    "--acceleration", type=float, required=True, help="In turns/s²; the module's own ramp may be slower."
)
@click.option(
    "--for", "seconds", type=Seconds(), help="Duration in seconds at this velocity; without it, until Ctrl-C."
)
def velocity_command(
    target: ModbusTarget, velocity: float, acceleration: float, seconds: float | None
) -> int:
    """Enable a module and turn it at VELOCITY (turns/s of the rotor) on a ramp, then stop it and switch it off.

    MOVES A REAL MOTOR. If the computer or the cable fails, it keeps turning: the module does not detect it. Ctrl-C as in modbus
    move.
    """
    require_finite(velocity=velocity)
    require_positive(acceleration=acceleration)
    with axis(target) as turned:
        turned.enable(ModbusControlMode.VELOCITY)
        turned.turn(velocity, acceleration=acceleration)
        say(f"module {target.node}: has {velocity:g} turns/s")
        turned.watch(math.inf if seconds is None else seconds)
    return OK


# -- ``axisbus gim6010 modbus torque``: enable a module, apply a torque for a time, stop it and switch it off ----------


@click.command("torque", context_settings={"ignore_unknown_options": True})
@click.argument("torque", type=float)
@target_options
@click.option("--slope", type=float, required=True, help="In N·m/s; the module's own ramp may be slower.")
@click.option("--most", type=float, required=True, help="The highest torque that is allowed, in N·m.")
@click.option(
    "--max-velocity",
    type=float,
    required=True,
    help="Velocity in turns/s above which this program stops the module; nothing else stops it.",
)
@click.option(
    "--for", "seconds", type=Seconds(), help="Duration in seconds at this torque; without it, until Ctrl-C."
)
def torque_command(
    target: ModbusTarget, torque: float, slope: float, most: float, max_velocity: float, seconds: float | None
) -> int:
    """Enable a module and apply TORQUE (N·m at the rotor) on a slope, then stop it and switch it off.

    MOVES A REAL MOTOR. If the computer or the cable fails, the torque remains: the module does not detect it. The actual torque
    depends on the module's torque constant, for which the manual has three values. Ctrl-C as in modbus move.
    """
    require_finite(torque=torque)
    require_positive(slope=slope, most=most, max_velocity=max_velocity)
    require_torque(torque, most)
    with axis(target) as pushed:
        pushed.enable(ModbusControlMode.TORQUE)
        pushed.push(torque, slope=slope, most=most, max_velocity=max_velocity)
        say(f"module {target.node}: has a set-point of {torque:g} N·m")
        pushed.watch(math.inf if seconds is None else seconds)
    return OK


# -- ``axisbus gim6010 modbus stop``: velocity 0, idle, emergency stop, until a module is at standstill without power ----


@click.command("stop")
@target_options
def stop_command(target: ModbusTarget) -> int:
    """Stop a module, whichever master enabled it: velocity 0 on its own ramp, then idle, then emergency stop if idle is not
    confirmed.

    Each Ctrl-C goes to the next step at once. The stop is also sent if the module does not answer. Exit code 3 if it is not
    confirmed as stopped. Another master that continues to command the module enables it again: stop that master first.
    """
    with opened(target) as module:
        driver.stop(module, tell=say)
    return OK


# -- ``axisbus gim6010 modbus calibrate``: calibrate motor and encoder of a module over RS485, and check the result ----


@click.command("calibrate")
@click.argument("what", type=click.Choice(["motor", "encoder", "full"]))
@list_options
@yes_option
def calibrate_command(what: str, target: ModbusTarget, yes: bool) -> int:
    """Calibrate the motor, the encoder, or both: THE OUTPUT MAY TURN DURING THE CALIBRATION.

    The command explains the calibration, asks for confirmation, monitors the calibration, and assesses the result. It needs the
    list of endpoints (--list), to see how far the rotor turns. The module must be idle and report no error.
    Ctrl-C, SIGTERM, a lost module, a state that does not belong to a calibration, and too many turns end it by idle, then
    emergency stop, and the state of the module after that is shown. Nothing is saved. Exit code 0 only if the calibration was
    completed without an error.
    """
    kind = CalibrationKind[what.upper()]
    read_list(target.listed, target.made_for)  # before any question is asked or port opened
    ask(explanation(kind, target.node, watchdog_process=True), yes=yes)
    with opened(target) as module, guard(target) as watchdog:
        found = Calibrating(
            parameters(target, module), kind, tell=say_note, guarded=lambda: watchdog.is_there
        ).run()
    left = f"module {target.node} is idle"
    keep = " ".join(f"{path}=true" for path in PRE_CALIBRATED)
    listed = f" --list {target.listed}"
    code = tell_judged(kind, found, left, f"axisbus gim6010 modbus errors {target.words}")
    if not code:
        say(f"  axisbus gim6010 modbus write {keep} --save {target.words}{listed}")
    return code
