"""``axisbus gim6010 calibrate`` and ``modbus calibrate``: calibrate motor and encoder of a module, and check the result."""

from __future__ import annotations

from collections.abc import Sequence

import click

from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_next, say_note
from axisbus.cli.shared.options import GivenBus, bus_words
from axisbus.drives.gim6010.calibration import Calibration, CalibrationKind, explanation
from axisbus.drives.gim6010.cli.bus import (
    ask,
    end_by,
    line_options,
    require_bus,
    run_alone,
    without_remote,
    yes_option,
)
from axisbus.drives.gim6010.cli.modbus.target_module import (
    ModbusTarget,
    guard,
    line_of,
    list_options,
    opened,
    parameters,
    read_list,
)

_PRE_CALIBRATED = ("axis0.motor.config.pre_calibrated", "axis0.encoder.config.pre_calibrated")
_FLAGS = " ".join(f"{path}=true" for path in _PRE_CALIBRATED)


@click.command("calibrate")
@click.argument("what", type=click.Choice(["motor", "encoder", "full"]))
@line_options
@click.option("--node", required=True, type=click.IntRange(0, 63), help="The module's node ID.")
@yes_option
def command(what: str, line: GivenBus, node: int, yes: bool) -> int:
    """Calibrate the motor, the encoder, or both: THE OUTPUT MAY TURN DURING THE CALIBRATION.

    The command explains the calibration, asks for confirmation, monitors the calibration, and assesses the result. It requires
    that exactly one module of CAN Simple sends heartbeats under this node ID, and that the module is idle and reports no error.
    Ctrl-C, SIGTERM, the loss of the module, an error or too many turns abort the calibration: the command sends idle, then ESTOP,
    and shows the state of the module after that. Nothing is saved. Exit code 0 only if the calibration was completed without an
    error.
    """
    kind = CalibrationKind[what.upper()]
    require_bus(line)
    ask(explanation(kind, node), yes=yes)
    calibration = Calibration(node, kind, remote=not without_remote(line))
    number = run_alone(line, calibration)  # another program on the bus could also move this module
    module = f"{bus_words(*line)} --node {node}"
    over_usb = ", ".join(f"odrv0.{path} = True" for path in _PRE_CALIBRATED)
    return _end(
        calibration,
        number,
        f"axisbus gim6010 errors {module}",
        (
            f"axisbus gim6010 params set {_FLAGS} {module} --list ... --save",
            f"or over USB: {over_usb}, odrv0.save_configuration()",
        ),
    )


# -- ``axisbus gim6010 modbus calibrate``: the same over RS485 ----------------------------------------------------------


@click.command("calibrate")
@click.argument("what", type=click.Choice(["motor", "encoder", "full"]))
@list_options
@yes_option
def modbus_calibrate_command(what: str, target: ModbusTarget, yes: bool) -> int:
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
    with guard(target) as watchdog, line_of(target).open(listed, calibrates=True) as channel:
        calibration = Calibration(target.node, kind, guarded=lambda: watchdog.is_there)
        number = run_guarded(channel, calibration, say_note)
    return _end(
        calibration,
        number,
        f"axisbus gim6010 modbus errors {target.words}",
        (f"axisbus gim6010 modbus write {_FLAGS} --save {target.words} --list {target.listed}",),
    )


def _end(calibration: Calibration, number: int, hint: str, saving: Sequence[str]) -> int:
    """Print the result, and how to save it; end the program if a signal (``number``) requires that, or return the exit code."""
    code = _tell_result(calibration, hint)
    for way in saving if code == OK else ():
        say(f"  {way}")
    end_by(number)
    return code


def _tell_result(calibration: Calibration, hint: str) -> int:
    """Print the result of a calibration and the state in which it left the module; return its exit code.

    ``hint``: the command that shows the errors of the module.
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
