"""Which adapters can be opened so that not even their controller says anything, and how python-can is told so."""

from __future__ import annotations

from collections.abc import Mapping

import can

from axisbus.bus.link.interfaces import NO_RATE

# Interfaces whose controller then acknowledges nothing and sends no error flag either, by python-can 4.6's own options. Left out
# are those where it is a property of the controller, which another program on this computer may be using: kvaser, nixnet, and
# socketcan, where it is one of the link (ip link set can0 type can listen-only on).
_SILENT: Mapping[str, Mapping[str, object]] = {
    "cantact": {"monitor": True},
    "pcan": {"state": can.BusState.PASSIVE},
    "seeedstudio": {"operation_mode": "silent"},
    "slcan": {"listen_only": True},
    "systec": {"state": can.BusState.PASSIVE},
    "vector": {"listen_only": True},
}
_WIRELESS = NO_RATE | {"sim"}


def silent(interface: str, options: Mapping[str, object]) -> dict[str, object]:
    """Return the options with what makes the adapter listen-only; what the user has written stays."""
    return {**_SILENT.get(interface, {}), **options}


def can_be_silent(interface: str) -> bool:
    """Whether the adapter's controller can be asked to acknowledge nothing and flag nothing."""
    return interface in _SILENT


def forced(interface: str, options: Mapping[str, object]) -> dict[str, object]:
    """Return the options with what makes the adapter listen-only, whatever they said of it."""
    return {**options, **_SILENT[interface]}


def manner(interface: str) -> str:
    """Say what the adapter does while we only listen."""
    if interface in _SILENT:
        return "the adapter is in listen-only mode: it does not even acknowledge"
    if interface in _WIRELESS:
        return "we send nothing"
    return "we send nothing; the adapter acknowledges frames, as every node does"
