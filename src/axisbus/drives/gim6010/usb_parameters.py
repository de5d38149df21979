"""Parameters of a module by its object tree on USB; implements ``ModuleParameters``.

Theory of operation
-------------------
No endpoint list is needed: the module provides its own, which always fits its firmware, and a path is accessed by its name. Only
two functions are called: saving, which restarts the module, and clearing errors. After a restart the module is found by its serial
number, and all written values are read again. The port is used by the package ``odrive``, the maker's commissioning tool (manual
v2.2, 3.1).
"""

from __future__ import annotations

import functools
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.endpoints import (
    VERSION_ENDPOINTS,
    Endpoint,
    EndpointList,
    Firmware,
    found_in,
    parse,
)
from axisbus.drives.gim6010.can_simple.identifier import require_node
from axisbus.drives.gim6010.make import RESTART_BEGINS, RESTART_TIME
from axisbus.drives.gim6010.parameters import rules
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.errors import AdapterError, NodeError, NodeTimeout, StateError, UserError

FIND = 10.0  # s to find a connected module
ALONE = 1.0  # s to find a second one
_LIST = "_dev"  # attribute of odrive's objects with the device data; there is no public one


def connect(serial: str | None) -> UsbParameters:
    """Find the module on USB, with this serial number (hexadecimal, as odrive shows it) if several are connected; blocks.

    Raises:
        UserError: the extra ``usb`` is not installed. NodeTimeout: it was not found within ``FIND``.
        AdapterError: USB cannot be used. StateError: there are several, and no serial number was given.
    """
    odrive, lost = _library()

    def find(wanted: str | None, limit: float) -> Any:
        try:
            return odrive.find_sync(serial_number=wanted, timeout=limit)
        except TimeoutError:
            raise NodeTimeout(
                f"no module {'' if wanted is None else f'of serial number {wanted} '}was found on USB",
                node=0,
                observed=f"searched for {limit:g} s",
                remedy="switch its supply on and plug its USB cable in; on Linux this user needs a udev rule (odrivetool prints "
                "it), and no other program may use it, such as odrivetool",
            ) from None
        except Exception as error:  # its driver raises any type, for example if another program uses the port
            raise AdapterError(
                "USB cannot be used",
                observed=f"{type(error).__name__}: {error}",
                remedy="end other programs that have the module, such as odrivetool; see that odrive has its library for this "
                "computer",
            ) from error

    found = find(serial, FIND)
    if serial is None:
        _require_alone(odrive)
    return UsbParameters(found, find, lost)


def _require_alone(odrive: Any) -> None:
    """Check that no second module is connected, since no serial number selects one."""
    try:
        several = odrive.find_sync(count=2, timeout=ALONE)
    except TimeoutError:
        return
    raise StateError(
        "several modules are on USB, and none of them is selected",
        observed="serial numbers " + ", ".join(str(getattr(each, _LIST).serial_number) for each in several),
        remedy="give --serial with one of these, or connect one alone",
    )


def _library() -> tuple[Any, tuple[type[Exception], ...]]:
    try:
        import odrive
        from odrive.libodrive import TransportException
    except ImportError as error:
        raise UserError(
            "a module on USB needs the package odrive, which is not installed",
            observed=str(error),
            remedy='install it: pip install "axisbus[usb]"',
        ) from error
    return odrive, (odrive.DeviceLostException, TransportException)


SOURCE = "the module's own list"
_STATE = "axis0.current_state"
_SAVE, _CLEAR = "save_configuration", "clear_errors"
_LOOK = 0.05
_WIDEST = 8  # bytes of a value


