"""``axisbus gim6010 modbus``: ``stop`` and ``calibrate``, outside any cell."""

from __future__ import annotations

import click

from axisbus.cli.shared.common import OK, say, say_note
from axisbus.drives.gim6010.calibration import Calibration, CalibrationKind, explanation
from axisbus.drives.gim6010.cli.calibrate import PRE_CALIBRATED, tell_result
from axisbus.drives.gim6010.cli.confirm import ask, end_by, yes_option
from axisbus.drives.gim6010.cli.modbus.target_module import (
    ModbusTarget,
    guard,
    line_of,
    list_options,
    opened,
    parameters,
    read_list,
    target_options,
)

# -- ``axisbus gim6010 modbus stop``: velocity 0, idle, emergency stop, until a module is at standstill without power ----


@click.command("stop")
@target_options
def stop_command(target: ModbusTarget) -> int:
    """Stop a module, whichever program enabled it: velocity 0 on its own ramp, then idle, then emergency stop if idle is not
    confirmed.

    For a module that is an axis of a cell file, use axisbus stop CELL, which also reaches it in its running machine. Each Ctrl-C
    goes to the next step at once. The stop is also sent if the module does not answer. Exit code 3 if it is not confirmed as
    stopped. Another master that continues to command the module enables it again: stop that master first.
    """
    from axisbus.drives.gim6010.bus.one_module_line import stop_on_line
    from axisbus.drives.gim6010.bus.run import interrupts

    signals: list[str] = []
    with interrupts(signals.append), line_of(target) as channel:
        stop_on_line(channel, target.node, tell=say, impatience=lambda: len(signals))
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
    from axisbus.drives.gim6010.bus.run import run_guarded

    kind = CalibrationKind[what.upper()]
    listed = read_list(target.listed, target.made_for)  # before any question is asked or port opened
    ask(explanation(kind, target.node, watchdog_process=True), yes=yes)
    with opened(target) as module:
        parameters(target, module)  # whether the list fits
        module.require_idle(f"{kind.words} is begun")
    with guard(target) as watchdog, line_of(target, listed, calibrates=True) as channel:
        calibration = Calibration(target.node, kind, guarded=lambda: watchdog.is_there)
        number = run_guarded(channel, calibration, say_note)
    code = tell_result(calibration, f"axisbus gim6010 modbus errors {target.words}")
    if code == OK:
        keep = " ".join(f"{path}=true" for path in PRE_CALIBRATED)
        say(f"  axisbus gim6010 modbus write {keep} --save {target.words} --list {target.listed}")
    end_by(number)
    return code
