"""Decode payloads of the network; an invalid payload gives None."""

from __future__ import annotations

from typing import TypeVar

import msgspec

_Message = TypeVar("_Message")


def read(payload: bytes | None, kind: type[_Message]) -> _Message | None:
    """Return a payload decoded as ``kind``; None if there is no payload or it is not a valid message of this kind."""
    if payload is None:
        return None
    try:
        return msgspec.json.decode(payload, type=kind)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None
