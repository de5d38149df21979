"""Optional nodes that were absent when the machine was opened: polled periodically, booted and added when they answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from axisbus.cia402.port import Port
from axisbus.clock import Clock
from axisbus.errors import AxisbusError, BusOff, StateError, TransmitQueueFull

if TYPE_CHECKING:
    from axisbus.boot.report import Booted

ASK_EVERY = 1.0  # seconds
_LEAVE_TIME = 6.0  # seconds for a boot-up in progress at the end


@dataclass(frozen=True, slots=True)
class LateNode:
    """An absent node: ``answers`` asks whether it is present, ``boot`` boots it and returns the result.

    Both block for their SDO transfers.
    """

    node_id: int
    answers: Callable[[], bool]
    boot: Callable[[], tuple[Booted, Mapping[str, Port]]]


class LateBoot:
    """Waits for late nodes in a thread of its own; holds the nodes that are still absent."""

    def __init__(
        self,
        clock: Clock,
        nodes: Mapping[int, LateNode],
        join: Callable[[int, Booted, Mapping[str, Port]], None],
    ) -> None:
        """``join`` adds a node after its boot-up, successful or not; it runs in the polling thread."""
        self._nodes = dict(nodes)
        self._join = join
        self._stop = clock.event()
        self._thread = clock.thread(self._run, "axisbus optional nodes")

    def start(self) -> None:
        """Begin to poll, if any node is absent."""
        if self._nodes:
            self._thread.start()

    def stop(self) -> None:
        """End polling; blocks until a boot-up in progress has ended, at most some seconds."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(_LEAVE_TIME)

    def _run(self) -> None:
        while self._nodes and not self._stop.wait(ASK_EVERY):
            self._ask_all()

    def _ask_all(self) -> None:
        for node in list(self._nodes.values()):
            if self._stop.is_set():
                return
            self._try(node)

    def _try(self, node: LateNode) -> None:
        """Boot a node that answers; if it falls silent again, keep polling it."""
        try:
            if not node.answers():
                return
            booted, ports = node.boot()
        except (BusOff, TransmitQueueFull):  # the bus may come back, and the node with it
            return
        except AxisbusError:  # the channel failed: the scan reports it
            self._stop.set()
            return
        if not booted.report.absent:
            del self._nodes[node.node_id]
            self._join(node.node_id, booted, ports)


def absent_axis(name: str, booted: Booted) -> StateError:
    """Return the error of an axis whose optional node is absent."""
    node, error = booted.report.node_id, booted.report.error
    if booted.report.absent:
        return StateError(
            f"axis {name} cannot be used: node {node} is optional and is not present",
            observed="it has not answered since the machine was opened",
            remedy="switch it on: it is booted within seconds after it answers, and the axis can then be used",
        )
    return StateError(
        f"axis {name} cannot be used: node {node} is optional and did not boot",
        observed="" if error is None else error.message,
        remedy="remove that cause, and open the machine again"
        if error is None or not error.remedy
        else error.remedy,
    )
