"""The ranges of MIT control, read from a module over CAN Simple."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from axisbus.bus.gim6010.can_simple_client import SimpleLine
from axisbus.bus.gim6010.endpoints import CanSimpleParameters
from axisbus.bus.link import ownership
from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.can_simple.endpoints import parse
from axisbus.drives.gim6010.can_simple.mit import MitRanges
from axisbus.drives.gim6010.can_simple.verified_endpoints import Firmware
from axisbus.drives.gim6010.mit_control.settings import ranges_of
from axisbus.errors import UserError


def read_mit_ranges(
    interface: str,
    channel: str,
    node: int,
    endpoints: str | Path,
    *,
    made_for: str,
    bitrate: int | None = None,
    **options: object,
) -> MitRanges:
    """Return the ranges of the module with this node-ID (0 to 63). Blocks about 2 s; commands nothing.

    ``endpoints`` is the vendor's list for exactly its firmware, ``made_for`` the firmware version of the list, as "0.6.0".

    Raises:
        UserError: the list cannot be read. ArgumentError: it is not such a list, or does not fit the module.
        SecondMasterError: another program of axisbus has the channel. AdapterError: it cannot be opened.
        NodeError: the module answers no endpoint, or several have this node-ID.
    """
    try:
        text = Path(endpoints).read_bytes()
    except OSError as error:
        raise UserError(f"{endpoints} cannot be read", observed=str(error.strerror)) from error
    listed, version = parse(text, str(endpoints)), Firmware.parse(made_for)
    with ExitStack() as stack:
        lock = ownership.take(interface, channel)
        if lock is not None:
            stack.enter_context(lock)
        line = SimpleLine(stack.enter_context(Channel.open(interface, channel, bitrate, **options)), node)
        module = CanSimpleParameters(line)
        stack.enter_context(line)
        module.open(listed, version)
        return ranges_of(module)
