"""The commands that change how a module is reached: ``axisbus gim6010 set-id``, ``set-bitrate``, ``to-canopen``, ``to-can-simple``.

Each first searches the bus for other modules that the change would disturb. Then it writes, saves, which restarts the module, and
searches the module again.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack

import click

from axisbus.cli.shared.buses import open_bus, opening_of
from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_next
from axisbus.cli.shared.options import BitRate, GivenBus, bus_words
from axisbus.drives.gim6010 import node_id_preconditions
from axisbus.drives.gim6010.cli.bus import line_options, require_node, survey
from axisbus.drives.gim6010.cli.modbus.registers import rename
from axisbus.drives.gim6010.cli.modbus.target_module import ModbusTarget
from axisbus.drives.gim6010.cli.module_selection import (
    ModuleSelection,
    modbus_options,
    module_options,
    on_usb,
    opened,
    require_list,
    usb_options,
    usb_words_of,
)
from axisbus.drives.gim6010.cli.settings.common import over_usb, put, with_module
from axisbus.drives.gim6010.discovery.results import DiscoveredModule, ProtocolsFound
from axisbus.drives.gim6010.make import RESTART_TIME
from axisbus.drives.gim6010.parameters import rules
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.settings.parameter_settings import (
    BIT_RATE,
    CAN_SIMPLE,
    CANOPEN,
    SEARCH,
    bit_rate,
    protocol,
)


def _searched(line: GivenBus, node: int) -> Iterator[list[DiscoveredModule]]:
    """Search for a node until the time of a restart is over; yield the result of each search."""
    end = time.monotonic() + RESTART_TIME
    while time.monotonic() < end:
        yield [each for each in survey(line, node)[1] if each.node == node]


# -- ``axisbus gim6010 set-bitrate``: set the bit rate of a module that is alone on its bus ----------------------------


@click.command("set-bitrate")
@click.argument("rate", type=BitRate())
@module_options
def set_bitrate_command(asked: ModuleSelection, rate: int) -> int:
    """Give a module that speaks CAN Simple the bit rate RATE (bit/s), save it, and find it again at that rate.

    Needs its list of endpoints. First the command searches the whole bus (about 10 s). The command refuses if other modules are
    on the bus, because a wrong bit rate would destroy their frames, or if the module is not idle. Saving restarts the module;
    the new rate applies from then on. Over --modbus and --usb there is no search: the rate is that of its CAN interface, which
    need not be connected.
    """
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
    node_id_preconditions.require_no_other_master(finder, found, node)

    def act(module: ModuleParameters) -> None:
        if module.read(BIT_RATE) == rate:
            say(
                f"module {node} already has {rate} bit/s, in RAM; its next start restores the rate of its flash"
            )
        put(module, wanted, save=False)
        say("saving, which restarts it: from now on search for it at the new rate")
        module.save_and_leave()

    code = with_module(asked, act, wanted.over_usb)
    return _found_again(asked, node, rate) if code == OK else code


def _found_again(asked: ModuleSelection, node: int, rate: int) -> int:
    from axisbus.bus.link import socketcan
    from axisbus.bus.link.bitrate_change import OwnRate

    opening, line = opening_of(*asked.line), asked.line
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
        say_next(f"axisbus gim6010 find {bus_words(*line)}")
        return OK
    there = line if opening.own_rate is OwnRate.NONE else line._replace(bitrate=rate)
    if any(each.heartbeat and each.state for found in _searched(there, node) for each in found):
        say(f"module {node} is found at {rate} bit/s")
        return OK
    say_error(
        f"module {node} was saved and restarted, and is not found at {rate} bit/s in {RESTART_TIME:g} s\n"
        f"  remedy:   look for it at either rate: axisbus gim6010 find {bus_words(*there)}; {bus_words(*line)}"
    )
    return FAILURE


# -- ``axisbus gim6010 to-canopen``: switch a module from CAN Simple to CANopen, as far as possible over CAN -----------

_INTERFACE, _CAN = "config.comm_intf_mux", 0


@click.command("to-canopen")
@module_options
def to_canopen_command(asked: ModuleSelection) -> int:
    """Change a module from CAN Simple to CANopen: write the protocol, save, and find it again.

    Needs its list of endpoints, and a module that answers them; for a module that does not, the steps over USB are shown. First
    the command searches the whole bus (about 10 s). It refuses node ID 0, and an ID that is taken or that clashes with another
    module on the bus. Over --modbus and --usb there is no search; if RS485 is the interface of the module, it speaks CANopen
    only after CAN becomes its interface, and the command says so.
    """
    wanted = protocol(CANOPEN)
    steps = (*wanted.over_usb, SEARCH)
    require_list(asked)
    if not asked.over_can:
        with opened(asked) as module:
            node_id_preconditions.require_canopen((), int(module.read(rules.NODE_ID)))
            put(module, wanted, save=True)
            on_can = module.read(_INTERFACE) == _CAN
        say("saved: it speaks CANopen" + ("" if on_can else " once CAN is its interface"))
        say("check first that no other node on that bus has its node ID: axisbus gim6010 find")
        if not on_can:
            say_next(f"axisbus gim6010 params set {_INTERFACE}={_CAN} --save {asked.words}")
        return OK
    node = require_node(asked.node)
    finder, found = survey(asked.line)
    node_id_preconditions.require_one(finder, found, node)
    node_id_preconditions.require_canopen(found, node)

    def act(module: ModuleParameters) -> None:
        put(module, wanted, save=False)
        say("in RAM; saving, which restarts it")
        module.save_and_leave()

    code = with_module(asked, act, steps)
    return _speaks_canopen(asked, node, steps) if code == OK else code


def _speaks_canopen(asked: ModuleSelection, node: int, steps: tuple[str, ...]) -> int:
    """Search the module until it is found in CANopen, or the time is over."""
    protocols: list[str] = []
    for found in _searched(asked.line, node):
        protocols = [each.protocol.value for each in found if each.ours]
        if protocols == ["CANopen"]:
            say(f"node {node} speaks CANopen")
            say_next(f"axisbus init {bus_words(*asked.line)} -o cell.toml")
            return OK
    seen = ", ".join(protocols) or "nothing"
    say_error(
        f"node {node} was saved and restarted, and is not found in CANopen; heard at its node ID: {seen}"
    )
    over_usb(steps)
    return FAILURE


# -- ``axisbus gim6010 to-can-simple``: switch a module from CANopen back to CAN Simple, which no known object does ----


@click.command("to-can-simple")
@line_options
@usb_options
@click.option("--node", type=click.IntRange(0, 127), help="The module's node ID; not with --usb.")
def to_can_simple_command(line: GivenBus, node: int | None, usb: str | None) -> int:
    """Change a module from CANopen back to CAN Simple, over --usb; otherwise show the steps, and write nothing.

    No object of CANopen is known that changes the protocol. Exit code 0 if it already speaks CAN Simple, or does now, 1 if the
    steps are shown, 3 if no module has this node ID.
    """
    wanted = protocol(CAN_SIMPLE)
    if usb is not None:
        put(on_usb(usb), wanted, save=True)
        say("saved: it restarted, and speaks CAN Simple")
        return OK
    node = require_node(node)
    found = [each for each in survey(line, node)[1] if each.ours and node in each.addresses]
    if not found:
        say_error(
            f"no module has the node ID {node}\n  remedy:   list the modules: axisbus gim6010 find {bus_words(*line)}"
        )
        return FAILURE
    if all(each.protocol is ProtocolsFound.CAN_SIMPLE for each in found):
        say(f"node {node} already speaks CAN Simple")
        return OK
    say(f"change node {node} to CAN Simple:")
    over_usb((*wanted.over_usb, SEARCH))
    return WRONG


# -- ``axisbus gim6010 set-id``: set the node ID of a module with CAN Simple -------------------------------------------


@click.command("set-id")
@click.argument("new", type=click.IntRange(0, 63))
@line_options
@modbus_options
@usb_options
@click.option("--node", type=click.IntRange(0, 63), help="The module's present node ID; not with --usb.")
@click.option(
    "--no-save", is_flag=True, help="Leave the new value in RAM: the next start restores the old value."
)
def set_id_command(
    new: int,
    line: GivenBus,
    node: int | None,
    serial: ModbusTarget | None,
    usb: str | None,
    no_save: bool,
) -> int:
    """Give a module that speaks CAN Simple or Modbus RTU (--modbus) the node ID NEW, save it, and check that it comes back.

    First the command searches the whole bus (about 10 s). It refuses if NEW is taken or clashes with a CANopen node, if several
    modules have the old ID, or if the module is not idle. Over --modbus it looks for NEW only, over --usb there is no search.
    Saving restarts the module.
    """
    from axisbus.drives.gim6010.bus.settings_by_message import set_node_id

    if usb is not None:
        return _over_usb(usb, new, save=not no_save)
    if node is None:
        raise click.UsageError("give its present node ID with --node (axisbus gim6010 find shows it)")
    if new == node:
        raise click.UsageError(f"{node} is already its node ID")
    if serial is not None:
        return rename(serial, new, save=not no_save)
    finder, found = survey(line)
    node_id_preconditions.require_one(finder, found, node)
    node_id_preconditions.require_free(finder, found, new)
    told: list[str] = []

    def tell(text: str) -> None:
        told.append(text)
        say(text)

    try:
        with ExitStack() as stack:
            set_node_id(open_bus(stack, *line), node, new, save=not no_save, tell=tell)
    except BaseException:
        if told:
            say_error(
                f"it has node ID {new} in RAM; unless it was saved, it has {node} again after switching it off and on"
            )
        raise
    say_next(f"label it {new}; then axisbus gim6010 find {bus_words(*line)}")
    return OK


def _over_usb(usb: str, new: int, *, save: bool) -> int:
    module = on_usb(usb)
    before = module.node
    module.set_node_id(new)
    say(f"node ID {new} (was {before}), in RAM")
    if save:
        module.save()
        say("saved: it restarted, and has it")
    else:
        say_next(f"save it: axisbus gim6010 set-id {new} {usb_words_of(usb)}")
    say(f"label it {new}; no other node on its bus may have this ID: axisbus gim6010 find")
    return OK
