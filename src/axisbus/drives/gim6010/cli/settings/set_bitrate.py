"""``axisbus gim6010 set-bitrate``: set the bit rate of a module that is alone on its bus."""

from __future__ import annotations

import time

import click

from axisbus.cli.shared.buses import opening_of
from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_next
from axisbus.cli.shared.options import BitRate
from axisbus.drives.gim6010.cli.discovery import BusOptions, require_node, survey
from axisbus.drives.gim6010.cli.params.module import ModuleSelection, module_options, opened, require_list
from axisbus.drives.gim6010.cli.settings.common import over_usb, put
from axisbus.errors import NodeError

_BACK = 25.0  # s, the time of a restart as reported by owners


@click.command("set-bitrate")
@click.argument("rate", type=BitRate())
@module_options
def command(asked: ModuleSelection, rate: int) -> int:
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
