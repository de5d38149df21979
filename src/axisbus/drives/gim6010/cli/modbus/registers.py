"""``axisbus gim6010 modbus``: the commands that read and write registers, and ``stop``."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace

import click

from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_json, say_next
from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, state_words
from axisbus.drives.gim6010.cli.modbus.target_module import (
    ModbusTarget,
    line_of,
    list_options,
    opened,
    parameters,
    parity_option,
    port_option,
    target_options,
)
from axisbus.drives.gim6010.cli.settings.common import pair, set_zero
from axisbus.drives.gim6010.modbus.module import (
    ModbusModule,
    Present,
    look,
    present,
    require_setting,
    set_node_id,
)
from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
from axisbus.drives.gim6010.modbus.registers import (
    ALIVE_IN_CLOSED_LOOP,
    BY_NAME,
    HIGHEST_DEVICE,
    RATES,
    REGISTERS,
    Register,
    named,
)
from axisbus.drives.gim6010.modbus.requests import write
from axisbus.drives.gim6010.parameters import values
from axisbus.wording import counted

# -- Parse and format values of registers and parameters ---------------------------------------------------------------


def is_parameter(name: str) -> bool:
    """Whether a name is a parameter of the list of endpoints: these have a point, except a few of the first level."""
    return "." in name or name not in BY_NAME


def parse(register: Register, text: str) -> Number:
    """Return a text as a value of the register's type; raises as ``values.parse``."""
    return values.parse(register.name, register.field.type.name, text)


def show(register: Register, value: Number) -> str:
    """Return a value as text with its meaning, its unit and its side of the gear."""
    field = register.field
    number = f"{value:.7g}" if isinstance(value, float) else str(value)
    words = field.values.get(int(value)) if field.values and math.isfinite(value) else None
    side = f" ({field.side.value})" if field.side.value else ""
    return " ".join(filter(None, (number, words and f"({words})", field.unit))) + side


# -- ``axisbus gim6010 modbus read``: read registers, and parameters by name -------------------------------------------


@click.command("read")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@list_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def read_command(target: ModbusTarget, names: tuple[str, ...], as_json: bool) -> int:
    """Read values by name: registers (all of them if no NAME is given), and with --list also parameters by their USB names.

    A value of several registers is read in one request. Position and velocity are only updated in closed loop, and may be
    outdated otherwise; in JSON they are null then.
    """
    wanted = names or tuple(
        each.name for each in REGISTERS if each.readable and each.name != "endpoint_return"
    )
    if target.listed is None:
        for name in wanted:
            if is_parameter(name):
                raise click.UsageError(
                    f"{name!r} is not a register ({', '.join(BY_NAME)}); a parameter of the firmware needs its list of endpoints: "
                    "--list"
                )
            named(name.removeprefix("odrv0."))
    with opened(target) as module:
        known = parameters(target, module) if any(map(is_parameter, wanted)) else None
        found: dict[str, object] = {}
        for name in wanted:
            if is_parameter(name) and known is not None:
                value = known.read(name)
                found[name] = values.plain(value)
                text = values.show(value)
            else:
                number = module.read(name)
                dead = name in ALIVE_IN_CLOSED_LOOP and module.state != CLOSED_LOOP
                found[name] = None if dead else values.plain(number)
                text = show(named(name), number) + (" (may be outdated: not in closed loop)" if dead else "")
            if not as_json:
                say(f"{name} = {text}")
    if as_json:
        say_json(found)
    return OK


# -- ``axisbus gim6010 modbus state``: print the state of a module -----------------------------------------------------


_SHOWN = (
    "control_mode",
    "input_mode",
    "position_setpoint",
    "velocity_setpoint",
    "torque_setpoint",
    "velocity_limit",
    "current_limit",
    "bus_voltage",
    "bus_current",
    "iq_feedback",
)


@click.command("state")
@target_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def state_command(target: ModbusTarget, as_json: bool) -> int:
    """Show the state of a module: its errors, modes, set-points, limits, supply, and in closed loop its position and velocity.

    It commands nothing. Exit code 1 when there is an error. In idle, position and velocity are not shown: they may be outdated.
    """
    with opened(target) as module:
        seen = look(module, tries=3)
        found = {name: module.read(name) for name in _SHOWN}
    if as_json:
        status = {name: getattr(seen, name) for name in ("state", "flags", "position", "velocity")}
        say_json(status | {name: values.plain(value) for name, value in found.items()})
        return WRONG if seen.flags else OK
    say(f"module {target.node} is in {state_words(seen.state)}" + (", with errors" if seen.flags else ""))
    for name, value in (("position_feedback", seen.position), ("velocity_feedback", seen.velocity)):
        say(f"  {name}: {'not alive' if value is None else show(named(name), value)}")
    for name, value in found.items():
        say(f"  {name}: {show(named(name), value)}")
    if seen.flags:
        say_next(f"axisbus gim6010 modbus errors {target.words}")
    return WRONG if seen.flags else OK


