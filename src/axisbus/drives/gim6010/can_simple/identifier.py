"""The 11-bit identifier of CAN Simple: a node ID of six bits above a command ID of five (manual v2.2, 4.1.1).

Also the identifiers of a node, and whether CANopen nodes on the same bus use one of them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.cia301 import cob
from axisbus.drives.gim6010.can_simple.messages import MESSAGES
from axisbus.errors import ArgumentError

NODES = range(64)
COMMANDS = range(32)
_COMMAND_BITS = 5


class Identifier(NamedTuple):
    """A node ID (0 to 63) and a command ID (0 to 31)."""

    node: int
    command: int


def require_node(node: object) -> None:
    """Check a node ID. Raises ArgumentError: it is not from 0 to 63."""
    _check("node ID of CAN Simple", node, NODES)


def can_id(node: int, command: int) -> int:
    """Return the identifier of a command to or from a node.

    Raises:
        ArgumentError: the node ID is not from 0 to 63, or the command ID not from 0 to 31.
    """
    require_node(node)
    _check("command ID of CAN Simple", command, COMMANDS)
    return node << _COMMAND_BITS | command


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


# -- Compatibility with CANopen nodes on one bus: no identifier may have two owners (manual v2.2, 4.1.4) ---------------


_BUS_WIDE = {cob.NMT: "NMT", cob.SYNC: "SYNC", cob.TIME: "TIME", cob.LSS_TX: "LSS", cob.LSS_RX: "LSS"}
_OF_A_NODE = {
    cob.EMCY: "EMCY",
    **{base: f"TPDO{number}" for number, base in enumerate(cob.TPDO, start=1)},
    **{base: f"RPDO{number}" for number, base in enumerate(cob.RPDO, start=1)},
    cob.SDO_TX: "SDO",
    cob.SDO_RX: "SDO",
    cob.HEARTBEAT: "heartbeat",
}
# The manual's table: CANopen nodes from the first number on are compatible with these CAN Simple nodes.
MANUAL = {
    32: frozenset({0x10, 0x18, 0x20, 0x28}),
    64: frozenset({0x10, 0x11, 0x18, 0x19, 0x20, 0x21, 0x28, 0x29}),
    96: frozenset({0x10, 0x11, 0x12, 0x18, 0x19, 0x1A, 0x20, 0x21, 0x22, 0x28, 0x29, 0x2A}),
}


@dataclass(frozen=True, slots=True)
class Clash:
    """An identifier that a CAN Simple node uses for a command and CANopen for another purpose, described in ``words``."""

    node: int
    can_id: int
    words: str

    def __str__(self) -> str:
        return f"node {self.node} of CAN Simple has {self.can_id:03X}h, which is {self.words}"


def identifiers(node: int) -> range:
    """Return the identifiers of a CAN Simple node (0 to 63): those of the commands 1 to 31.

    Raises:
        ArgumentError: the node ID is invalid.
    """
    return range(can_id(node, COMMANDS.start + 1), can_id(node, COMMANDS.stop - 1) + 1)


def sent_by(node: int) -> frozenset[int]:
    """Return the identifiers on which a module sends, unasked or as answers; raises as ``identifiers``."""
    return frozenset(can_id(node, each.command) for each in MESSAGES if each.answer)


def commands_to(node: int) -> frozenset[int]:
    """Return the identifiers that only a master sends to a module; raises as ``identifiers``."""
    return frozenset(can_id(node, each.command) for each in MESSAGES if not each.answer)


def canopen_identifiers(nodes: Collection[int]) -> dict[int, str]:
    """Return the predefined connection set (CiA 301 7.3.5) of these nodes (1 to 127) and of the bus, with descriptions.

    Raises:
        ArgumentError: a node ID is invalid in CANopen.
    """
    for node in nodes:
        if node not in cob.NODE_IDS:
            raise ArgumentError(f"{node!r} is not a node ID of CANopen", remedy="give numbers from 1 to 127")
    return dict(_BUS_WIDE) | {
        base + node: f"the {name} of CANopen node {node}"
        for node in nodes
        for base, name in _OF_A_NODE.items()
    }


def clashes(
    simple: Collection[int], canopen: Collection[int], cob_ids: Mapping[int, str] | None = None
) -> tuple[Clash, ...]:
    """Return the identifiers that both CAN Simple nodes (0 to 63) and CANopen nodes (1 to 127) would use, lowest first.

    CANopen's identifiers are the whole predefined connection set, and the ``cob_ids`` that a cell configures (identifier to
    description). Two modules with the same node ID are not detected here. Raises ArgumentError: a node ID is invalid.
    """
    taken = canopen_identifiers(canopen) | dict(cob_ids or {})
    found = (
        Clash(node, each, taken[each]) for node in set(simple) for each in identifiers(node) if each in taken
    )
    return tuple(sorted(found, key=lambda each: each.can_id))


def in_manual(simple: Collection[int], canopen: Collection[int]) -> bool:
    """Return whether the manual lists these node IDs as compatible; it omits some that do not clash."""
    lowest = min(canopen, default=max(MANUAL))
    rows = [nodes for first, nodes in MANUAL.items() if first <= lowest]
    return any(set(simple) <= nodes for nodes in rows)


def free_nodes(canopen: Collection[int], cob_ids: Mapping[int, str] | None = None) -> tuple[int, ...]:
    """Return the CAN Simple node IDs that clash with none of these, those in the manual's list first."""
    free = [node for node in range(64) if not clashes((node,), canopen, cob_ids)]
    return tuple(sorted(free, key=lambda node: not in_manual((node,), canopen)))
