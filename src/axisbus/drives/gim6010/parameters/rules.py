"""Rules for parameters: which are never written, which only by name, and which belong to a backup."""

from __future__ import annotations

import struct

from axisbus.drives.gim6010.can_simple.endpoints import FORMATS, Endpoint, protected
from axisbus.errors import ArgumentError, NodeError

NODE_ID = "axis0.config.can.node_id"
NARROW = 4  # bytes of a value over CAN Simple and Modbus


def travels(endpoint: Endpoint, most: int = NARROW) -> bool:
    """Whether a value of its type is a number of at most ``most`` bytes."""
    letter = FORMATS[endpoint.type]
    return bool(letter) and struct.calcsize(f"<{letter}") <= most


def acts(path: str) -> bool:
    """Whether writing it starts an action; such a parameter is never written here, even by name."""
    found = protected(path)
    return found is not None and found.kind == "act"


def kept(endpoint: Endpoint) -> bool:
    """Whether it belongs to a backup: it is a setting that can be read and written."""
    return endpoint.readable and endpoint.writable and travels(endpoint) and not acts(endpoint.path)


def require_writable(path: str, *, by_name: bool) -> None:
    """Check that a parameter may be written.

    Raises:
        ArgumentError: it starts an action, or it is protected and was not named explicitly.
    """
    found = protected(path)
    if found is None:
        return
    if found.kind == "act":
        raise ArgumentError(
            f"{path} is not written here: {found.why}",
            remedy="parameters that enable, turn or erase a module are never written",
        )
    if path == NODE_ID:
        raise ArgumentError(
            f"{path} is not written as a parameter: {found.why}",
            remedy="axisbus gim6010 set-id changes it, and looks for another module of that ID first",
        )
    if not by_name:
        raise ArgumentError(
            f"{path} is protected: {found.why}",
            remedy="to write it all the same, name exactly this parameter",
        )


def require_setting(endpoint: Endpoint, *, by_name: bool) -> None:
    """Check that a parameter can be written and read back here. Raises ArgumentError: it cannot, or as ``require_writable``."""
    require_writable(endpoint.path, by_name=by_name)
    if not endpoint.writable:
        raise ArgumentError(f"{endpoint.path} cannot be written", remedy="it is read-only")
    if not endpoint.readable:
        raise ArgumentError(
            f"{endpoint.path} cannot be read back, and so is not written", remedy="write it over USB"
        )


def unfitting(node: int, found: object) -> ArgumentError:
    """Return the error for a list with which the module's node ID reads as ``found``, although it answers as ``node``."""
    return ArgumentError(
        f"the list does not fit module {node}: by it the module's node ID is {found}",
        observed="the version is the same, and the numbers of its endpoints are not",
        remedy="get the list of this firmware version from the manufacturer; nothing was written",
    )


def not_cleared(name: str, node: int, word: int | None) -> NodeError:
    """Return the error of a module ``name`` whose axis still has an error word (None: unknown) after its errors were cleared."""
    left = "unknown" if word is None else f"{word:08X}h"
    return NodeError(
        f"{name} got the command to clear its errors, and the error word of its axis is {left}",
        node=node,
        remedy="read its meaning: axisbus gim6010 errors",
    )
