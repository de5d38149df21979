"""``axisbus bridge zenoh``: a cell on a Zenoh network, for a fleet."""

from __future__ import annotations

import signal
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from axisbus.check.run import checked
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.options import PATH, together
from axisbus.errors import ArgumentError, StateError
from axisbus.fleet import network
from axisbus.fleet.keys import ZenohCellKeys, named
from axisbus.fleet.network import ZenohNetwork
from axisbus.optional_dependencies import require

if TYPE_CHECKING:
    from axisbus.gateway.ros.node import RosOptions


_RECEIVES = 64 * 1024  # bytes of a message to a cell: its queries are short
_CONNECTED = 2.0  # seconds for connections, over which another bridge of the same name would be found


# -- The options of ``axisbus bridge zenoh`` that offer a machine in ROS 2 ---------------------------------------------


RECEIVES = 2 * 1024 * 1024  # bytes of a message: a trajectory may have many points
ros_options = together(
    click.option("--ros", is_flag=True, help="Also publish the axes as joints of ROS 2, as rmw_zenoh does."),
    click.option(
        "--ros-command",
        is_flag=True,
        help="Also follow the joint trajectories that ROS 2 sends: MOVES axes that are enabled.",
    ),
    click.option(
        "--ros-domain",
        type=click.IntRange(0, 232),
        envvar="ROS_DOMAIN_ID",
        help="The domain ID of ROS 2 [default: ROS_DOMAIN_ID, otherwise 0].",
    ),
    click.option("--ros-namespace", metavar="NAME", help="Namespace of the topics and nodes of ROS 2."),
    click.option(
        "--ros-rate",
        type=click.FloatRange(1.0, 200.0),
        help="The highest number of joint states per second [default: 50].",
    ),
)


def ros_of(
    *,
    ros: bool,
    ros_command: bool,
    ros_domain: int | None,
    ros_namespace: str | None,
    ros_rate: float | None,
) -> RosOptions | None:
    """Return the options for ROS 2; None if ROS 2 is not requested.

    Raises:
        ArgumentError: options of ROS 2 are given without --ros, or a namespace is invalid.
        UserError: the packages are not installed.
    """
    if not ros:
        if ros_command or ros_namespace is not None or ros_rate is not None:
            raise ArgumentError("options of ROS 2 are given without --ros", remedy="add --ros")
        return None
    require("rosbags", "ROS 2 needs rosbags", "ros")
    from axisbus.gateway.ros.names import namespace_of
    from axisbus.gateway.ros.node import RosOptions

    namespace = namespace_of(ros_namespace or "/")
    return RosOptions(ros_domain or 0, namespace, 50.0 if ros_rate is None else ros_rate, ros_command)


# -- The command -------------------------------------------------------------------------------------------------------


@click.command("zenoh")
@click.argument("cell", type=PATH)
@click.option(
    "--plant", required=True, metavar="NAME", help="The name of the plant, with which all its keys begin."
)
@click.option(
    "--cell",
    "name",
    metavar="NAME",
    help="The cell's name in the plant [default: the name of its file without .toml].",
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
    the lease has control of the machine; if the lease is lost, the axes that the holder has set in motion halt. Ctrl-C ends the
    bridge.
    """
    network.require_zenoh()
    keys = ZenohCellKeys(named("the plant", plant), named("the cell", cell.stem if name is None else name))
    joints = ros_of(**ros)
    network_options = ZenohNetwork(
        connect, listen, scouting, config, _RECEIVES if joints is None else RECEIVES
    )
    network.require_reachable(network_options)
    checked(cell)
    if recordings is not None and not recordings.is_dir():
        raise StateError(
            f"{recordings} is not a folder", remedy="name the folder that contains the recordings"
        )
    with ExitStack() as stack:
        session = network.opened(network_options)
        stack.callback(session.close)
        signal.signal(signal.SIGTERM, _raise_interrupt)
        if connect:
            network.connected(session, _CONNECTED)
        from axisbus.gateway.zenoh.bridge import Bridge, Cell

        bridge = Bridge(session, Cell(cell, keys, recordings, joints), say)
        stack.callback(bridge.close)
        say(f"on the network as {keys.base}")
        bridge.run()
    return OK


def _raise_interrupt(_number: int, _frame: object) -> None:
    sys.exit(143)  # unwinds all declarations, as Ctrl-C does