# -- ``axisbus gim6010 modbus errors``: print every error of a module with its name and explanation, and clear them ----


@click.command("errors")
@target_options
@click.option("--clear", is_flag=True, help="Clear the errors, and show those that remain; in idle only.")
@click.option("--json", "as_json", is_flag=True, help="Print the error words as JSON.")
def errors_command(target: ModbusTarget, clear: bool, as_json: bool) -> int:
    """Show every error of a module: its category, the meaning of each bit, and what to check. Exit code 1 when there is one."""
    return tell_errors(target, clear=clear, as_json=as_json)


def tell_errors(target: ModbusTarget, *, clear: bool = False, as_json: bool = False) -> int:
    """Print a module's errors, after clearing them if requested; return the exit code."""
    with opened(target) as module:
        found = module.errors()
        if clear and not as_json:
            for line in found.lines:
                say(f"was: {line}")
        if clear:
            found = module.clear_errors()
    return tell_lines({"flags": found.flags, **found.words}, found.lines, as_json=as_json)


def tell_lines(words: Mapping[str, int], lines: Sequence[str], *, as_json: bool) -> int:
    """Print error words as JSON, or the sentences about their bits; return the exit code, which follows from the words."""
    if as_json:
        say_json(words)
    else:
        for line in lines or ["no error"]:
            say(line)
    return WRONG if any(words.values()) else OK


# -- ``axisbus gim6010 modbus write``: write settings by name, read each back, set another node ID, and save -----------


_NODE_ID = "node_id"


@click.command("write")
@click.argument("pairs", nargs=-1, metavar="[NAME=VALUE]...")
@list_options
@click.option("--save", is_flag=True, help="Save RAM to flash at the end; the module restarts.")
def write_command(target: ModbusTarget, pairs: tuple[str, ...], save: bool) -> int:
    """Write settings into RAM by name, each read back: registers, and with --list parameters by their USB names.

    node_id=NEW is written alone: no other module may have that ID, and the command finds the module under it. Values that
    enable, move or stop are not settings, and are not written here. Modes, parameters, node ID and saving need a module in
    idle.
    """
    wanted = dict(pair(each, "NAME=VALUE") for each in pairs)
    if not wanted and not save:
        raise click.UsageError("give NAME=VALUE, or --save")
    if _NODE_ID in wanted:
        if len(pairs) > 1:
            raise click.UsageError(
                "node_id must be the only NAME=VALUE: it moves the module to another address"
            )
        return rename(target, int(parse(named(_NODE_ID), wanted[_NODE_ID])), save=save)
    _check({name: text for name, text in wanted.items() if not is_parameter(name)})
    with opened(target) as module:
        known = parameters(target, module) if any(map(is_parameter, wanted)) else None
        for name, text in wanted.items():
            say(_written(module, known, name, text))
        if save:
            say(_saved(module, known))
        else:
            say_next(
                f"in RAM only, lost at the next start; to save it: axisbus gim6010 modbus write --save {target.words}"
            )
    return OK


def _check(wanted: dict[str, str]) -> None:
    """Refuse invalid settings before the port is opened."""
    for name, text in wanted.items():
        register = named(name)
        require_setting(register)
        write(register, parse(register, text))


def _written(module: ModbusModule, known: ModbusParameters | None, name: str, text: str) -> str:
    if known is not None and is_parameter(name):
        endpoint = known.endpoint(name)
        before = values.show(known.read(name))
        value = values.parse(endpoint.path, endpoint.type, text)
        return f"{name} = {values.show(known.write(name, value, by_name=True))} (was {before})"
    return written(module, name, parse(named(name), text))


def written(module: ModbusModule, name: str, value: Number) -> str:
    """Write a register and read it back; return its value and the one before as text. Raises as ``ModbusModule.write``."""
    register = named(name)
    before = show(register, module.read(name))
    return f"{name} = {show(register, module.write(name, value))} (was {before})"


