"""Who a node says it is (1000h, 1018h), and whether that is the device that its EDS describes."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.cia301 import objects as o
from axisbus.cia402.objects import PROFILE_NUMBER
from axisbus.eds.model import Eds
from axisbus.errors import BootError, SdoAbort
from axisbus.machine.access import Objects, read_int


@dataclass(frozen=True, slots=True)
class Found:
    """What a node answered; None where it has no such object."""

    device_type: int | None
    vendor_id: int | None
    product_code: int | None
    revision: int | None
    serial: int | None
    name: str

    def text(self) -> str:
        """Return the identity in one line."""
        parts = [
            ("vendor", self.vendor_id),
            ("product", self.product_code),
            ("revision", self.revision),
            ("serial", self.serial),
        ]
        return ", ".join(f"{title} 0x{value:X}" for title, value in parts if value is not None)


def read(objects: Objects) -> Found:
    """Read 1000h, 1018h and 1008h; blocks.

    Raises:
        SdoTimeout, BusError: the node does not answer.
    """
    return Found(
        read_int(objects, o.DEVICE_TYPE),
        read_int(objects, o.IDENTITY, o.VENDOR_ID),
        read_int(objects, o.IDENTITY, o.PRODUCT_CODE),
        read_int(objects, o.IDENTITY, o.REVISION_NUMBER),
        read_int(objects, o.IDENTITY, o.SERIAL_NUMBER),
        _name(objects),
    )


def require_same(found: Found, eds: Eds, node_id: int, file: str) -> None:
    """Make sure that the node is the device that the EDS describes; what either does not say is not compared.

    Raises:
        BootError: device profile, vendor or product differ.
    """
    expected = eds.identity
    checks = (
        ("device profile", o.DEVICE_TYPE, 0, _profile(eds.device_type), _profile(found.device_type)),
        ("vendor ID", o.IDENTITY, o.VENDOR_ID, expected.vendor_id, found.vendor_id),
        ("product code", o.IDENTITY, o.PRODUCT_CODE, expected.product_code, found.product_code),
    )
    for what, index, subindex, wanted, got in checks:
        if wanted and got and wanted != got:
            raise BootError(
                f"node {node_id} is another device than {file} describes: its {what} differs",
                node=node_id,
                step="identity",
                index=index,
                subindex=subindex,
                observed=f"{index:04X}h:{subindex:02X} is {_number(what, got)}, the EDS says {_number(what, wanted)}",
                remedy="give the EDS of this device in cell.toml, or correct the node ID (axisbus scan shows who is there)",
            )


def differences(found: Found, eds: Eds) -> list[str]:
    """Return what differs but need not matter: the revision."""
    wanted, got = eds.identity.revision, found.revision
    if wanted and got and wanted != got:
        return [f"revision 0x{got:X}, the EDS is for 0x{wanted:X}: objects may differ"]
    return []


def _profile(device_type: int | None) -> int | None:
    return None if device_type is None else device_type & 0xFFFF


def _number(what: str, value: int) -> str:
    if what == "device profile":
        return f"{value} (CiA {value})" if value != PROFILE_NUMBER else "402 (a drive)"
    return f"0x{value:X}"


def _name(objects: Objects) -> str:
    try:
        return str(objects.read(o.DEVICE_NAME)).strip("\0 ")
    except SdoAbort:
        return ""
