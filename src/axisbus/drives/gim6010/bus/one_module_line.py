"""A serial line with one module, outside any cell: open it as a channel, and stop the module, whichever program enabled it."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.bus.stop_modules import stop_modules
from axisbus.drives.gim6010.can_simple.port.settings import HEARTBEAT_BY_LINE, ModuleSettings
from axisbus.drives.gim6010.modbus.can_emulation import Listed
from axisbus.errors import DriveError

_INTERFACE = "modbus"
_HIGHEST = 63  # node ID of CAN Simple
_FASTEST = 1000.0  # turns/s, which no rotor reaches
_ANY = 1.0  # limits and ramps, which a stop does not send


def channel_node(device: int) -> int:
    """Return the node ID of a device (1 to 247) on its channel: its own one if CAN Simple has it."""
    return device if device <= _HIGHEST else _HIGHEST


def open_line(
    port: str,
    device: int,
    *,
    rate: int,
    parity: str,
    listed: Listed | None = None,
    calibrates: bool = False,
) -> Channel:
    """Open a port as the channel of one module; ``parity`` is none, even or odd, ``listed`` and ``calibrates`` as for ``Relay``.

    Raises:
        UserError: the extra is not installed. AdapterError: the port cannot be opened.
    """
    node = channel_node(device)
    return Channel.open(
        _INTERFACE,
        port,
        rate,
        parity=parity,
        modules={node: listed},
        devices={node: device},
        calibrates=calibrates,
    )


def stop_on_line(
    channel: Channel, device: int, *, tell: Callable[[str], None], impatience: Callable[[], int]
) -> None:
    """Stop the module: velocity 0 on its own ramp, idle, emergency stop, until standstill without power was seen; blocks.

    A module in idle gets nothing; a module that does not answer gets the requests of every step. Each time that ``impatience()``
    grows, the next step begins. ``tell`` is called with the outcome.

    Raises:
        DriveError: it is not confirmed as stopped.
    """
    settings = ModuleSettings(
        channel_node(device), _FASTEST, _ANY, _ANY, _ANY, _ANY, heartbeat=HEARTBEAT_BY_LINE, relayed=True
    )
    (found,) = stop_modules(channel, {"module": settings}, alone=True, impatience=impatience)
    if not found.ok:
        raise DriveError(
            f"module {device}: {found.text}",
            remedy="first look at the machine; if it turns, switch its supply off",
        )
    tell(f"module {device}: {found.text}")
