"""Store a node's parameters manually: only at rest, with a possible restart, and with a check for lost values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from axisbus.bus.node.node import CanopenNode
from axisbus.cia301 import objects as o
from axisbus.clock import poll_until
from axisbus.configuration import compare, guarded_write
from axisbus.drives import registry
from axisbus.drives.plugin import DrivePlugin
from axisbus.errors import NodeError, NodeTimeout, SdoAbort, SdoTimeout, StateError

OBJECT = "1010h:01 (Save all parameters)"  # CiA 301 7.5.2.13
OnProgress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class StoreResult:
    """The result of a node that has stored: its restart, the total time in s, and the comparison across the restart."""

    restarted: bool
    seconds: float
    comparison: compare.Comparison


def store_all(node: CanopenNode, on_progress: OnProgress | None = None) -> StoreResult:
    """Make a node store all its parameters by 1010h:01; blocks for up to about 30 s, plus the time for reading.

    The statusword is read first. If the node restarts and its EDS is known, its values before and after the restart are compared.
    ``on_progress(what, done, all)`` reports the progress.

    Raises:
        StateError: a drive of the node is energised, another master runs it, or it does not store on command; nothing was sent.
        NodeError: another device answers afterwards.
        SdoAbort: the node refuses. NodeTimeout: it does not come back. SdoTimeout, AdapterError: it does not answer.
    """
    _require_at_rest(node)
    identity = node.identity()
    make = registry.of_identity(identity)
    variables = [] if node.eds is None else list(compare.entries(node.eds))
    before = compare.of_device(node, variables, _phase(on_progress, f"reading node {node.node_id}"))
    storing = _phase(on_progress, f"node {node.node_id} stores")
    if storing is not None:
        storing(0, 1)
    stored = store(node, make)
    if storing is not None:
        storing(1, 1)
    if node.identity() != identity:
        raise NodeError(
            f"node {node.node_id} has been another device since the command to store its parameters",
            node=node.node_id,
            remedy="list the nodes: axisbus scan",
        )
    if not stored.restarted:  # without a restart, the values in RAM prove nothing about its memory
        return StoreResult(False, stored.seconds, compare.Comparison(0, ()))
    after = compare.of_device(node, variables, _phase(on_progress, f"reading node {node.node_id} again"))
    readable = [each for each in variables if (each.index, each.subindex) in before.values]
    return StoreResult(True, stored.seconds, compare.compare(readable, before, after))


def _require_at_rest(node: CanopenNode) -> None:
    what = ": storing may restart it and release its load; nothing was sent"
    guarded_write.require_not_energised(node, what)
    guarded_write.require_no_other_master(node)
    why_not = can_store(node)
    if why_not:
        raise StateError(f"node {node.node_id} cannot store its parameters: {why_not}; nothing was sent")


def _phase(on_progress: OnProgress | None, what: str) -> Callable[[int, int], None] | None:
    return None if on_progress is None else lambda done, total: on_progress(what, done, total)


# -- Store a node's parameters by 1010h, including the restart that some drives do afterwards --------------------------


SAVE = b"save"  # 65766173h, as it is sent (CiA 301 7.5.2.13)
ALL_PARAMETERS = 1
ON_COMMAND, BY_ITSELF = 1, 2  # bits of the value of 1010h (CiA 301 figure 56)
WRITE_TIME = 10.0  # seconds that the memory may need
RESTART_DETECTION_TIME = 1.0  # seconds within which a restart is detected
RESTART_TIME = 15.0  # seconds that a restart may take
_SLICE = 0.02


@dataclass(frozen=True, slots=True)
class Stored:
    """The result of storing: whether the node restarted, and the total time in seconds."""

    restarted: bool
    seconds: float


def can_store(node: CanopenNode) -> str:
    """Return the reason why 1010h:01 does not store on command, empty if it does; blocks for a transfer.

    Raises:
        SdoError, AdapterError: as ``SdoClient.upload``.
    """
    try:
        flags = int.from_bytes(node.sdo.upload(o.STORE_PARAMETERS, ALL_PARAMETERS), "little")
    except SdoAbort:
        return "it has no 1010h:01 (Save all parameters); its manual lists the stored parameters"
    if flags & ON_COMMAND:
        return ""
    return "it stores automatically (1010h:01)" if flags & BY_ITSELF else "by 1010h:01 it does not store"


def store(node: CanopenNode, make: DrivePlugin) -> Stored:
    """Store all parameters and wait until the node answers again; blocks for up to about 30 s.

    Raises:
        StateError: the node does not store on command; nothing was sent.
        SdoAbort: the node refuses.
        NodeTimeout: the node does not come back.
        SdoTimeout, AdapterError: the node did not answer, and did not restart; or the channel failed.
    """
    why_not = can_store(node)
    if why_not:
        raise StateError(
            f"node {node.node_id} cannot store its parameters: {why_not}", remedy="leave --store out"
        )
    clock = node.channel.clock
    begin, boots = clock.now(), node.nmt.bootups
    silent: SdoTimeout | None = None
    try:
        # Only one try: a drive that restarts before it answers must not get the command again.
        node.sdo.download(o.STORE_PARAMETERS, ALL_PARAMETERS, SAVE, timeout=WRITE_TIME, tries=1)
    except SdoTimeout as error:
        silent = error
    restarted = _restarts(node, boots, make)
    if silent is not None and not restarted:
        raise silent
    _wait_for(node, begin)
    return Stored(restarted, clock.now() - begin)


def _restarts(node: CanopenNode, boots: int, make: DrivePlugin) -> bool:
    clock = node.channel.clock
    deadline = clock.now() + (RESTART_TIME if make.behaviour.store_restarts else RESTART_DETECTION_TIME)
    return poll_until(clock, lambda: node.nmt.bootups != boots, deadline, _SLICE)


def _wait_for(node: CanopenNode, begin: float) -> None:
    clock = node.channel.clock
    deadline = clock.now() + RESTART_TIME
    while not node.answers_sdo():
        if clock.now() > deadline:
            raise NodeTimeout(
                f"node {node.node_id} has not answered since the command to store its parameters",
                node=node.node_id,
                observed=f"{clock.now() - begin:.0f} s without an answer; {node.nmt.describe(clock.now())}",
                remedy="look for it with axisbus scan: with the stored parameters it may have another node-ID or bit rate",
            )
