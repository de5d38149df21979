"""The expected identity of a node, and the error if another device is found."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.boot.objects import NodeObjects
from axisbus.cell.model import NodeConfig
from axisbus.cia301 import objects as o
from axisbus.cia302.types import IDENTITY, Address, BootOutcome, Expected
from axisbus.cia402.device_type import device_kind
from axisbus.cia402.objects import PROFILE_NUMBER
from axisbus.drives.make import GENERIC, Make
from axisbus.eds.model import Eds
from axisbus.errors import BootError, SdoError

_PROFILE = 0xFFFF  # mask of the low word of 1000h; the high word holds the device's options
_VENDOR = (o.IDENTITY, o.VENDOR_ID)
_PRODUCT = (o.IDENTITY, o.PRODUCT_CODE)
_REVISION = (o.IDENTITY, o.REVISION_NUMBER)
_SERIAL = (o.IDENTITY, o.SERIAL_NUMBER)
_NAMES = {address: name for address, name, _ in IDENTITY} | {(o.DEVICE_TYPE, 0): "device profile"}
_SHORT = {_VENDOR: "vendor", _PRODUCT: "product", _REVISION: "revision", _SERIAL: "serial"}


def expected(node: NodeConfig, eds: Eds) -> dict[Address, Expected]:
    """Return the expected identity of a node: the cell file's values, and the EDS's values, checked only if the node has them."""
    found: dict[Address, Expected] = {}
    if eds.device_type and eds.device_type & _PROFILE:
        found[o.DEVICE_TYPE, 0] = Expected(eds.device_type & _PROFILE, _PROFILE, lenient=True)
    for address, value in ((_VENDOR, eds.identity.vendor_id), (_PRODUCT, eds.identity.product_code)):
        if value:
            found[address] = Expected(value, lenient=True)
    for address, value in ((_REVISION, node.revision), (_SERIAL, node.serial)):
        if value is not None:
            found[address] = Expected(value)
    return found


def text(found: Mapping[Address, int]) -> str:
    """Return an identity in one line."""
    return ", ".join(f"{title} 0x{found[address]:X}" for address, title in _SHORT.items() if address in found)


def differences(found: Mapping[Address, int], eds: Eds) -> list[str]:
    """Return the differences from the EDS that may be harmless: the revision."""
    wanted, got = eds.identity.revision, found.get(_REVISION)
    if wanted and got and wanted != got:
        return [f"revision 0x{got:X}, the EDS is for 0x{wanted:X}: objects may differ"]
    return []


def another_device(outcome: BootOutcome, node: NodeConfig) -> BootError:
    """Return the error of a node that is not the expected device."""
    index, subindex = outcome.address or (o.DEVICE_TYPE, 0)
    address = (index, subindex)
    by_cell = address in (_REVISION, _SERIAL)
    says = "cell.toml says" if by_cell else "the EDS says"
    seen = "not there" if outcome.got is None else _number(address, outcome.got)
    return BootError(
        f"node {outcome.node} is not the device that {'cell.toml specifies' if by_cell else f'{node.file} describes'}: its "
        f"{_NAMES[address]} differs",
        node=outcome.node,
        step="identity",
        index=index,
        subindex=subindex,
        observed=f"{index:04X}h:{subindex:02X} is {seen}, {says} {_number(address, outcome.expected)}",
        remedy=_remedy(address, by_cell),
    )


def name(objects: NodeObjects) -> str:
    """Return the device's name (1008h), empty if it cannot be read; the name is only shown. Blocks.

    Raises:
        BusError: the channel failed.
    """
    try:
        return str(objects.read(o.DEVICE_NAME)).strip("\0 ")
    except SdoError:
        return ""


def heading(objects: NodeObjects, found: Mapping[Address, int], make: Make) -> str:
    """Return the title of a device: its name (1008h), else its make, else its device type (1000h); blocks, raises as ``name``."""
    own = name(objects) or (make.name if make is not GENERIC else "")
    return own or device_kind(found.get((o.DEVICE_TYPE, 0))) or "a device without a name"


def _remedy(address: Address, by_cell: bool) -> str:
    if by_cell:
        key = _SHORT[address]
        return f"correct {key} in [nodes.N] of cell.toml, or connect the intended device (axisbus scan lists the nodes)"
    return "give the EDS of this device in cell.toml, or correct the node ID (axisbus scan lists the nodes)"


def _number(address: Address, value: object) -> str:
    assert isinstance(value, int)
    if address != (o.DEVICE_TYPE, 0):
        return f"0x{value:X}"
    profile = value & _PROFILE
    return f"{profile} (CiA {profile})" if profile != PROFILE_NUMBER else "402 (a drive)"
