"""``axisbus gim6010 calibrate``: calibrate motor and encoder of a module, monitor the calibration, and check its result."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_next
from axisbus.drives.gim6010.cli.confirm import ask, end_by, yes_option
from axisbus.drives.gim6010.cli.discovery import BusOptions, line_options, run_alone, without_remote

if TYPE_CHECKING:
    from axisbus.drives.gim6010.calibration import Calibration

PRE_CALIBRATED = ("axis0.motor.config.pre_calibrated", "axis0.encoder.config.pre_calibrated")


@click.command("calibrate")
@click.argument("what", type=click.Choice(["motor", "encoder", "full"]))
@line_options
@click.option("--node", required=True, type=click.IntRange(0, 63), help="The module's node ID.")
@yes_option
def command(
    what: str,
    line: BusOptions,
    node: int,
    yes: bool,
) -> int:
    """Calibrate the motor, the encoder, or both: THE OUTPUT MAY TURN DURING THE CALIBRATION.

    The command explains the calibration, asks for confirmation, monitors the calibration, and assesses the result. It requires
    that exactly one module of CAN Simple sends heartbeats under this node ID, and that the module is idle and reports no error.
    Ctrl-C, SIGTERM, a lost module, an error and too many turns end it by idle, then ESTOP, and the state of the module after that
    is shown. Nothing is saved. Exit code 0 only if the calibration was completed without an error.
    """
    from axisbus.drives.gim6010.calibration import Calibration, CalibrationKind, explanation

    kind = CalibrationKind[what.upper()]
    line.check()
    ask(explanation(kind, node), yes=yes)
    calibration = Calibration(node, kind, remote=not without_remote(line))
    number = run_alone(line, calibration)  # another program on the bus could also move this module
    code = _tell(calibration, line)
    end_by(number)
    return code


def _tell(calibration: Calibration, line: BusOptions) -> int:
    code = tell_result(calibration, f"axisbus gim6010 errors {line.words} --node {calibration.node}")
    if code == OK:
        flags = " ".join(f"{path}=true" for path in PRE_CALIBRATED)
        say(f"  axisbus gim6010 params set {flags} {line.words} --node {calibration.node} --list ... --save")
        over_usb = ", ".join(f"odrv0.{path} = True" for path in PRE_CALIBRATED)
        say(f"  or over USB: {over_usb}, odrv0.save_configuration()")
    return code


def tell_result(calibration: Calibration, hint: str) -> int:
    """Print the result of a calibration and the state in which it left the module; return its exit code.

    ``hint``: the command that shows the errors of the module. After success, the caller prints how to save the result.
    """
    kind, found, left = calibration.kind, calibration.verdict, calibration.left
    if found is None:
        say_error(f"{kind.words} was not completed: {calibration.why}\n  observed: {left}")
        return FAILURE
    for note in found.notes:
        say(f"  note: {note}")
    if not found.good:
        say_error(f"{kind.words} FAILED; {left}")
        for text in found.wrong:
            say_error(f"  {text}")
        say_next(hint)
        return WRONG
    say(f"{kind.words} was completed without an error; {left}")
    say("its result is in RAM: the next start restores the old one. To save it, when both are calibrated:")
    return OK
