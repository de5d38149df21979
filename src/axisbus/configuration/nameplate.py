"""The nameplate of each node of a cell: read from the nodes, stored in a file beside the cell file, and compared.

The file is the as-built record of the machine: which drive, with which firmware and which configuration, was there when it was
saved. A comparison says what has changed since then.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from axisbus.bus.node.node import NodeIdentity, read_identity
from axisbus.bus.sdo.access import ByObjects, try_upload
from axisbus.cell.model import CellConfig
from axisbus.cia301 import objects as o
from axisbus.drives.registry import of_identity
from axisbus.eds import builtin
from axisbus.errors import ArgumentError, UserError
from axisbus.json_document import read_document

_KIND, _FORMAT = "axisbus nameplates", 1
_REMEDY = "give a file that axisbus nameplate --save has written, or save it again"


@dataclass(frozen=True, slots=True)
class Nameplate:
    """The identification of one node; a value that the node does not have is None.

    ``make``: the drive plug-in that matches its identity. ``vendor`` to ``serial`` are 1018h:01 to 04, the three texts 1008h to
    100Ah, ``configured_on`` and ``configured_at`` 1020h:01 and 02 (days since 1984-01-01, ms after midnight). ``file`` is the
    EDS or DCF of the cell file, ``sha256`` the hash of its bytes.
    """

    node: int
    make: str
    vendor: int | None
    product: int | None
    revision: int | None
    serial: int | None
    device_name: str | None
    hardware_version: str | None
    software_version: str | None
    configured_on: int | None
    configured_at: int | None
    file: str | None
    sha256: str | None


# For the user: each value with its title and its object.
TITLES: Mapping[str, str] = {
    "make": "make",
    "device_name": "device name (1008h)",
    "vendor": "vendor (1018h:01)",
    "product": "product code (1018h:02)",
    "revision": "revision (1018h:03)",
    "serial": "serial number (1018h:04)",
    "hardware_version": "hardware version (1009h)",
    "software_version": "software version (100Ah)",
    "configured_on": "date of the configuration (1020h:01)",
    "configured_at": "time of the configuration (1020h:02)",
    "file": "EDS or DCF of the cell file",
    "sha256": "hash of that file (SHA-256)",
}
_NUMBERS = frozenset({"vendor", "product", "revision", "serial"})
assert TITLES.keys() | {"node"} == {each.name for each in fields(Nameplate)}


@dataclass(frozen=True, slots=True)
class NameplateChange:
    """One value that differs: ``was`` and ``now`` as text, empty if there was or is none; ``title`` empty: the whole node."""

    node: int
    title: str
    was: str
    now: str

    @property
    def text(self) -> str:
        """The change in words, without the node."""
        if not self.title:
            return "it is new" if not self.was else "it is missing"
        return f"{self.title} was {self.was or 'unknown'}, is {self.now or 'unknown'}"

    def __str__(self) -> str:
        return f"node {self.node}: {self.text}"


def read_nameplate(node: ByObjects, cell: CellConfig) -> Nameplate:
    """Read the nameplate of a node; blocks for about ten transfers.

    Raises:
        SdoTimeout: the node answers for no object. AdapterError: the channel failed.
    """
    identity, (file, digest) = read_identity(node.sdo), _file_of(cell, node.node_id)
    return Nameplate(
        node.node_id,
        of_identity(identity, cell.nodes[node.node_id].makes).name,
        **identity_values(identity),
        configured_on=_number(node, 1),
        configured_at=_number(node, 2),
        file=file,
        sha256=digest,
    )


def identity_values(identity: NodeIdentity) -> dict[str, Any]:
    """Return the values of a device's identity by their names in a nameplate."""
    return {
        "vendor": identity.vendor_id,
        "product": identity.product_code,
        "revision": identity.revision,
        "serial": identity.serial,
        "device_name": identity.device_name,
        "hardware_version": identity.hardware_version,
        "software_version": identity.software_version,
    }


def texts(plate: Nameplate) -> list[tuple[str, str]]:
    """Return the known values as title and text."""
    values = asdict(plate)
    return [
        (title, value_text(name, values[name])) for name, title in TITLES.items() if values[name] is not None
    ]


