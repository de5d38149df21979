"""The firmware's endpoint list (JSON) as immutable values: every parameter and function by its path.

Theory of operation. The list is a nested array of nodes: a parameter has name, id, type and access; an object has members; a
function has an id, and inputs and outputs, which are parameters with ids, too. IDs differ from one firmware to the next, so that a
list is used only after it is verified to fit the module (``verified_endpoints``).
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, NamedTuple, TypeVar

from axisbus.cia301.tables import rows
from axisbus.errors import ArgumentError

_DEEPEST = 32
_IDS = range(1 << 16)
# Names of the list's types, with struct's letter; types without a letter are not numbers, and not accessed here.
FORMATS = {
    "bool": "?",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float": "f",
    "endpoint_ref": "",
    "json": "",
}
_ACCESS = ("r", "w", "rw")


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A parameter: ``path`` as over USB without ``odrv0.``, ``type`` one of ``FORMATS``, ``access`` r, w or rw."""

    path: str
    id: int
    type: str
    access: str

    @property
    def readable(self) -> bool:
        """Whether the list permits reading it."""
        return "r" in self.access

    @property
    def writable(self) -> bool:
        """Whether the list permits writing it."""
        return "w" in self.access


@dataclass(frozen=True, slots=True)
class FirmwareFunction:
    """A function of the firmware: it is called by writing to its ``id`` after writing its ``inputs``."""

    path: str
    id: int
    inputs: tuple[Endpoint, ...] = ()
    outputs: tuple[Endpoint, ...] = ()


@dataclass(frozen=True, slots=True)
class EndpointList:
    """All endpoints of one firmware by path; ``source`` names the list in messages."""

    source: str
    endpoints: Mapping[str, Endpoint]
    functions: Mapping[str, FirmwareFunction]

    def under(self, path: str) -> tuple[Endpoint, ...]:
        """Return the parameters of an object, including nested objects, in the list's order; all parameters for ""."""
        start = f"{path}." if path else ""
        return tuple(each for each in self.endpoints.values() if each.path.startswith(start))


def parse(text: str | bytes, source: str) -> EndpointList:
    """Return the endpoints of a list; messages name ``source`` (its file).

    Raises:
        ArgumentError: it is not JSON, not an endpoint list, or contains a path or an ID twice.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ArgumentError(
            f"{source}: this is not JSON: {error}",
            remedy="give the manufacturer's list of endpoints for the module's firmware",
        ) from None
    reader = _Reader(source)
    reader.members(document, "", 0)
    return EndpointList(source, reader.endpoints, reader.functions)


class _Reader:
    """Collects the endpoints of a list; holds the entries found so far, and the IDs in use."""

    def __init__(self, source: str) -> None:
        self._source = source
        self.endpoints: dict[str, Endpoint] = {}
        self.functions: dict[str, FirmwareFunction] = {}
        self._ids: dict[int, str] = {}

    def members(self, nodes: Any, prefix: str, depth: int) -> None:
        if not isinstance(nodes, list) or depth > _DEEPEST:
            raise self._wrong(
                prefix, "is not a list of members" if depth <= _DEEPEST else "is nested too deeply"
            )
        for node in nodes:
            self._node(node, prefix, depth)

    def _node(self, node: Any, prefix: str, depth: int) -> None:
        path, kind = self._name(node, prefix), node.get("type")
        if kind == "object":
            self.members(node.get("members"), path, depth + 1)
        elif kind == "function":
            inputs, outputs = (tuple(self._arguments(node, key, path)) for key in ("inputs", "outputs"))
            self._add(self.functions, path, FirmwareFunction(path, self._id(node, path), inputs, outputs))
        else:
            self._add(self.endpoints, path, self._leaf(node, path))

    def _name(self, node: Any, prefix: str) -> str:
        name = node.get("name") if isinstance(node, dict) else None
        if not isinstance(name, str):
            raise self._wrong(prefix, "has a member without a name")
        return f"{prefix}.{name}" if prefix else name

    def _leaf(self, node: dict[str, Any], path: str, access: str | None = None) -> Endpoint:
        kind, access = node.get("type"), node.get("access", access or "r")
        if not isinstance(kind, str) or kind not in FORMATS:
            raise self._wrong(
                path, f"has the type {kind!r}; there are {', '.join(FORMATS)}, object, function"
            )
        if access not in _ACCESS:
            raise self._wrong(path, f"has the access {access!r}; there are {', '.join(_ACCESS)}")
        return Endpoint(path, self._id(node, path), kind, access)

    def _arguments(self, node: dict[str, Any], key: str, path: str) -> Iterator[Endpoint]:
        arguments = node.get(key, [])
        if not isinstance(arguments, list):
            raise self._wrong(path, f"has {key} that are no list")
        for each in arguments:
            yield self._leaf(each, self._name(each, path), "rw" if key == "inputs" else "r")

    def _id(self, node: dict[str, Any], path: str) -> int:
        number = node.get("id")
        if isinstance(number, bool) or not isinstance(number, int) or number not in _IDS:
            raise self._wrong(path, f"has the id {number!r}; an id is from 0 to {_IDS.stop - 1}")
        if number in self._ids:
            raise self._wrong(path, f"has the id {number}, as {self._ids[number] or 'the list itself'} has")
        self._ids[number] = path
        return number

    def _add(self, found: dict[str, Any], path: str, what: Endpoint | FirmwareFunction) -> None:
        if path in self.endpoints or path in self.functions:
            raise self._wrong(path, "is in it twice")
        found[path] = what

    def _wrong(self, path: str, what: str) -> ArgumentError:
        return ArgumentError(
            f"{self._source}: {path or 'the list'} {what}",
            remedy="give the list of endpoints of the module's firmware, unchanged",
        )


# -- An endpoint list that is verified to fit the module: without it, no endpoint is read, written or called -----------


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
        """Return the version in a text: ``0.5.13``, ``v0.5.13``. Raises ArgumentError: the text is not a version."""
        found = re.fullmatch(r"v?(\d{1,3})\.(\d{1,3})\.(\d{1,3})", text.strip(), re.ASCII)
        if found is None:
            raise ArgumentError(f"{text!r} is not a firmware version", remedy="write it as 0.5.13")
        return cls(*map(int, found.groups()))


def proposed_version(file_name: str) -> Firmware | None:
    """Return the version in a list's file name (``endpoints_0.5.13.json``), as a proposal for the user; None without one."""
    found = re.search(r"(?<![\d.])(\d{1,3}\.\d{1,3}\.\d{1,3})(?![\d]|\.\d)", file_name, re.ASCII)
    return None if found is None else Firmware.parse(found[1])


