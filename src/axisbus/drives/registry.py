"""Which makes are known, and which one a drive is of."""

from __future__ import annotations

from axisbus.drives.gim6010.make import GIM6010
from axisbus.drives.make import GENERIC, Make

MAKES: tuple[Make, ...] = (GIM6010,)


def find(vendor_id: int | None, product_code: int | None) -> Make:
    """Return the make of a drive by 1018h:01 and 1018h:02 (None: unknown); ``GENERIC`` where none is known."""
    return next((make for make in MAKES if make.matches(vendor_id, product_code)), GENERIC)
