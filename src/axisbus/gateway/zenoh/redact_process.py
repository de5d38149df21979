"""Remove this process from texts of the core before they are sent: for the network, the holder of the lease counts."""

from __future__ import annotations

import os
import re

import msgspec

from axisbus.errors import AxisbusError
from axisbus.ipc.errors import ErrorFields, to_fields

_WHO = rf"process {os.getpid()} \(.*?\), which began at \d+:\d+:\d+"
_OURS = re.compile(rf" by {_WHO}|{_WHO}: ")


def without(text: str) -> str:
    """Return a text without this process."""
    return _OURS.sub("", text)


def fields_of(error: AxisbusError) -> ErrorFields:
    """Return an error as plain values, with this process removed from its texts."""
    found = to_fields(error)
    told = {name: without(one) if isinstance(one, str) else one for name, one in found.fields.items()}
    return msgspec.structs.replace(found, fields=told)