class UsbParameters(ModuleParameters):
    """``ModuleParameters`` of one module on USB; holds its tree. Use it from one thread only."""

    widest = _WIDEST
    remedies = (
        "the module limits this value, or does not accept it",
        "write it again, and check whether the value remains after switching the module off and on",
    )

    def __init__(
        self, found: Any, find: Callable[[str, float], Any], gone: tuple[type[Exception], ...]
    ) -> None:
        """Prepare; nothing is read before ``open``. ``found`` is odrive's object tree of the module.

        ``find`` searches a serial number for so many seconds; ``gone`` are odrive's exceptions for a lost device.
        """
        super().__init__()
        self._find = find
        self._gone = gone
        self._found = found
        self.node = 0  # on CAN and RS485
        self._serial_number = str(self._device.serial_number)
        self.serial = int(self._serial_number, 16)
        self._own: EndpointList | None = None

    def open(self) -> None:
        """Read its list, version and node ID; blocks.

        Raises:
            NodeError: it does not report them. ArgumentError: its list is invalid.
        """
        nodes = [{**member, "name": path} for path, member in self._device.flat_json.items()]
        self._own = parse(json.dumps(nodes), SOURCE)
        self.firmware = Firmware(*(int(self.read(path)) for path in VERSION_ENDPOINTS))
        self.node = int(self.read(rules.NODE_ID))

    @property
    def name(self) -> str:
        """The module in messages, by its serial number."""
        return f"module {self.serial:X}h on USB"

    @property
    def listed(self) -> EndpointList:
        if self._own is None:
            raise StateError("the list of the module was not read", remedy="open it first")
        return self._own

    def set_node_id(self, new: int) -> None:
        """Change its node ID (0 to 63) in RAM and read it back; blocks. Does not check other nodes. Raises as ``write``."""
        require_node(new)
        self.node = int(self._put(self.endpoint(rules.NODE_ID), new))

    def _fetch(self, endpoint: Endpoint) -> Value:
        with self._there():
            found = getattr(*self._at(endpoint.path))
        if isinstance(found, bool | int | float):
            return found
        raise NodeError(
            f"{self.name}: {endpoint.path} was reported as {found!r}, which is not a number", node=self.node
        )

    def _store(self, endpoint: Endpoint, value: Value) -> Value:
        with self._there():
            setattr(*self._at(endpoint.path), value)
        return self._fetch(endpoint)

    def _save(self) -> None:
        """Save, and wait until the module is back on its port."""
        self.save_and_leave()
        self._found = self._find(self._serial_number, RESTART_TIME)
        firmware = self.firmware
        self.open()
        if firmware != self.firmware:
            raise NodeError(
                f"{self.name} was saved, and has lost its firmware", node=self.node, remedy=self.remedies[1]
            )

    def save_and_leave(self) -> None:
        """Save like ``save``, but do not wait for the restart, for changes after which the module does not return."""
        self.require_idle()
        try:
            self._call(_SAVE)
        except self._gone:
            return
        if not self._goes():
            raise NodeError(
                f"{self.name} got the command to save, and does not restart",
                node=self.node,
                remedy="nothing is known to be saved: read the values again after switching it off and on",
            )

    @property
    def axis_error(self) -> int:
        """Error word of the axis; blocks."""
        return int(self.read(faults.WORD_PATHS["axis"]))

    def error_words(self) -> dict[str, int]:
        """Return its error words by category of the fault table; blocks.

        Raises:
            ArgumentError: its firmware has no such parameter. NodeError: no answer.
        """
        return {category: int(self.read(path)) for category, path in faults.WORD_PATHS.items()}

    def _clear(self) -> None:
        with self._there():
            self._call(_CLEAR)

    def _state(self) -> int:
        return int(self.read(_STATE))

    @property
    def _device(self) -> Any:
        """Its serial number, and its own list: by path, the JSON data of each parameter and function."""
        return getattr(self._found, _LIST)

    def _at(self, path: str) -> tuple[Any, str]:
        """Return the object that contains the last part of a path, and that part."""
        *folders, name = path.split(".")
        return functools.reduce(getattr, folders, self._found), name

    def _call(self, path: str) -> None:
        """Call a function without arguments."""
        getattr(*self._at(found_in(self.listed.functions, path, "function", SOURCE).path))()

    def _goes(self) -> bool:
        """Return whether it leaves its port within some seconds."""
        end = time.monotonic() + RESTART_BEGINS
        try:
            while time.monotonic() < end:
                getattr(*self._at(_STATE))
                time.sleep(_LOOK)
        except self._gone:
            return True
        return False

    @contextmanager
    def _there(self) -> Iterator[None]:
        """Raise ``NodeTimeout`` if the module leaves its port in this block."""
        try:
            yield
        except self._gone as gone:
            raise NodeTimeout(
                f"{self.name} is no longer there",
                node=self.node,
                observed=str(gone),
                remedy="it restarts, or was unplugged: check its cable and supply, then give the command again",
            ) from gone
