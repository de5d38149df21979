"""Store a node's parameters by 1010h, including the restart that some drives do afterwards."""

from __future__ import annotations

import time
from dataclasses import dataclass

from axisbus.bus.node.node import CanopenNode
from axisbus.cia301 import objects as o
from axisbus.drives.make import Make
from axisbus.errors import NodeTimeout, SdoAbort, SdoTimeout, StateError

SAVE = b"save"  # 65766173h, as it is sent (CiA 301 7.5.2.13)
ALL_PARAMETERS = 1
ON_COMMAND, BY_ITSELF = 1, 2  # bits of the value of 1010h (CiA 301 figure 56)
WRITE_TIME = 10.0  # seconds that the memory may need
RESTART_SEEN = 1.0  # seconds within which a restart is detected
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


def store(node: CanopenNode, make: Make) -> Stored:
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
    begin, boots = time.monotonic(), node.nmt.bootups
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
    return Stored(restarted, time.monotonic() - begin)


def _restarts(node: CanopenNode, boots: int, make: Make) -> bool:
    deadline = time.monotonic() + (RESTART_TIME if make.store_restarts else RESTART_SEEN)
    while node.nmt.bootups == boots and time.monotonic() < deadline:
        time.sleep(_SLICE)
    return node.nmt.bootups != boots


def _wait_for(node: CanopenNode, begin: float) -> None:
    deadline = time.monotonic() + RESTART_TIME
    while not node.answers_sdo():
        if time.monotonic() > deadline:
            raise NodeTimeout(
                f"node {node.node_id} has not answered since the command to store its parameters",
                node=node.node_id,
                observed=f"{time.monotonic() - begin:.0f} s without an answer; {node.nmt.describe(time.monotonic())}",
                remedy="look for it with axisbus scan: with the stored parameters it may have another node-ID or bit rate",
            )