def _saved(module: ModbusModule, known: ModbusParameters | None) -> str:
    if known is not None:
        known.save()
        return "saved, and read again"
    return (
        "saved: it restarted, and answers" if module.save() else "saved: it answers, and no restart was seen"
    )


def rename(target: ModbusTarget, new: int, *, save: bool) -> int:
    """Set another node ID in a module, and print how to reach it then; return the exit code."""
    with opened(target) as module:
        found = set_node_id(module, new, save=save)
    if save:
        say(f"module {target.node} is now module {new}, saved")
        say_next(f"label it {new}; then axisbus gim6010 modbus state --port {target.port} --node {new}")
        return OK
    say(f"module {target.node} has node ID {new} in RAM, and answers to {found.device}")
    say(f"after switching it off and on, it has {target.node} again")
    return OK


# -- ``axisbus gim6010 modbus zero``: define the present position of a module as 0, and save it ------------------------


@click.command("zero")
@list_options
def zero_command(target: ModbusTarget) -> int:
    """Set the present position of a module to 0 by writing its parameters (needs --list); the module saves it, and restarts.

    In idle only. After a start a module knows its position within one turn of the rotor, so it is the zero of this turn.
    Refused if its position does not agree with its encoder's count; then set it over USB.
    """
    with opened(target) as module:
        set_zero(parameters(target, module))
    say(f"module {target.node}: its zero is the present position; saved")
    say_next(f"axisbus gim6010 modbus state {target.words}")
    return OK


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
    with interrupts(signals.append), line_of(target).open() as channel:
        stop_on_line(channel, target.node, tell=say, impatience=lambda: len(signals))
    return OK


# -- ``axisbus gim6010 modbus find``: find the modules on a line -------------------------------------------------------


_USUAL = 63
_TIMEOUT = 0.1  # s for an answer, which takes a few ms


@click.command("find")
@port_option
@click.option(
    "--rate",
    "rates",
    type=click.Choice([*map(str, RATES), "all"]),
    default=str(RATES[-1]),
    show_default=True,
    help="The line's rate in bit/s; all: one after another.",
)
@parity_option
@click.option(
    "--highest",
    type=click.IntRange(1, HIGHEST_DEVICE),
    default=_USUAL,
    show_default=True,
    help="The highest node ID to ask.",
)
def find_command(port: str, rates: str, parity: str, highest: int) -> int:
    """Poll one node ID after the other; show state, supply and errors of each module found, and the next command to type.

    Nothing is written. It asks at one rate, or at all of them with --rate all: no other program may use the line meanwhile.
    Exit code 0 if a module was found without an error, 1 if one has an error, 3 if no module answers.
    """
    asked = RATES[::-1] if rates == "all" else (int(rates),)
    good: list[bool] = []
    for rate in asked:
        good += _at(ModbusTarget(port, 1, rate, parity), highest)
    if not good:
        say_error(_nobody(port, highest, asked))
        return FAILURE
    return OK if all(good) else WRONG


def _at(line: ModbusTarget, highest: int) -> list[bool]:
    """Query all node IDs at one rate; return for each module whether it has no error."""
    good = []
    with line.wire(_TIMEOUT) as wire:
        for found in present(wire, range(1, highest + 1)):
            if not isinstance(found, Present):
                _show_progress(found, highest, line.rate)
                continue
            say(f"{found}, at {line.rate} bit/s" if not found.trouble else f"at {line.rate} bit/s {found}")
            verb = "errors" if found.trouble else "state"
            say_next(f"axisbus gim6010 modbus {verb} {replace(line, node=found.device).words}")
            good.append(not found.trouble)
    return good


def _show_progress(device: int, highest: int, rate: int) -> None:
    if sys.stderr.isatty():
        end = "\r" if device < highest else "\n"
        click.echo(f"  {rate} bit/s: node ID {device} of {highest}", err=True, nl=False)
        click.echo(end, err=True, nl=False)


def _nobody(port: str, highest: int, rates: tuple[int, ...]) -> str:
    tried = "at all rates" if len(rates) > 1 else f"at {rates[0]} bit/s"
    return (
        f"no module answers on {port}\n  observed: {counted(highest, 'node ID')} asked {tried}\n"
        "  remedy:   check the supply, that A and B are not swapped, the ground, and that RS485 is the interface of the "
        "module (config.comm_intf_mux = 1 "
        "over USB); try --rate all, --parity even, --highest 247"
    )
