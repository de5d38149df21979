"""Preconditions for changing a module's node ID, bit rate or protocol, checked against the modules found on its bus."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from axisbus.cia301 import cob
from axisbus.drives.gim6010.can_simple.identifier import clashes, identifiers, require_node
from axisbus.drives.gim6010.discovery.finder import Finder
from axisbus.drives.gim6010.discovery.results import DiscoveredModule, ProtocolsFound
from axisbus.errors import StateError


def require_one(finder: Finder, found: Sequence[DiscoveredModule], node: int) -> DiscoveredModule:
    """Return the only module of CAN Simple with this node ID, if it is idle.

    Raises:
        StateError: there is none, there are several, it is not idle or its state is unknown; or requests are not acknowledged.
    """
    if finder.unacknowledged:
        raise StateError(
            "no node acknowledges on this bus",
            observed=finder.unacknowledged,
            remedy="see axisbus gim6010 find",
        )
    module = next(
        (each for each in found if each.protocol is ProtocolsFound.CAN_SIMPLE and each.node == node), None
    )
    if module is None:
        raise StateError(
            f"no module that speaks CAN Simple has the node ID {node}",
            remedy="list the modules: axisbus gim6010 find",
        )
    if module.several:
        raise StateError(
            f"several modules have the node ID {node}: all of them would execute the command",
            remedy="connect one of them alone",
        )
    if module.enabled is not False:
        raise StateError(
            f"module {node} is not known to be idle: {module.state or 'it sends no heartbeat with its state'}",
            remedy="stop and disable it first; a module without heartbeats is changed over USB",
        )
    return module


def require_free(finder: Finder, found: Sequence[DiscoveredModule], new: int) -> None:
    """Check that a module of CAN Simple can get the node ID ``new`` (0 to 63).

    Raises:
        ArgumentError: the node ID is invalid. StateError: another module has it, or another node uses one of its identifiers.
    """
    require_node(new)
    if any(each.protocol is ProtocolsFound.CAN_SIMPLE and each.node == new for each in found):
        raise StateError(f"another module has the node ID {new} already", remedy="give a free node ID")
    mine = set(identifiers(new))
    foreign = [each for each in finder.picture.foreign() if not each.extended and each.can_id in mine]
    if foreign:
        raise StateError(
            f"identifiers of node ID {new} are in use: {', '.join(each.words for each in foreign)}",
            remedy="give one whose identifiers are free",
        )
    _require_no_clash([new], canopen_nodes(found))


def require_canopen(found: Sequence[DiscoveredModule], node: int) -> None:
    """Check that the module with this node ID can be a CANopen node of the same ID on this bus.

    Raises:
        StateError: it is not 1 to 127, another node has it, or its identifiers belong to another module.
    """
    if node not in cob.NODE_IDS:
        raise StateError(
            f"{node} is not a node ID of CANopen, which has 1 to 127: the module would be silent",
            remedy="give it another first: axisbus gim6010 set-id",
        )
    if node in canopen_nodes(found):
        raise StateError(
            f"there is a CANopen node {node} already", remedy="give the module a node ID that is free"
        )
    others = [
        each.node
        for each in found
        if each.protocol is ProtocolsFound.CAN_SIMPLE and each.node not in (None, node)
    ]
    _require_no_clash([each for each in others if each is not None], {*canopen_nodes(found), node})


def require_no_other_master(finder: Finder, found: Sequence[DiscoveredModule], node: int) -> None:
    """Check that a module is alone on its bus: with another bit rate it would destroy the frames of other nodes.

    Raises:
        StateError: it is not alone.
    """
    others = [
        f"{each.protocol.value} node {' or '.join(map(str, each.addresses))}"
        for each in found
        if each.node != node
    ]
    others += [each.words for each in finder.picture.foreign()]
    if others:
        raise StateError(
            f"module {node} is not alone on its bus",
            observed=f"there are also: {', '.join(others)}",
            remedy="connect it alone: at another bit rate it would destroy the others' frames",
        )


def canopen_nodes(found: Sequence[DiscoveredModule]) -> set[int]:
    return {each.node for each in found if each.protocol is ProtocolsFound.CANOPEN and each.node is not None}


def _require_no_clash(simple: Collection[int], canopen: Collection[int]) -> None:
    both = clashes(simple, canopen)
    if canopen and both:
        more = f", and {len(both) - 1} more" if len(both) > 1 else ""
        raise StateError(
            f"these cannot be on one bus: {both[0]}{more}",
            remedy="choose node IDs that can share a bus (docs/gim6010-8.md), or change one module alone on its bus",
        )
