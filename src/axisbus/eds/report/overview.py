"""The kind of device that an EDS describes: identity, profile, axes, modes of operation, bit rates, areas of the dictionary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.cia301 import objects as cia301
from axisbus.cia402 import modes
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import COUNT, axis_of, indices_of, own_index
from axisbus.cia402.device_type import device_kind
from axisbus.cia402.modes import ModeOfOperation
from axisbus.eds.io import values
from axisbus.eds.model import BAUD_RATES, Eds, Identity, Object
from axisbus.wording import counted


@dataclass(frozen=True, slots=True)
class ModeClaim:
    """The file's information about one mode of operation on one axis (counted from 1).

    ``claimed`` by 6502h is None if the file gives it no value; ``missing`` are the missing mandatory objects.
    """

    axis: int
    mode: ModeOfOperation
    claimed: bool | None
    missing: tuple[int, ...]

    @property
    def short(self) -> str:
        """The mode's short name, such as ``csp``."""
        return modes.short(self.mode)


@dataclass(frozen=True, slots=True)
class Area:
    """One area of the dictionary, and the objects in it."""

    title: str
    indices: range
    objects: tuple[Object, ...]


@dataclass(frozen=True, slots=True)
class EdsOverview:
    """The head of each report about a file; texts are empty, and numbers None, if the file does not contain them."""

    vendor: str
    product: str
    order_code: str
    identity: Identity
    device_type: int | None
    kind: str
    axes: int
    claims: tuple[ModeClaim, ...]
    bit_rates: tuple[int, ...]

    @property
    def title(self) -> str:
        """Product and maker in one line."""
        product = self.product or "CANopen device"
        return f"{product} by {self.vendor}" if self.vendor else product


def overview(eds: Eds, node_id: int | None = None) -> EdsOverview:
    """Return the overview of a file; takes about a millisecond, reads only the model."""
    device = eds.info.get("deviceinfo", {})
    device_type = _device_type(eds)
    axes = axis_count(eds)
    return EdsOverview(
        text(device.get("vendorname")),
        text(device.get("productname")),
        text(device.get("ordercode")),
        eds.identity,
        device_type,
        device_kind(device_type),
        axes,
        tuple(claim for axis in range(1, axes + 1) for claim in claims(eds, axis, node_id)),
        tuple(rate for rate in BAUD_RATES if values.plain(device.get(f"baudrate_{rate}", ""))),
    )


def contents(eds: Eds) -> str:
    """Return the numbers of objects and entries, in words."""
    entries = sum(len(entry.subs) for entry in eds)
    return f"{counted(len(eds.objects), 'object')}, {counted(entries, 'entry', 'entries')}"


def axis_count(eds: Eds) -> int:
    """Return the number of CiA 402 axes that the file describes: each has a controlword and statusword at its own +800h."""
    return sum(
        own_index(cia402.CONTROLWORD, axis) in eds and own_index(cia402.STATUSWORD, axis) in eds
        for axis in range(1, COUNT + 1)
    )


def claims(eds: Eds, axis: int, node_id: int | None = None) -> tuple[ModeClaim, ...]:
    """Return the file's information about each mode of CiA 402 on ``axis`` (from 1)."""
    supported = eds.get(own_index(cia402.SUPPORTED_DRIVE_MODES, axis))
    word = supported.initial(node_id) if supported is not None else None
    claimed = set(modes.supported(word)) if isinstance(word, int) else None
    return tuple(
        ModeClaim(
            axis,
            mode,
            None if claimed is None else mode in claimed,
            tuple(own for index in facts.required if (own := own_index(index, axis)) not in eds),
        )
        for mode, facts in modes.FACTS.items()
    )


def areas(eds: Eds) -> tuple[Area, ...]:
    """Return the areas that contain objects, in the order of their indices; each axis or logical device is an area of its own."""
    found = []
    for title, indices in _areas(eds):
        objects = tuple(entry for entry in eds if entry.index in indices)
        if objects:
            found.append(Area(title, indices, objects))
    return tuple(found)


def file_version(info: Mapping[str, str]) -> str:
    """Return FileVersion and FileRevision of [FileInfo] as ``1.5``, even if written 0x01 and 05; empty without them."""
    given = [text for key in ("fileversion", "filerevision") if (text := info.get(key, ""))]
    numbers = [values.integer(text).value for text in given]
    return ".".join(
        text if number is None else str(number.value) for text, number in zip(given, numbers, strict=True)
    )


def _areas(eds: Eds) -> list[tuple[str, range]]:
    parts = [
        ("Data types", range(0x0001, 0x1000)),
        ("Communication", range(0x1000, 0x2000)),
        ("Maker's own objects", range(0x2000, 0x6000)),
    ]
    word, profile = _profile(eds)
    several = any(1 < axis_of(index) < COUNT for index in eds.objects)
    return [
        *parts,
        *(
            (f"{profile}, {word} {number}" if several else profile, indices_of(number))
            for number in range(1, COUNT + 1)
        ),
        ("Network and system variables", range(0xA000, 0xC000)),
        ("Reserved", range(0xC000, 0x10000)),
    ]


def _profile(eds: Eds) -> tuple[str, str]:
    """Return the name of an +800h range in the file's profile, and the title of the profile's area."""
    number = (eds.device_type or 0) & 0xFFFF
    if number == cia402.PROFILE_NUMBER or (not number and axis_count(eds)):
        return "axis", "Device profile CiA 402"
    return "logical device", f"Device profile CiA {number}" if number else "Device profile"


def _device_type(eds: Eds) -> int | None:
    entry = eds.get(cia301.DEVICE_TYPE)
    found = entry.initial(None) if entry is not None else None
    return found if isinstance(found, int) else None


def text(given: str | None) -> str:
    """Return a text of [DeviceInfo] without the quotation marks that some files have."""
    return (given or "").strip().strip('"').strip()
