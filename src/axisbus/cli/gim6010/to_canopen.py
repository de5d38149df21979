"""``axisbus gim6010 to-canopen``: switch a module from CAN Simple to CANopen, as far as possible over CAN."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.discovery import survey
from axisbus.cli.gim6010.params.module import ModuleSelection, module_options, opened, require_list
from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_next

if TYPE_CHECKING:
    from axisbus.drives.gim6010.discovery.results import DiscoveredModule

_PROTOCOL, _CANOPEN = "can.config.protocol", 2
_INTERFACE, _CAN = "config.comm_intf_mux", 0
_BACK = 25.0  # s, the time of a restart as reported by owners


@click.command("to-canopen")
@module_options
def command(asked: ModuleSelection) -> int:
    """Change a module from CAN Simple to CANopen: write the protocol, save, and find it again.

    Needs its list of endpoints, and a module that answers them; for a module that does not, the steps over USB are shown. First
    the command searches the whole bus (some 10 s). It refuses node ID 0, and an ID that is taken or that clashes with another
    module on the bus. Over --modbus and --usb there is no search; if RS485 is the interface of the module, it speaks CANopen
    only after CAN becomes its interface, and the command says so.
    """
    from axisbus.drives.gim6010 import node_id_preconditions
    from axisbus.errors import NodeError

    node = asked.node
    require_list(asked)
    if not asked.over_can:
        return _by_another_way(asked)
    if node is None:
        raise click.UsageError("give the module's node ID with --node (axisbus gim6010 find shows it)")
    finder, found = survey(asked.line)
    node_id_preconditions.require_one(finder, found, node)
    node_id_preconditions.require_canopen(found, node)
    try:
        with opened(asked) as module:
            module.write(_PROTOCOL, _CANOPEN, by_name=True)
            say(f"{_PROTOCOL} = {_CANOPEN}, in RAM; saving, which restarts it")
            module.save_and_leave()
    except NodeError as error:
        say_error(str(error))
        _over_usb()
        return FAILURE
    return _verify(asked, node)


def _by_another_way(asked: ModuleSelection) -> int:
    from axisbus.cli.gim6010.settings.common import put
    from axisbus.drives.gim6010 import node_id_preconditions
    from axisbus.drives.gim6010.parameters import rules
    from axisbus.drives.gim6010.settings.parameter_batch import ParameterBatch

    with opened(asked) as module:
        node_id_preconditions.require_canopen((), int(module.read(rules.NODE_ID)))
        put(module, ParameterBatch(((_PROTOCOL, _CANOPEN),)), save=True)
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
    _over_usb()
    return FAILURE


def _over_usb() -> None:
    from axisbus.drives.gim6010.discovery.results import ProtocolsFound
    from axisbus.drives.gim6010.node_id_preconditions import OVER_USB

    say("do this over USB:")
    for step in OVER_USB[ProtocolsFound.CANOPEN]:
        say(f"  {step}")
