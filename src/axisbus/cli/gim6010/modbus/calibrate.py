"""``axisbus gim6010 modbus calibrate``: calibrate motor and encoder of a module over RS485, and check the result."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.calibrate import PRE_CALIBRATED, tell_judged
from axisbus.cli.gim6010.confirm import ask, yes_option
from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, guard, list_options, opened, parameters
from axisbus.cli.gim6010.params.endpoint_list import read_list
from axisbus.cli.shared.common import say, say_note


@click.command("calibrate")
@click.argument("what", type=click.Choice(["motor", "encoder", "full"]))
@list_options
@yes_option
def command(what: str, target: ModbusTarget, yes: bool) -> int:
    """Calibrate the motor, the encoder, or both: THE OUTPUT MAY TURN DURING THE CALIBRATION. It explains, asks, follows, and
    judges.

    Needs the list of endpoints (--list), to see how far the rotor turns. Only if the module is idle and without an error.
    Ctrl-C, SIGTERM, a lost module, a state that does not belong to a calibration, and too many turns end it by idle, then
    emergency stop, and the state of the module after that is shown. Nothing is saved. Exit code 0 only if the calibration was
    completed without an error.
    """
    from axisbus.drives.gim6010.calibration.kinds import CalibrationKind, explanation
    from axisbus.drives.gim6010.modbus.motion.calibrating import Calibrating

    kind = CalibrationKind[what.upper()]
    read_list(target.listed, target.made_for)  # before any question is asked or port opened
    ask(explanation(kind, target.node, warden=True), yes=yes)
    with opened(target) as module, guard(target) as warden:
        found = Calibrating(
            parameters(target, module), kind, tell=say_note, guarded=lambda: warden.is_there
        ).run()
    left = f"module {target.node} is idle"
    keep = " ".join(f"{path}=true" for path in PRE_CALIBRATED)
    listed = f" --list {target.listed}"
    code = tell_judged(kind, found, left, f"axisbus gim6010 modbus errors {target.words}")
    if not code:
        say(f"  axisbus gim6010 modbus write {keep} --save {target.words}{listed}")
    return code
