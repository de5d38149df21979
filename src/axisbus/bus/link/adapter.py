"""Open a CAN adapter through python-can, with errors that contain a remedy."""

from __future__ import annotations

import difflib
import errno
import sys
from collections.abc import Callable, Mapping

import can
from can.interfaces import VALID_INTERFACES

from axisbus.bus.link import socketcan
from axisbus.bus.link.interfaces import NO_RATE, RATE_ELSEWHERE, sets_rate
from axisbus.drives import registry
from axisbus.errors import AdapterError, ArgumentError, AxisbusError, PlatformError

# What an interface needs in addition to python-can.
_INSTALLATION: Mapping[str, str] = {
    "canalystii": 'pip install "python-can[canalystii]"',
    "cantact": 'pip install "python-can[cantact]"',
    "etas": "install ETAS BOA",
    "gs_usb": 'pip install "python-can[gs-usb]"; on Linux rather the kernel\'s driver: interface = "socketcan"',
    "ixxat": "install HMS/Ixxat's VCI driver (Windows) or ECI driver (Linux)",
    "kvaser": "install Kvaser's CANlib (Linux: linuxcan) driver",
    "neovi": 'pip install "python-can[neovi]"',
    "pcan": "install PEAK's PCAN-Basic (Linux: the libpcanbasic library)",
    "robotell": "pip install pyserial",
    "seeedstudio": "pip install pyserial",
    "serial": "pip install pyserial",
    "slcan": "pip install pyserial",
    "systec": "install SYS TEC's driver package",
    "udp_multicast": 'pip install "python-can[multicast]"',
    "vector": "install Vector's XL driver library",
}


# Interfaces over a serial line: without a time-out of its own a write may block for ever.
_SERIAL_SEND_TIMEOUT = {"slcan": 0.05, "robotell": 0.05}


def send_timeout(interface: str) -> float | None:
    """Return the time-out in seconds for python-can's ``send``; None if a time-out would make it wait for the transmission."""
    return _SERIAL_SEND_TIMEOUT.get(interface)


def open_adapter(
    interface: str,
    channel: str | int | None,
    bitrate: int | None,
    options: Mapping[str, object],
    link: Callable[[str], socketcan.CanInterface | None] = socketcan.link,
) -> can.BusABC:
    """Open the adapter; may block as long as its driver does (about a second).

    Args:
        interface: python-can's name of the adapter type, such as ``socketcan`` or ``pcan``.
        channel: the adapter's channel in python-can's notation, such as ``can0``.
        bitrate: bit/s; None if the link sets it.
        options: further options of the adapter.
        link: how to get a SocketCAN link from Linux.

    Raises:
        AdapterError: unknown interface, driver or package missing, no such channel, link down, bitrate missing or different.
        PlatformError: SocketCAN elsewhere than on Linux.
    """
    check_interface(interface)
    if interface == "socketcan":
        _require_linux()
        check_link(str(channel or ""), bitrate, link)
    elif bitrate is None and sets_rate(interface, options):
        raise AdapterError(
            f"no bitrate given for the CAN interface {interface!r}",
            remedy="write the bus's rate, such as bitrate = 1_000_000, in [bus]; all nodes of a bus share one rate",
        )
    return _construct(interface, channel, bitrate, dict(options))


def interfaces() -> list[str]:
    """Return the names of all interfaces: those of python-can and of drive plug-ins."""
    return sorted([*VALID_INTERFACES, *registry.interfaces()])


def check_interface(interface: str) -> None:
    """Check that an interface exists.

    Raises:
        AdapterError: it does not; the remedy names the nearest ones.
    """
    if interface in VALID_INTERFACES or interface in registry.interfaces():
        return
    near = difflib.get_close_matches(interface.lower(), interfaces(), n=3, cutoff=0.5)
    raise AdapterError(
        f"CAN interface {interface!r} is not known to python-can",
        observed=f"the known interfaces are {', '.join(interfaces())}",
        remedy=f"did you mean {' or '.join(repr(name) for name in near)}?" if near else "choose one of these",
    )


def _require_linux() -> None:
    if sys.platform != "linux":
        raise PlatformError(
            "SocketCAN is a part of Linux, which this system does not have",
            observed=f"this system is {sys.platform}",
            remedy="write the interface of python-can for your adapter in [bus], such as pcan, kvaser, ixxat or slcan",
        )


