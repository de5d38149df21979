"""``axisbus gim6010 to-canopen`` and ``to-can-simple``: switch the protocol of a module."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_next
from axisbus.drives.gim6010.cli.discovery import BusOptions, line_options, require_node, survey
from axisbus.drives.gim6010.cli.params.module import ModuleSelection, module_options, opened, require_list
from axisbus.drives.gim6010.cli.ports import on_usb, usb_options
from axisbus.drives.gim6010.cli.settings.common import over_usb, put
from axisbus.errors import NodeError

if TYPE_CHECKING:
    from axisbus.drives.gim6010.discovery.results import DiscoveredModule


# -- ``axisbus gim6010 to-canopen``: switch a module from CAN Simple to CANopen, as far as possible over CAN -----------

_INTERFACE, _CAN = "config.comm_intf_mux", 0
_BACK = 25.0  # s, the time of a restart as reported by owners


@click.command("to-canopen")
@module_options
def to_canopen_command(asked: ModuleSelection) -> int:
    """Change a module from CAN Simple to CANopen: write the protocol, save, and find it again.

    Needs its list of endpoints, and a module that answers them; for a module that does not, the steps over USB are shown. First
    the command searches the whole bus (about 10 s). It refuses node ID 0, and an ID that is taken or that clashes with another
    module on the bus. Over --modbus and --usb there is no search; if RS485 is the interface of the module, it speaks CANopen
    only after CAN becomes its interface, and the command says so.
    """
    from axisbus.drives.gim6010 import node_id_preconditions
    from axisbus.drives.gim6010.settings.parameter_settings import CANOPEN, PROTOCOL

    require_list(asked)
    if not asked.over_can:
        return _by_another_way(asked)
    node = require_node(asked.node)
    finder, found = survey(asked.line)
    node_id_preconditions.require_one(finder, found, node)
    node_id_preconditions.require_canopen(found, node)
    try:
        with opened(asked) as module:
            module.write(PROTOCOL, CANOPEN, by_name=True)
            say(f"{PROTOCOL} = {CANOPEN}, in RAM; saving, which restarts it")
            module.save_and_leave()
    except NodeError as error:
        say_error(str(error))
        _to_canopen_over_usb()
        return FAILURE
    return _verify(asked, node)


def _by_another_way(asked: ModuleSelection) -> int:
    from axisbus.drives.gim6010 import node_id_preconditions
    from axisbus.drives.gim6010.parameters import rules
    from axisbus.drives.gim6010.settings.parameter_settings import CANOPEN, protocol

    with opened(asked) as module:
        node_id_preconditions.require_canopen((), int(module.read(rules.NODE_ID)))
        put(module, protocol(CANOPEN), save=True)
        on_can = module.read(_INTERFACE) == _CAN
    say("saved: it speaks CANopen" + ("" if on_can else " once CAN is its interface"))
    say("check first that no other node on that bus has its node ID: axisbus gim6010 find")
    if not on_can:
        say_next(f"axisbus gim6010 params set {_INTERFACE}={_CAN} --save {asked.words}")
    return OK


def _verify(asked: ModuleSelection, node: int) -> int:
    """Search the module until it is found in CANopen, or the time is over."""
    end = time.monotonic() + _BACK
    found: list[DiscoveredModule] = []
    while time.monotonic() < end:
        found = [each for each in survey(asked.line, node)[1] if each.node == node and each.ours]
        if [each.protocol.value for each in found] == ["CANopen"]:
            say(f"node {node} speaks CANopen")
            say_next(f"axisbus init {asked.line.words} -o cell.toml")
            return OK
    seen = ", ".join(each.protocol.value for each in found) or "nothing"
    say_error(
        f"node {node} was saved and restarted, and is not found in CANopen; heard at its node ID: {seen}"
    )
    _to_canopen_over_usb()
    return FAILURE


def _to_canopen_over_usb() -> None:
    from axisbus.drives.gim6010.settings.parameter_settings import CANOPEN, SEARCH, protocol

    over_usb((*protocol(CANOPEN).over_usb, SEARCH))


# -- ``axisbus gim6010 to-can-simple``: switch a module from CANopen back to CAN Simple, which no known object does ----


@click.command("to-can-simple")
@line_options
@usb_options
@click.option("--node", type=click.IntRange(0, 127), help="The module's node ID; not with --usb.")
def to_can_simple_command(line: BusOptions, node: int | None, usb: str | None) -> int:
    """Change a module from CANopen back to CAN Simple, over --usb; otherwise show the steps, and write nothing.

    No object of CANopen is known that changes the protocol. Exit code 0 if it already speaks CAN Simple, or does now, 1 if the
    steps are shown, 3 if no module has this node ID.
    """
    from axisbus.drives.gim6010.discovery.results import ProtocolsFound
    from axisbus.drives.gim6010.settings.parameter_settings import CAN_SIMPLE, SEARCH, protocol

    wanted = protocol(CAN_SIMPLE)
    if usb is not None:
        with on_usb(usb) as module:
            put(module, wanted, save=True)
        say("saved: it restarted, and speaks CAN Simple")
        return OK
    node = require_node(node)
    found = [each for each in survey(line, node)[1] if each.ours and node in each.addresses]
    if not found:
        say_error(
            f"no module has the node ID {node}\n  remedy:   list the modules: axisbus gim6010 find {line.words}"
        )
        return FAILURE
    if all(each.protocol is ProtocolsFound.CAN_SIMPLE for each in found):
        say(f"node {node} already speaks CAN Simple")
        return OK
    say(f"change node {node} to CAN Simple:")
    over_usb((*wanted.over_usb, SEARCH))
    return WRONG