def changes(before: Sequence[Nameplate], now: Sequence[Nameplate]) -> list[NameplateChange]:
    """Return what differs, node by node."""
    old, new = ({plate.node: plate for plate in plates} for plates in (before, now))
    found = []
    for node in sorted(old.keys() | new.keys()):
        if node not in old or node not in new:
            found.append(
                NameplateChange(node, "", "there" if node in old else "", "there" if node in new else "")
            )
            continue
        was, has = asdict(old[node]), asdict(new[node])
        found += [
            NameplateChange(node, title, value_text(name, was[name]), value_text(name, has[name]))
            for name, title in TITLES.items()
            if was[name] != has[name]
        ]
    return found


def changes_of_device(before: Nameplate, identity: NodeIdentity) -> list[NameplateChange]:
    """Return what differs between a stored nameplate and the device that answers now, without its configuration."""
    was = asdict(before)
    return [
        NameplateChange(before.node, TITLES[name], value_text(name, was[name]), value_text(name, value))
        for name, value in identity_values(identity).items()
        if was[name] != value
    ]


# -- The file ----------------------------------------------------------------------------------------------------------


def file_of(cell: str | Path) -> Path:
    """Return the file in which the nameplates of a cell file are stored."""
    path = Path(cell)
    return path.with_name(f"{path.stem}.nameplate.json")


def load(file: Path) -> tuple[str, list[Nameplate]]:
    """Read a file: the date and time at which it was saved, and the nameplates; blocks.

    Raises:
        UserError: it cannot be read, or is not such a file.
    """
    try:
        text = file.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(
            f"{file} cannot be read: {error.strerror if isinstance(error, OSError) else 'not UTF-8'}",
            remedy="save it first: axisbus nameplate CELL --save",
        ) from None
    return parse(text, str(file))


def as_json(plates: Iterable[Nameplate], cell: str, saved: str) -> str:
    """Return the contents of the file; ``saved``: the date and time as text."""
    document = {
        "kind": _KIND,
        "format": _FORMAT,
        "cell": cell,
        "saved": saved,
        "nodes": [asdict(plate) for plate in plates],
    }
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def as_markdown(plates: Sequence[Nameplate], cell: str, saved: str) -> str:
    """Return the same for people: one table for each node."""
    lines = [f"# Nameplates of {cell}", "", f"Saved {saved}.", ""]
    for plate in plates:
        rows = [f"| {title} | {text.replace('|', chr(92) + '|')} |" for title, text in texts(plate)]
        lines += [f"## Node {plate.node}", "", "| | |", "|---|---|", *rows, ""]
    return "\n".join(lines)


def parse(text: str, source: str) -> tuple[str, list[Nameplate]]:
    """Read the contents of a file: the date and time at which it was saved, and the nameplates; messages name ``source``.

    Raises:
        ArgumentError: it is not such a file, or of another format.
    """
    found = read_document(
        text, source, kind=_KIND, version=_FORMAT, what="a file of nameplates", remedy=_REMEDY
    )
    nodes = found.get("nodes")
    if not isinstance(nodes, list):
        raise ArgumentError(f"{source}: it has no list of nodes", remedy=_REMEDY)
    return str(found.get("saved", "")), [_plate(each, source) for each in nodes]


def _plate(found: Any, source: str) -> Nameplate:
    if not isinstance(found, dict) or not isinstance(found.get("node"), int):
        raise ArgumentError(f"{source}: an entry of its nodes has no node-ID", remedy=_REMEDY)
    node = found["node"]
    values: dict[str, Any] = {name: found.get(name) for name in TITLES}
    for name, value in values.items():
        kind = int if name in _NUMBERS or name.startswith("configured") else str
        if value is not None and (not isinstance(value, kind) or isinstance(value, bool)):
            raise ArgumentError(f"{source}: {name} of node {node} is {value!r}", remedy=_REMEDY)
    return Nameplate(node, values.pop("make") or "", **values)


# -- Values ------------------------------------------------------------------------------------------------------------


def value_text(name: str, value: object) -> str:
    if value is None:
        return ""
    return f"0x{value:X} ({value})" if name in _NUMBERS else str(value)


def _number(node: ByObjects, subindex: int) -> int | None:
    data = try_upload(node.sdo, o.VERIFY_CONFIGURATION, subindex)
    return int.from_bytes(data, "little") if isinstance(data, bytes) else None


def _file_of(cell: CellConfig, node_id: int) -> tuple[str | None, str | None]:
    file = cell.nodes[node_id].file
    if file is None:
        return None, None
    path = Path(builtin.resolve(file, cell.folder))
    return file, hashlib.sha256(path.read_bytes()).hexdigest()
