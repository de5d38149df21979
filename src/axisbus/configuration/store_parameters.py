"""Store a node's parameters manually: only at rest, with a possible restart, and with a check for lost values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from axisbus.bus.node.node import CanopenNode
from axisbus.configuration import compare, device_side, guarded_write, object_1010
from axisbus.drives import registry
from axisbus.errors import NodeError, StateError

OBJECT = "1010h:01 (Save all parameters)"  # CiA 301 7.5.2.13
Tell = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class StoreResult:
    """The result of a node that has stored: its restart, the total time in s, and the comparison across the restart."""

    restarted: bool
    seconds: float
    comparison: compare.Comparison


def keep(node: CanopenNode, tell: Tell | None = None) -> StoreResult:
    """Make a node store all its parameters by 1010h:01; blocks for up to about 30 s, plus the time for reading.

    The statusword is read first. If the node restarts and its EDS is known, its values before and after the restart are compared.
    ``tell(what, done, all)`` reports the progress.

    Raises:
        StateError: a drive of the node is energised, another master runs it, or it does not store on command; nothing was sent.
        NodeError: another device answers afterwards.
        SdoAbort: the node refuses. NodeTimeout: it does not come back. SdoTimeout, AdapterError: it does not answer.
    """
    _require_at_rest(node)
    who = node.identity()
    make = registry.find(who.vendor_id, who.product_code)
    variables = [] if node.eds is None else list(compare.entries(node.eds))
    before = device_side.of_device(node, variables, _phase(tell, f"reading node {node.node_id}"))
    storing = _phase(tell, f"node {node.node_id} stores")
    if storing is not None:
        storing(0, 1)
    stored = object_1010.store(node, make)
    if storing is not None:
        storing(1, 1)
    if node.identity() != who:
        raise NodeError(
            f"node {node.node_id} is another device since the command to store its parameters",
            node=node.node_id,
            remedy="list the nodes: axisbus scan",
        )
    if not stored.restarted:  # without a restart, the values in RAM prove nothing about its memory
        return StoreResult(False, stored.seconds, compare.Comparison(0, ()))
    after = device_side.of_device(node, variables, _phase(tell, f"reading node {node.node_id} again"))
    readable = [each for each in variables if (each.index, each.subindex) in before.values]
    return StoreResult(True, stored.seconds, compare.compare(readable, before, after))


def _require_at_rest(node: CanopenNode) -> None:
    found = guarded_write.energised(node)
    if found:
        raise StateError(
            f"node {node.node_id} is energised: storing may restart it and release its load; nothing was sent",
            observed="; ".join(found),
            remedy="stop it first: axisbus stop CELL",
        )
    guarded_write.require_no_other_master(node)
    why_not = object_1010.can_store(node)
    if why_not:
        raise StateError(f"node {node.node_id} cannot store its parameters: {why_not}; nothing was sent")


def _phase(tell: Tell | None, what: str) -> Callable[[int, int], None] | None:
    return None if tell is None else lambda done, total: tell(what, done, total)
