"""An endpoint list that is verified to fit the module: without it, no endpoint is read, written or called."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from axisbus.drives.gim6010.can_simple.endpoints import Endpoint, EndpointList, FirmwareFunction
from axisbus.errors import ArgumentError

_USB_PREFIX = "odrv0."
# The same in every known list: so the firmware version can be read before the list is known.
VERSION_ENDPOINTS = {"fw_version_major": 9, "fw_version_minor": 10, "fw_version_revision": 11}
SERIAL_ENDPOINT = 5  # serial_number; CAN transfers the lowest 32 of its 64 bits
_Found = TypeVar("_Found", Endpoint, FirmwareFunction)


class Firmware(NamedTuple):
    """Version of a firmware."""

    major: int
    minor: int
    revision: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.revision}"

    @classmethod
    def parse(cls, text: str) -> Firmware:
        """Return the version in a text: ``0.5.13``, ``v0.5.13``.

        Raises:
            ArgumentError: the text is not a version.
        """
        found = re.fullmatch(r"v?(\d{1,3})\.(\d{1,3})\.(\d{1,3})", text.strip(), re.ASCII)
        if found is None:
            raise ArgumentError(f"{text!r} is not a version of a firmware", remedy="write it as 0.5.13")
        return cls(*map(int, found.groups()))


def proposed_version(file_name: str) -> Firmware | None:
    """Return the version in a list's file name (``endpoints_0.5.13.json``), as a proposal for the user; None without one."""
    found = re.search(r"(?<![\d.])(\d{1,3}\.\d{1,3}\.\d{1,3})(?![\d]|\.\d)", file_name, re.ASCII)
    return None if found is None else Firmware.parse(found[1])


@dataclass(frozen=True, slots=True)
class FittedList:
    """A list that was ``made_for`` the firmware version that the module ``reported``; it can be made only if they agree.

    Raises:
        ArgumentError: the two versions differ, or the numbers of the version's endpoints are not those of all known lists.
    """

    listed: EndpointList
    made_for: Firmware
    reported: Firmware

    def __post_init__(self) -> None:
        if self.made_for != self.reported:
            raise ArgumentError(
                f"{self.listed.source}: made for firmware {self.made_for}, and the module has {self.reported}",
                observed="numbers of endpoints move from one firmware to the next, and a wrong one may erase the module",
                remedy=f"get the list of firmware {self.reported} from the manufacturer",
            )
        for path, number in VERSION_ENDPOINTS.items():
            found = self.listed.endpoints.get(path)
            if found is None or found.id != number:
                where = "not at all" if found is None else f"at {found.id}"
                raise ArgumentError(
                    f"{self.listed.source}: it has {path} {where}, and every list that is known has it at {number}",
                    remedy="this is not a list of the module's firmware: get it from the manufacturer",
                )

    def endpoint(self, path: str) -> Endpoint:
        """Return a parameter by its path, with or without ``odrv0.``.

        Raises:
            ArgumentError: the list has no such parameter.
        """
        return found_in(self.listed.endpoints, path, "parameter", self.listed.source)

    def function(self, path: str) -> FirmwareFunction:
        """Return a function by its path, with or without ``odrv0.``.

        Raises:
            ArgumentError: the list has no such function.
        """
        return found_in(self.listed.functions, path, "function", self.listed.source)


def found_in(found: Mapping[str, _Found], path: str, kind: str, source: str) -> _Found:
    """Return the entry of a list for a path, with or without ``odrv0.``; ``kind`` and ``source`` are for messages.

    Raises:
        ArgumentError: it does not exist; the message names similar ones.
    """
    path = path.removeprefix(_USB_PREFIX)
    if path in found:
        return found[path]
    near = difflib.get_close_matches(path, found, n=3)
    raise ArgumentError(
        f"{source}: there is no {kind} {path!r}",
        remedy=f"did you mean {' or '.join(near)}?" if near else f"give the path of a {kind} in the list",
    )