def check_link(
    name: str, bitrate: int | None, find_link: Callable[[str], socketcan.CanInterface | None]
) -> None:
    """Check that the SocketCAN link exists, is up, and runs at ``bitrate`` (None: any rate).

    Raises:
        AdapterError: it does not.
    """
    found = find_link(name)
    if found is None:
        others = socketcan.links()
        raise AdapterError(
            f"there is no CAN interface {name!r} on this computer",
            observed=f"there are {', '.join(others)}" if others else "there is no CAN interface at all",
            remedy="plug the adapter in and load its driver; for a virtual one: "
            + socketcan.up_command("vcan0", None),
        )
    if not found.up:
        raise AdapterError(
            f"the CAN interface {name!r} is down", remedy=socketcan.up_command(name, bitrate or found.bitrate)
        )
    if bitrate is not None and found.bitrate is not None and found.bitrate != bitrate:
        raise AdapterError(
            f"the CAN interface {name!r} runs at {found.bitrate} bit/s, but {bitrate} is configured",
            observed=f"ip -details link show {name}: bitrate {found.bitrate}",
            remedy=f"set the link: {socketcan.change_command(name, bitrate)}; or correct bitrate in [bus]",
        )


def _construct(
    interface: str, channel: str | int | None, bitrate: int | None, options: dict[str, object]
) -> can.BusABC:
    arguments: dict[str, object] = dict(options)
    # The master's own frames would look like those of another master.
    arguments.pop("receive_own_messages", None)
    if bitrate is not None and interface not in RATE_ELSEWHERE:
        arguments["bitrate"] = bitrate
    try:
        if interface == "socketcand":
            from axisbus.bus.link.socketcand import SocketcandBus

            return SocketcandBus(channel, **arguments)  # type: ignore[arg-type]
        own = registry.interfaces().get(interface)
        if own is not None:
            opened: can.BusABC = registry.load(own)(str(channel), **arguments)
            return opened
        return can.Bus(interface=interface, channel=channel, ignore_config=True, **arguments)  # type: ignore[arg-type]
    except TypeError as error:
        raise ArgumentError(
            f"the CAN interface {interface!r} does not accept these options: {', '.join(map(str, options)) or 'none'}",
            observed=str(error),
            remedy="see python-can's manual for the options of this interface ([bus.options])",
        ) from error
    except AxisbusError:  # of axisbus, with its own remedy
        raise
    except Exception as error:  # drivers raise anything, NameError included
        raise _cannot_open(interface, channel, error) from error


def _cannot_open(interface: str, channel: str | int | None, error: Exception) -> AdapterError:
    return AdapterError(
        f"the CAN adapter {interface}:{channel} cannot be opened",
        observed=f"{type(error).__name__}: {error}",
        remedy=_remedy(interface, error),
    )


def _remedy(interface: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if isinstance(error, PermissionError) or number in (errno.EACCES, errno.EPERM):
        return "your user may not use the device: join the group that owns it (often 'dialout'), or add a udev rule"
    if interface == "socketcan" and number == errno.EAFNOSUPPORT:
        return "this kernel has no CAN support loaded: sudo modprobe can_raw"
    if interface == "socketcand":
        return "check host and port in [bus.options], and whether the server runs; simulated drives: axisbus sim CELL"
    if isinstance(error, (can.CanInterfaceNotImplementedError, ImportError, NameError)) or "library" in str(
        error
    ):
        return _INSTALLATION.get(interface, "install the adapter's driver and its Python package")
    return "check that the adapter is plugged in, that no other program uses it, and the name of the channel"


# ----------------------------------------------------------------------------------------------------------------------
# Adapters with a listen-only mode, in which even their controller sends nothing, and python-can's options for that mode.


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
_WITHOUT_WIRE = NO_RATE | {"sim"}


def silent(interface: str, options: Mapping[str, object]) -> dict[str, object]:
    """Return the options with listen-only mode added; the user's options have priority."""
    return {**_SILENT.get(interface, {}), **options}


def can_be_silent(interface: str) -> bool:
    """Whether the adapter's controller can be set to send neither acknowledgements nor error flags."""
    return interface in _SILENT


def forced(interface: str, options: Mapping[str, object]) -> dict[str, object]:
    """Return the options with listen-only mode set, overriding the user's."""
    return {**options, **_SILENT[interface]}


def listening_text(interface: str) -> str:
    """Return a text on the adapter's behaviour while axisbus only listens."""
    if interface in _SILENT:
        return "the adapter is in listen-only mode: it does not even acknowledge"
    if interface in _WITHOUT_WIRE:
        return "we send nothing"
    return "this program sends nothing; the adapter acknowledges frames, as every node does"
