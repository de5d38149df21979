"""``axisbus bridge zenoh``: a cell on a Zenoh network, for a fleet."""

from __future__ import annotations

import signal
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from axisbus.check.run import checked
from axisbus.cli.bridge.ros_options import RECEIVES, ros_of, ros_options
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.paths import PATH
from axisbus.errors import StateError
from axisbus.fleet import network
from axisbus.fleet.keys import ZenohCellKeys, named
from axisbus.fleet.network import ZenohNetwork

_RECEIVES = 64 * 1024  # bytes of a message to a cell: its queries are short
_CONNECTED = 2.0  # seconds for connections, over which another bridge of the same name would be found


@click.command("zenoh")
@click.argument("cell", type=PATH)
@click.option(
    "--plant", required=True, metavar="NAME", help="The name of the plant, with which all its keys begin."
)
@click.option(
    "--cell", "name", metavar="NAME", help="The cell's name in the plant; that of its file, if not given."
)
@click.option(
    "--connect",
    multiple=True,
    metavar="ENDPOINT",
    help="An endpoint to connect to, such as tcp/10.0.0.5:7447.",
)
@click.option(
    "--listen",
    multiple=True,
    metavar="ENDPOINT",
    help="The endpoint at which others may connect, such as tcp/10.0.0.7:7447.",
)
@click.option("--scouting", is_flag=True, help="Also find others, and be found, by multicast and by gossip.")
@click.option("--config", type=PATH, help="A configuration of Zenoh (JSON5), for TLS and access rules.")
@click.option(
    "--recordings", type=PATH, help="A folder with recordings that clients may read over the network."
)
@ros_options
def command(
    cell: Path,
    plant: str,
    name: str | None,
    connect: tuple[str, ...],
    listen: tuple[str, ...],
    scouting: bool,
    config: Path | None,
    recordings: Path | None,
    **ros: Any,
) -> int:
    """Join the machine of CELL to a Zenoh network: state, events, commands under a lease, objects, recordings.

    It joins the running machine. If no machine is running, or when the machine ends, it waits for the next one. The holder of
    the lease has control of the machine; if the lease is lost, the axes that were moved under it halt. Ctrl-C ends the bridge.
    """
    network.require_zenoh()
    keys = ZenohCellKeys(named("the plant", plant), named("the cell", cell.stem if name is None else name))
    joints = ros_of(**ros)
    wanted = ZenohNetwork(connect, listen, scouting, config, _RECEIVES if joints is None else RECEIVES)
    network.require_reachable(wanted)
    checked(cell)
    if recordings is not None and not recordings.is_dir():
        raise StateError(
            f"{recordings} is not a folder", remedy="name the folder that contains the recordings"
        )
    with ExitStack() as stack:
        session = network.opened(wanted)
        stack.callback(session.close)
        signal.signal(signal.SIGTERM, _leave)
        if connect:
            network.connected(session, _CONNECTED)
        from axisbus.gateway.zenoh.bridge import Bridge, Cell

        bridge = Bridge(session, Cell(cell, keys, recordings, joints), say)
        stack.callback(bridge.close)
        say(f"on the network as {keys.base}")
        bridge.run()
    return OK


def _leave(_number: int, _frame: object) -> None:
    sys.exit(143)  # unwinds all declarations, as Ctrl-C does
