"""Adapters with a listen-only mode, in which even their controller sends nothing, and python-can's options for that mode."""

from __future__ import annotations

from collections.abc import Mapping

import can

from axisbus.bus.link.interfaces import NO_RATE

# Interfaces whose controller then neither acknowledges nor sends error flags, by python-can 4.6's own options. The table omits
# interfaces whose mode is a property of the controller, which another program on this computer may be using: kvaser, nixnet, and
# socketcan, where it belongs to the link (ip link set can0 type can listen-only on).
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
    """Return the options with listen-only mode added; the user's options have priority."""
    return {**_SILENT.get(interface, {}), **options}


def can_be_silent(interface: str) -> bool:
    """Whether the adapter's controller can be set to send neither acknowledgements nor error flags."""
    return interface in _SILENT


def forced(interface: str, options: Mapping[str, object]) -> dict[str, object]:
    """Return the options with listen-only mode set, overriding the user's."""
    return {**options, **_SILENT[interface]}


def manner(interface: str) -> str:
    """Return a text on the adapter's behaviour while axisbus only listens."""
    if interface in _SILENT:
        return "the adapter is in listen-only mode: it does not even acknowledge"
    if interface in _WIRELESS:
        return "we send nothing"
    return "this program sends nothing; the adapter acknowledges frames, as every node does"