def with_version(text: bytes, name: str, made_for: str | None) -> tuple[EndpointList, Firmware]:
    """Return the list in the file ``name`` and its firmware, by that name or by ``made_for`` (None: not given).

    Raises:
        ArgumentError: it is no such list, or of an unknown firmware, or the two versions differ.
    """
    listed = parse(text, name)
    named, given = proposed_version(name), None if made_for is None else Firmware.parse(made_for)
    if named is not None and given is not None and named != given:
        raise ArgumentError(
            f"{name} is for firmware {named} according to its name, but the node must have {given}",
            remedy=f"get the list of firmware {given} from the manufacturer, or correct that version",
        )
    version = named or given
    if version is None:
        raise ArgumentError(
            f"{name} does not give its firmware version",
            remedy='name it endpoints_0.5.13.json if it is for that version, or give the version: firmware = "0.5.13" in the '
            "node of the cell file, --made-for 0.5.13 for a command",
        )
    return listed, version


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
                here = f"it has no {path}" if found is None else f"it has {path} at {found.id}"
                raise ArgumentError(
                    f"{self.listed.source}: {here}, but every known list has it at {number}",
                    remedy="this is not a list of the module's firmware: get it from the manufacturer",
                )

    def endpoint(self, path: str) -> Endpoint:
        """Return a parameter by its path, with or without ``odrv0.``. Raises ArgumentError: the list has no such parameter."""
        return found_in(self.listed.endpoints, path, "parameter", self.listed.source)


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


# -- Parameters and functions accessed only if named one by one: calibration, data of one specimen, communication, actions ---


@dataclass(frozen=True, slots=True)
class Protected:
    """A row of the table: a path in which * matches any characters, its ``kind`` (calibration, unit, link, act), and the reason."""

    path: str
    kind: str
    why: str


TABLE = tuple(Protected(row["path"], row["kind"], row["why"]) for row in rows(__package__, "protected.tsv"))


def protected(path: str) -> Protected | None:
    """Return the row that protects a path (without ``odrv0.``); None if it is not protected."""
    return next((each for each in TABLE if fnmatchcase(path, each.path)), None)
