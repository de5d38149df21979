"""The 11-bit identifier of CAN Simple: a node ID of six bits above a command ID of five (manual v2.2, 4.1.1)."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.errors import ArgumentError

NODES = range(64)
COMMANDS = range(32)
_COMMAND_BITS = 5


class Identifier(NamedTuple):
    """A node ID (0 to 63) and a command ID (0 to 31)."""

    node: int
    command: int

    @property
    def can_id(self) -> int:
        """The identifier on the wire."""
        return self.node << _COMMAND_BITS | self.command


def require_node(node: object) -> None:
    """Check a node ID.

    Raises:
        ArgumentError: it is not from 0 to 63.
    """
    _check("node ID of CAN Simple", node, NODES)


def can_id(node: int, command: int) -> int:
    """Return the identifier of a command to or from a node.

    Raises:
        ArgumentError: the node ID is not from 0 to 63, or the command ID not from 0 to 31.
    """
    require_node(node)
    _check("command ID of CAN Simple", command, COMMANDS)
    return Identifier(node, command).can_id


def split(identifier: int) -> Identifier:
    """Return the node and the command of any 11-bit identifier, even one of another protocol.

    Raises:
        ArgumentError: it has more than 11 bits.
    """
    _check("identifier of 11 bits", identifier, range(0x800))
    return Identifier(identifier >> _COMMAND_BITS, identifier & COMMANDS.stop - 1)


def _check(what: str, value: object, allowed: range) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value not in allowed:
        raise ArgumentError(
            f"{value!r} is not a {what}",
            remedy=f"give a whole number from {allowed.start} to {allowed.stop - 1}",
        )
