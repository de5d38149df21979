"""The option of ``axisbus trace`` for modules that speak CAN Simple."""

from __future__ import annotations

from axisbus.cli.shared.plugin_options import TraceOption
from axisbus.drives.gim6010.trace import nodes_of

OPTIONS = (
    TraceOption(
        "--can-simple",
        "can_simple",
        "Node IDs of modules that speak CAN Simple; their frames are decoded as such.",
        "A GIM6010-8 that speaks CAN Simple is decoded when it is named: --can-simple 0,1. A frame does not contain its protocol.",
        nodes_of,
    ),
)
