"""The options of ``axisbus bridge zenoh`` that offer a machine in ROS 2."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from axisbus.errors import ArgumentError
from axisbus.optional_dependencies import require

if TYPE_CHECKING:
    from axisbus.gateway.ros.node import RosOptions

RECEIVES = 2 * 1024 * 1024  # bytes of a message: a trajectory may have many points
_OPTIONS = (
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
        help="The domain ID of ROS 2; if not given, that of ROS_DOMAIN_ID, else 0.",
    ),
    click.option(
        "--ros-namespace", metavar="NAME", help="The beginning of the names of topics and nodes of ROS 2."
    ),
    click.option(
        "--ros-rate",
        type=click.FloatRange(1.0, 200.0),
        help="Joint states per second, at most; 50 if not given.",
    ),
)
Words = dict[str, Any]


def ros_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --ros and its options."""
    for decorate in reversed(_OPTIONS):
        function = decorate(function)
    return function


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
