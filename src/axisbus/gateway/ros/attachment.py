"""The attachment of each message of rmw_zenoh: number, time of sending, and publisher (rmw_zenoh's design, "Publishers")."""

from __future__ import annotations

import struct
from typing import NamedTuple

from axisbus.errors import ArgumentError
from axisbus.wording import counted

_FORM = struct.Struct("<qqB16s")
_GID = 16  # octets


class Attachment(NamedTuple):
    """``sent`` in ns since 1970 by the sender's clock; ``gid`` names the publisher."""

    number: int
    sent: int
    gid: bytes

    def packed(self) -> bytes:
        """Return the encoded attachment."""
        return _FORM.pack(self.number, self.sent, _GID, self.gid)


def attachment_of(data: bytes | None) -> Attachment:
    """Return the attachment of a message.

    Raises:
        ArgumentError: it is missing or invalid.
    """
    if data is None or len(data) != _FORM.size:
        seen = "there is none" if data is None else f"it has {counted(len(data), 'octet')}, not {_FORM.size}"
        raise ArgumentError("a message has no attachment of rmw_zenoh", observed=seen)
    number, sent, length, gid = _FORM.unpack(data)
    if length != _GID:
        raise ArgumentError(
            "a message has no attachment of rmw_zenoh", observed=f"its GID has {length} octets"
        )
    return Attachment(number, sent, gid)
