"""The commands that set parameters of a module: ``axisbus gim6010 limits``, ``watchdog`` and others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import click

from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.options import Decorated, Seconds
from axisbus.drives.gim6010.cli.modbus.registers import written
from axisbus.drives.gim6010.cli.modbus.target_module import ModbusTarget, opened
from axisbus.drives.gim6010.cli.module_selection import ModuleSelection, by_message, module_options
from axisbus.drives.gim6010.cli.settings.common import (
    Act,
    change,
    end,
    over_usb,
    save_option,
    set_zero,
    show,
    with_module,
)
from axisbus.drives.gim6010.make import GEAR_RATIO
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.settings import parameter_settings as settings
from axisbus.drives.gim6010.settings import watchdog, zero
from axisbus.drives.gim6010.settings.parameter_settings import ParameterBatch
from axisbus.drives.gim6010.settings.pulse_inputs import FOLLOWS, PulseMapping, Pulses

# -- The settings that are parameters: one row each, and one function that carries a row out over CAN, Modbus and USB ---


class _Setting(NamedTuple):
    """A row: the options of a setting, the parameters that show it, those that the options set, and those that switch it off.

    ``wanted`` gets the options in this order, None for those that are not given; ``afterwards`` follows if the setting is switched
    off in RAM. ``unit`` is that of the options, in a command to be repeated.
    """

    options: tuple[str, ...]
    paths: tuple[str, ...]
    wanted: Callable[..., ParameterBatch]
    off: Callable[[], ParameterBatch] | None = None
    afterwards: Act | None = None
    unit: str = ""


def _clear(module: ModuleParameters) -> None:
    """Clear the error of a watchdog trip, if the axis reports no other one."""
    error = module.axis_error
    if error and not error & ~watchdog.LATCHED:
        module.clear_errors()
        say("the error that it had caused is cleared")


_SETTINGS = {
    "limits": _Setting(("velocity", "current"), settings.PATHS["limits"], settings.limits),
    "watchdog": _Setting(
        ("break-timeout", "axis-timeout"), watchdog.PATHS, watchdog.wanted, watchdog.off, _clear, unit="s"
    ),
    "termination": _Setting(
        ("state",), settings.PATHS["termination"], lambda state: settings.termination(on=state)
    ),
    "endstops": _Setting(("min", "max"), settings.PATHS["endstops"], settings.endstops),
    "brake-resistor": _Setting(
        ("ohm", "max-regen", "ramp"),
        settings.PATHS["brake-resistor"],
        settings.brake_resistor,
        settings.no_brake_resistor,
    ),
}
_SWITCH = {"on": True, "off": False}


def _setting_options(function: Decorated) -> Decorated:
    """Add the options of every setting: those that select the module, and --save."""
    return module_options(save_option(function))


def _carry_out(name: str, asked: ModuleSelection, save: bool, off: bool = False, **options: Any) -> int:
    """Show a setting if no option is given; otherwise write it, read it back, and save it if requested."""
    row = _SETTINGS[name]
    given = {key: options[key.replace("-", "_")] for key in row.options}
    is_given = any(value is not None for value in given.values())
    if off and is_given:
        raise click.UsageError(f"--off excludes {', '.join(f'--{key}' for key in given)}")
    if row.off is not None and off:
        after = None if save else row.afterwards
        return change(asked, row.off(), f"{name} --off", save=save, afterwards=after)
    if not is_given:
        return show(asked, row.paths)
    wanted = row.wanted(*(_SWITCH.get(value, value) for value in given.values()))
    return change(asked, wanted, typed(name, given, row.unit), save=save)


def typed(command: str, options: Mapping[str, object], unit: str = "") -> str:
    """Return a command with its options as typed, without those that were not given; times have a ``unit``.

    The argument ``state`` has no name.
    """
    words = [command]
    for name, value in options.items():
        if value is not None:
            words += [] if name == "state" else [f"--{name}"]
            words.append(f"{_value(value)}{unit}")
    return " ".join(words)


def _value(value: object) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_value, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


@click.command("watchdog")
@click.option("--break-timeout", type=Seconds(), help="Value of can.config.break_timeout, such as 500ms.")
@click.option("--axis-timeout", type=Seconds(), help="Timeout of the axis's watchdog, such as 500ms.")
@click.option("--off", is_flag=True, help="Switch both off, and clear the error that they have caused.")
@_setting_options
def watchdog_command(**given: Any) -> int:
    """Arm the watchdogs that disarm a module when no set-point arrives within a time, or switch them off; with no option, show
    them.

    The command writes the values as parameters and reads them back. The module must be idle. An armed watchdog runs from then on,
    also in idle.
    """
    return _carry_out("watchdog", **given)


@click.command("termination")
@click.argument("state", type=click.Choice([*_SWITCH]), required=False)
@_setting_options
def termination_command(**given: Any) -> int:
    """Switch the module's own terminating resistor of 120 Ω on or off; without ON or OFF, show it.

    The command writes the value as a parameter and reads it back. The module must be idle. If it answers no endpoint, the steps
    over USB are shown.
    """
    return _carry_out("termination", **given)


@click.command("endstops")
@click.option("--min", type=click.Choice([*_SWITCH]), help="The limit switch LW1, at the lowest position.")
@click.option("--max", type=click.Choice([*_SWITCH]), help="The limit switch LW2, at the highest position.")
@_setting_options
def endstops_command(**given: Any) -> int:
    """Switch the module's own limit switches on or off; with neither option, show them.

    The command writes the values as parameters and reads them back. The module must be idle. Hardware 3.7 has no limit switches:
    the command is refused.
    """
    return _carry_out("endstops", **given)


@click.command("brake-resistor")
@click.option("--ohm", type=float, help="The resistance of the resistor, in Ω.")
@click.option(
    "--max-regen", type=float, help="Highest current in A into the supply; the rest goes into the resistor."
)
@click.option(
    "--ramp",
    nargs=2,
    type=float,
    metavar="BEGIN END",
    help="Supply voltages in V at which the resistor begins to act, and at which it is fully on.",
)
@click.option("--off", is_flag=True, help="Switch the resistor off.")
@_setting_options
def brake_resistor_command(**given: Any) -> int:
    """Switch a braking resistor on or off; with no option, show its settings.

    --ohm needs --max-regen, --ramp, or both. The command writes the values as parameters and reads them back. The module must be
    idle. A ramp that ends above the module's own overvoltage limit is refused.
    """
    if given["ohm"] is None and not given["off"] and (given["max_regen"], given["ramp"]) != (None, None):
        raise click.UsageError("give the resistance with --ohm")
    return _carry_out("brake-resistor", **given)


# -- ``axisbus gim6010 limits``: also a message of CAN Simple, and registers of Modbus ----------------------------------


@click.command("limits")
@click.option("--velocity", type=float, help="The highest velocity, in turns/s of the rotor.")
@click.option("--current", type=float, help="The highest motor current in A, at most 50.")
@_setting_options
def limits_command(asked: ModuleSelection, velocity: float | None, current: float | None, save: bool) -> int:
    """Set the module's own limits of velocity and motor current, only while it is idle; with neither, show them.

    With --list, or over --usb, they are written as parameters and read back. Otherwise both have to be given, and are sent in
    one message (Set_Limits) that owners have seen to work, but that nothing confirms: the limits apply until the next start,
    and --save is refused. Over --modbus they are registers, read back.
    """
    given: dict[str, Any] = {"velocity": velocity, "current": current}
    if (velocity, current) != (None, None):
        settings.limits(velocity, current)  # invalid limits are refused before anything is printed or opened
    if velocity is not None:
        say(
            f"{velocity:g} turns/s of the rotor are {velocity / GEAR_RATIO:g} turns/s of the output at {GEAR_RATIO}:1"
        )
    if (velocity, current) == (None, None) or asked.listed is not None or asked.usb is not None:
        return _carry_out("limits", asked, save, **given)
    if asked.serial is not None:
        return _by_register(asked, asked.serial, given, save=save)
    return _by_message(asked, velocity, current, save=save)


def _by_register(
    asked: ModuleSelection, serial: ModbusTarget, limits: Mapping[str, float | None], *, save: bool
) -> int:
    with opened(serial) as module:
        module.require_idle("its limits are set")
        for name, value in limits.items():
            if value is not None:
                say(written(module, f"{name}_limit", value))
        if save:
            module.save()
    end(asked, typed("limits", limits), saved=save)
    return OK


def _by_message(asked: ModuleSelection, velocity: float | None, current: float | None, *, save: bool) -> int:
    if velocity is None or current is None:
        raise click.UsageError(
            "without --list both limits go out in one message: give --velocity and --current"
        )
    if save:
        raise click.UsageError(
            "unconfirmed limits are not saved: give the firmware's list with --list, or save over USB"
        )
    with by_message(asked) as module:
        module.set_limits(velocity, current)
    say(
        f"sent to module {asked.node}: {velocity:g} turns/s and {current:g} A; nothing confirms it, and its next start undoes it"
    )
    return OK


# -- ``axisbus gim6010 pulses`` and ``pwm``: the meaning of pulses as inputs, and how to configure them over USB --------


@click.command("pulses")
@click.option("--per-turn", type=int, required=True, help="Pulses per turn of the rotor.")
@click.option("--turns", type=int, required=True, help="The range of set-points, in turns of the rotor.")
@click.option("--circular", is_flag=True, help="Let set-points wrap around at the end of that range.")
def pulses_command(per_turn: int, turns: int, circular: bool) -> int:
    """Show the size of a pulse at rotor and output, the velocity at the highest pulse rate, and the steps to set it over USB.

    Sends nothing and writes nothing: the modes of the pins are set by names that only USB has.
    """
    return _tell_input(Pulses(per_turn, turns, circular))


@click.command("pwm", context_settings={"ignore_unknown_options": True})
@click.argument("follows", type=click.Choice([*FOLLOWS]))
@click.argument("low", type=float)
@click.argument("high", type=float)
def pwm_command(follows: str, low: float, high: float) -> int:
    """Show how pulses of 1 to 2 ms are mapped to LOW to HIGH (turns, turns/s or N·m of the rotor), and the steps to set it over
    USB.

    Sends nothing and writes nothing: the parameter that follows the pulses is set by a reference that only USB has.
    """
    return _tell_input(PulseMapping(FOLLOWS[follows], low, high))


def _tell_input(of_pulses: Pulses | PulseMapping) -> int:
    for line in of_pulses.table:
        say(line)
    for note in of_pulses.notes:
        say(f"  note: {note}")
    over_usb(of_pulses.steps)
    return OK


# -- ``axisbus gim6010 zero``: define the present position of a module as its zero -------------------------------------


@click.command("zero")
@module_options
@click.option(
    "--until-restart",
    is_flag=True,
    help="Set the count to 0 by a message, without --list; the next start undoes it.",
)
def zero_command(asked: ModuleSelection, until_restart: bool) -> int:
    """Set the present position of a module as its zero; only while it is idle and does not turn.

    With --list, or over --usb, the user's zero (index_offset) is written, read back and saved, which restarts the module, and
    its position is checked after that. It is written only if the estimate of its position agrees with its encoder's count.
    """
    if until_restart:
        with by_message(asked) as module:
            module.set_zero()
        say(f"module {asked.node} counts from 0 at its present position, until its next start")
        return OK
    code = with_module(asked, set_zero, zero.STEPS)
    if code == OK:
        say("saved: it restarted, and its position is 0 here")
    return code
