"""The display of a file in a notebook: its maker, its device, and its number of objects of each kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

from axisbus.markup import guarded, table
from axisbus.wording import counted

if TYPE_CHECKING:  # the model imports this module to display a file, so this module cannot import the model
    from axisbus.eds.model import Eds

_MAX_CHECKED = 5000  # objects: larger files are not searched for oddities here
# The areas of an object dictionary (CiA 301).
_AREAS = (
    (range(0x1000, 0x2000), "communication, 1000h to 1FFFh"),
    (range(0x2000, 0x6000), "manufacturer-specific, 2000h to 5FFFh"),
    (range(0x6000, 0xA000), "device profile, 6000h to 9FFFh"),
)
_PDOS = ((range(0x1400, 0x1600), "RPDO"), (range(0x1800, 0x1A00), "TPDO"))


def html(eds: Eds) -> str:
    """Return a file as HTML."""
    return guarded("Eds", lambda: table(f"EDS {eds.source}", _rows(eds)))


def _rows(eds: Eds) -> Iterator[tuple[str, str]]:
    device, identity = eds.info.get("deviceinfo", {}), eds.identity
    yield "device", device.get("productname", "") or "not named"
    yield "maker", device.get("vendorname", "") or "not named"
    yield "vendor ID, product code", f"{_hex(identity.vendor_id)}, {_hex(identity.product_code)}"
    yield "device type (1000h)", _hex(eds.device_type)
    if eds.node_id is not None:
        yield "made for node", str(eds.node_id)
    for area, name in _AREAS:
        yield name, counted(sum(index in area for index in eds.objects), "object")
    pdos = ((sum(index in indices for index in eds.objects), name) for indices, name in _PDOS)
    yield "PDOs", ", ".join(counted(number, name) for number, name in pdos)
    yield "found while reading", _findings(eds)


def _findings(eds: Eds) -> str:
    if len(eds.objects) > _MAX_CHECKED:
        return "see axisbus eds check"
    found = Counter(finding.severity.value for finding in eds.findings)
    count_texts = [counted(number, severity) for severity, number in found.items()]
    return f"{', '.join(count_texts)}; axisbus eds check lists them" if count_texts else "nothing odd"


def _hex(value: int | None) -> str:
    return "unknown" if value is None else f"{value:08X}h"
