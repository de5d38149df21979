"""Octets of the network as messages; what is none is None, whatever it is."""

from __future__ import annotations

from typing import TypeVar

import msgspec

_Message = TypeVar("_Message")


def read(payload: bytes | None, kind: type[_Message]) -> _Message | None:
    """Return the message that a payload is; None where there is none, or it is another."""
    if payload is None:
        return None
    try:
        return msgspec.json.decode(payload, type=kind)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None
