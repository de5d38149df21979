"""The commands that set parameters of a module: ``axisbus gim6010 limits``, ``watchdog`` and others."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.buses import opening_of
from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_next
from axisbus.cli.shared.options import BitRate, Seconds
from axisbus.drives.gim6010.cli.discovery import BusOptions, require_node, survey
from axisbus.drives.gim6010.cli.params.module import (
    ModuleSelection,
    by_message,
    module_options,
    opened,
    require_list,
)
from axisbus.drives.gim6010.cli.settings.common import (
    change,
    end,
    over_usb,
    put,
    save_option,
    set_zero,
    show,
    typed,
    with_module,
)
from axisbus.errors import NodeError

if TYPE_CHECKING:
    from axisbus.drives.gim6010.cli.modbus.target_module import ModbusTarget
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters
    from axisbus.drives.gim6010.settings.pulse_inputs import PulseMapping, Pulses


# -- ``axisbus gim6010 limits``: the module's own limits of velocity and current ---------------------------------------


@click.command("limits")
@click.option("--velocity", type=float, help="In turns/s of the rotor.")
@click.option("--current", type=float, help="In A of the motor, at most 50.")
@module_options
@save_option
def limits_command(asked: ModuleSelection, velocity: float | None, current: float | None, save: bool) -> int:
    """Set the module's own limits of velocity and motor current, only while it is idle; with neither, show them.

    With --list, or over --usb, they are written as parameters and read back. Otherwise both have to be given, and are sent in
    one message (Set_Limits) that owners have seen to work, but that nothing confirms: the limits apply until the next start,
    and --save is refused. Over --modbus they are registers, read back.
    """
    from axisbus.drives.gim6010.settings.parameter_settings import PATHS, limits

    if velocity is None and current is None:
        return show(asked, PATHS["limits"])
    wanted = limits(velocity, current)
    _say_output(velocity)
    given = {"velocity": velocity, "current": current}
    if asked.listed is None and asked.serial is not None:
        return _by_register(asked, asked.serial, given, save=save)
    if asked.listed is None and asked.usb is None:
        return _by_message(asked, velocity, current, save=save)
    return change(asked, wanted, typed("limits", given), save=save)


def _by_register(
    asked: ModuleSelection, serial: ModbusTarget, limits: Mapping[str, float | None], *, save: bool
) -> int:
    from axisbus.drives.gim6010.cli.modbus.registers import show
    from axisbus.drives.gim6010.cli.modbus.target_module import opened
    from axisbus.drives.gim6010.modbus.registers import named

    with opened(serial) as module:
        module.require_idle("its limits are set")
        for name, value in ((f"{name}_limit", value) for name, value in limits.items() if value is not None):
            before = show(named(name), module.read(name))
            say(f"{name} = {show(named(name), module.write(name, value))} (was {before})")
        if save:
            module.save()
    end(asked, typed("limits", limits), saved=save)
    return OK


def _say_output(velocity: float | None) -> None:
    from axisbus.drives.gim6010.make import GEAR_RATIO

    if velocity is not None:
        say(
            f"{velocity:g} turns/s of the rotor are {velocity / GEAR_RATIO:g} turns/s of the output at {GEAR_RATIO}:1"
        )


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


# -- ``axisbus gim6010 watchdog``: the watchdog by which a module detects that it gets no more commands ----------------


@click.command("watchdog")
@click.option(
    "--break-timeout", "broken", type=Seconds(), help="For can.config.break_timeout, such as 500ms."
)
@click.option("--axis-timeout", "axis", type=Seconds(), help="For the axis's watchdog, such as 500ms.")
@click.option(
    "--off", "switched_off", is_flag=True, help="Switch both off, and clear the error that they have caused."
)
@module_options
@save_option
def watchdog_command(
    asked: ModuleSelection, broken: float | None, axis: float | None, switched_off: bool, save: bool
) -> int:
    """Arm the watchdogs that disarm a module when no set-point arrives within a time, or switch them off; with no option, show
    them.

    Written as parameters and read back, only to a module that is idle. An armed watchdog runs from then on, also in idle.
    """
    from axisbus.drives.gim6010.settings import watchdog

    if switched_off and (broken is not None or axis is not None):
        raise click.UsageError("--off excludes the times")
    if broken is None and axis is None and not switched_off:
        return show(asked, watchdog.PATHS)
    wanted = watchdog.off() if switched_off else watchdog.wanted(broken, axis)

    given = {"break-timeout": broken, "axis-timeout": axis}
    return change(
        asked,
        wanted,
        "watchdog --off" if switched_off else typed("watchdog", given, unit="s"),
        save=save,
        afterwards=_clear if switched_off and not save else None,
    )


def _clear(module: ModuleParameters) -> None:
    """Clear the error of a watchdog trip, if the axis reports no other one."""
    from axisbus.drives.gim6010.settings.watchdog import LATCHED

    error = module.axis_error
    if error and not error & ~LATCHED:
        module.clear_errors()
        say("the error that it had caused is cleared")


# -- ``axisbus gim6010 termination``: the module's own resistor of 120 Ω, on or off ------------------------------------


@click.command("termination")
@click.argument("state", type=click.Choice(["on", "off"]), required=False)
@module_options
@save_option
def termination_command(asked: ModuleSelection, state: str | None, save: bool) -> int:
    """Switch the module's own terminating resistor of 120 Ω on or off; without ON or OFF, show it.

    Written as a parameter and read back, only to a module that is idle. If it answers no endpoint, the steps over USB are
    shown.
    """
    from axisbus.drives.gim6010.settings.parameter_settings import PATHS, termination

    if state is None:
        return show(asked, PATHS["termination"])
    return change(asked, termination(on=state == "on"), f"termination {state}", save=save)


# -- ``axisbus gim6010 endstops``: the module's own two limit switches -------------------------------------------------


_SWITCH = click.Choice(["on", "off"])


@click.command("endstops")
@click.option("--min", "lowest", type=_SWITCH, help="LW1, at the lowest position.")
@click.option("--max", "highest", type=_SWITCH, help="LW2, at the highest position.")
@module_options
@save_option
def endstops_command(asked: ModuleSelection, lowest: str | None, highest: str | None, save: bool) -> int:
    """Switch the module's own limit switches on or off; with neither option, show them.

    Written as parameters and read back, only to a module that is idle. Refused for hardware that has none (3.7).
    """
    from axisbus.drives.gim6010.settings.parameter_settings import PATHS, endstops

    if lowest is None and highest is None:
        return show(asked, PATHS["endstops"])
    wanted = endstops(*(None if each is None else each == "on" for each in (lowest, highest)))
    return change(asked, wanted, typed("endstops", {"min": lowest, "max": highest}), save=save)


# -- ``axisbus gim6010 brake-resistor``: the resistor that dissipates the energy of a braking motor --------------------


Ramp = tuple[float, float]


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
@click.option("--off", "switched_off", is_flag=True, help="Switch it off.")
@module_options
@save_option
def brake_resistor_command(
    asked: ModuleSelection,
    ohm: float | None,
    max_regen: float | None,
    ramp: Ramp | None,
    switched_off: bool,
    save: bool,
) -> int:
    """Switch a braking resistor on or off; with no option, show its settings.

    --ohm goes with --max-regen, with --ramp, or with both. Written as parameters and read back, only to a module that is idle.
    A ramp that ends above the module's own overvoltage limit is refused.
    """
    from axisbus.drives.gim6010.settings.parameter_settings import PATHS, brake_resistor, no_brake_resistor

    given = {"ohm": ohm, "max-regen": max_regen, "ramp": ramp}
    is_given = any(value is not None for value in given.values())
    if switched_off and is_given:
        raise click.UsageError("--off excludes all other options")
    if switched_off:
        return change(asked, no_brake_resistor(), "brake-resistor --off", save=save)
    if not is_given:
        return show(asked, PATHS["brake-resistor"])
    if ohm is None:
        raise click.UsageError("give the resistance with --ohm")
    wanted = brake_resistor(ohm, max_regen, ramp)
    return change(asked, wanted, typed("brake-resistor", given), save=save)


# -- ``axisbus gim6010 pulses``: the meaning of a pulse of pulse and direction, and how to configure it ----------------


@click.command("pulses")
@click.option("--per-turn", type=int, required=True, help="Pulses per turn of the rotor.")
@click.option("--turns", type=int, required=True, help="The range of set-points, in turns of the rotor.")
@click.option("--circular", is_flag=True, help="Let set-points wrap around at the end of that range.")
def pulses_command(per_turn: int, turns: int, circular: bool) -> int:
    """Show the size of a pulse at rotor and output, the velocity at the highest pulse rate, and the steps to set it over USB.

    Sends nothing and writes nothing: the modes of the pins are set by names that only USB has.
    """
    from axisbus.drives.gim6010.settings.pulse_inputs import Pulses

    return _tell_input(Pulses(per_turn, turns, circular))


def _tell_input(of_pulses: Pulses | PulseMapping) -> int:
    for line in of_pulses.table:
        say(line)
    for note in of_pulses.notes:
        say(f"  note: {note}")
    over_usb(of_pulses.steps)
    return OK


# -- ``axisbus gim6010 pwm``: the mapping of a remote control's pulses, and how to configure it ------------------------


@click.command("pwm", context_settings={"ignore_unknown_options": True})
@click.argument("follows", type=click.Choice(["position", "velocity", "torque"]))
@click.argument("low", type=float)
@click.argument("high", type=float)
def pwm_command(follows: str, low: float, high: float) -> int:
    """Show how pulses of 1 to 2 ms are mapped to LOW to HIGH (turns, turns/s or N·m of the rotor), and the steps to set it over
    USB.

    Sends nothing and writes nothing: the parameter that follows the pulses is set by a reference that only USB has.
    """
    from axisbus.drives.gim6010.settings.pulse_inputs import Follows, PulseMapping

    return _tell_input(PulseMapping(Follows[follows.upper()], low, high))


# -- ``axisbus gim6010 set-bitrate``: set the bit rate of a module that is alone on its bus ----------------------------


_BACK = 25.0  # s, the time of a restart as reported by owners


@click.command("set-bitrate")
@click.argument("rate", type=BitRate())
@module_options
def set_bitrate_command(asked: ModuleSelection, rate: int) -> int:
    """Give a module that speaks CAN Simple the bit rate RATE (bit/s), save it, and find it again at that rate.

    Needs its list of endpoints. First the command searches the whole bus (about 10 s). It refuses if the module is not alone,
    since it would destroy the others' frames, or if it is not idle. Saving restarts it; the new rate applies from then on. Over
    --modbus and --usb there is no search: the rate is that of its CAN interface, which need not be connected.
    """
    from axisbus.drives.gim6010 import node_id_preconditions
    from axisbus.drives.gim6010.settings.parameter_settings import BIT_RATE, bit_rate, require_alone

    wanted = bit_rate(rate)
    require_list(asked)
    if not asked.over_can:
        with opened(asked) as module:
            put(module, wanted, save=True)
        say("saved: its CAN interface uses this rate when CAN is its interface")
        return OK
    node = require_node(asked.node)
    finder, found = survey(asked.line)
    node_id_preconditions.require_one(finder, found, node)
    require_alone(finder, found, node)
    try:
        with opened(asked) as module:
            if module.read(BIT_RATE) == rate:
                say(
                    f"module {node} already has {rate} bit/s, in RAM; its next start restores the rate of its flash"
                )
            put(module, wanted, save=False)
            say("saving, which restarts it: from now on search for it at the new rate")
            module.save_and_leave()
    except NodeError as error:
        say_error(str(error))
        over_usb(wanted.over_usb)
        return FAILURE
    return _found_again(asked, node, rate)


def _found_again(asked: ModuleSelection, node: int, rate: int) -> int:
    from axisbus.bus.link import socketcan
    from axisbus.bus.link.bitrate_change import OwnRate

    opening, line = opening_of(None, *asked.line), asked.line
    if opening.own_rate is OwnRate.SYSTEM:
        say(
            "it was saved and restarts; this computer still has the old rate, and would destroy its frames. Type in this order:"
        )
        steps = (
            socketcan.change_command(str(opening.channel), rate).split("; ")
            if line.interface == "socketcan"
            else ()
        )
        for step in steps or ("set the rate of the link",):
            say(f"  {step}")
        say_next(f"axisbus gim6010 find {line.words}")
        return OK
    there = line if opening.own_rate is OwnRate.NONE else line._replace(bitrate=rate)
    if _is_there(there, node):
        say(f"module {node} is found at {rate} bit/s")
        return OK
    say_error(
        f"module {node} was saved and restarted, and is not found at {rate} bit/s in {_BACK:g} s\n"
        f"  remedy:   look for it at either rate: axisbus gim6010 find {there.words}; {line.words}"
    )
    return FAILURE


def _is_there(line: BusOptions, node: int) -> bool:
    end = time.monotonic() + _BACK
    while time.monotonic() < end:
        if any(each.node == node and each.heartbeat and each.state for each in survey(line, node)[1]):
            return True
    return False


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
    from axisbus.drives.gim6010.settings import zero

    if until_restart:
        return _until_restart(asked)
    code = with_module(asked, set_zero, zero.STEPS)
    if code == OK:
        say("saved: it restarted, and its position is 0 here")
    return code


def _until_restart(asked: ModuleSelection) -> int:
    with by_message(asked) as module:
        module.set_zero()
    say(f"module {asked.node} counts from 0 at its present position, until its next start")
    return OK
