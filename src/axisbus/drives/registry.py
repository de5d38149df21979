"""The known drive plug-ins, and the selection of the one for a drive."""

from __future__ import annotations

from axisbus.cia301 import objects as o
from axisbus.drives.gim6010.make import GIM6010
from axisbus.drives.make import GENERIC, Make
from axisbus.eds.model import Eds

MAKES: tuple[Make, ...] = (GIM6010,)


def make_of(eds: Eds, node_id: int) -> Make:
    """Return the plug-in for the identity in an EDS, which the boot-up compares with the node's identity."""
    return find(*(_number(eds, node_id, subindex) for subindex in (o.VENDOR_ID, o.PRODUCT_CODE)))


def find(vendor_id: int | None, product_code: int | None) -> Make:
    """Return the plug-in of a drive by 1018h:01 and 1018h:02 (None: unknown); ``GENERIC`` if none matches."""
    return next((make for make in MAKES if make.matches(vendor_id, product_code)), GENERIC)


def _number(eds: Eds, node_id: int, subindex: int) -> int | None:
    variable = eds.get(o.IDENTITY, subindex)
    value = None if variable is None else variable.initial(node_id)
    return value if isinstance(value, int) else None
