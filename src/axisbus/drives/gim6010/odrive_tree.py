"""The object tree of a module on a USB port, by the package ``odrive``, the maker's commissioning tool (manual v2.2, 3.1)."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NoReturn

from axisbus.drives.gim6010.parameters.values import Value
from axisbus.errors import AdapterError, NodeTimeout, StateError, UserError

FIND = 10.0  # s to find a connected module
ALONE = 1.0  # s to find a second one
_LIST = "_dev"  # attribute of odrive's objects with the device data; there is no public one


class Gone(Exception):  # named for what happened; only ``usb_parameters`` catches it
    """The module is no longer on the port: it restarts, or was unplugged."""


class OdriveTree:
    """The object tree of one module that odrive has found; use it from one thread only.

    Paths are those of the module's own list, without ``odrv0.``. ``members`` is that list: by path, the JSON data of each parameter
    and function.
    """

    def __init__(
        self, found: Any, find: Callable[[str, float], Any], gone: tuple[type[Exception], ...]
    ) -> None:
        """``find`` searches a serial number for so many seconds; ``gone`` are odrive's exceptions for a lost device."""
        self._found = found
        self._find = find
        self._gone = gone
        device = getattr(found, _LIST)
        self._name = str(device.serial_number)
        self.members: Mapping[str, Mapping[str, Any]] = device.flat_json

    @property
    def serial(self) -> int:
        """Serial number, as reported by the port."""
        return int(self._name, 16)

    def read(self, path: str) -> object:
        """Return a value; blocks.

        Raises:
            Gone: the module is no longer there.
        """
        with self._connected():
            return getattr(*self._at(path))

    def write(self, path: str, value: Value) -> None:
        """Write a value; blocks. Raises as ``read``."""
        with self._connected():
            setattr(*self._at(path), value)

    def call(self, path: str) -> None:
        """Call a function without arguments; blocks. Raises as ``read``."""
        with self._connected():
            getattr(*self._at(path))()

    def again(self, seconds: float) -> OdriveTree:
        """Return the same module once it is back on the port; blocks for at most ``seconds``.

        Raises:
            NodeTimeout: it did not come back.
        """
        return OdriveTree(self._find(self._name, seconds), self._find, self._gone)

    def _at(self, path: str) -> tuple[Any, str]:
        """Return the object that contains the last part of a path, and that part."""
        *folders, name = path.split(".")
        return functools.reduce(getattr, folders, self._found), name

    @contextmanager
    def _connected(self) -> Iterator[None]:
        try:
            yield
        except self._gone as error:
            raise Gone(str(error)) from error


def open_tree(serial: str | None) -> OdriveTree:
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
            _not_found(wanted, limit)
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
    return OdriveTree(found, find, lost)


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


def _not_found(wanted: str | None, seconds: float) -> NoReturn:
    raise NodeTimeout(
        f"no module {'' if wanted is None else f'of serial number {wanted} '}was found on USB",
        node=0,
        observed=f"searched for {seconds:g} s",
        remedy="switch its supply on and plug its USB cable in; on Linux this user needs a udev rule (odrivetool prints "
        "it), and no other program may use it, such as odrivetool",
    )
