"""The runtime of a machine: a link, and the nodes booted over it, with their release."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from typing import TypeVar

from axisbus.boot.report import Booted
from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.node.events import NodeEvent
from axisbus.bus.parallel import in_parallel
from axisbus.cia302.types import Address
from axisbus.cia402.port import Port
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.node_shutdown import node_shutdowns
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.errors import AxisbusError
from axisbus.link import CellConnection, StopResult, Unsafe
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.parameters import AxisParameters
from axisbus.wording import counted

T = TypeVar("T")
CellLink = CellConnection[Booted, NodeParts, ControllerEvent, NodeEvent]


class Runtime:
    """A cell on its link, booted but not yet scanned; holds the boot result of each node.

    ``simulated_nodes`` are the simulated drives, if there are any.
    """

    def __init__(
        self,
        link: CellLink,
        nodes: Iterable[int],
        simulated_nodes: Mapping[int, SimulatedNode],
        on_report: Callable[[Booted], None] | None = None,
    ) -> None:
        """Boot ``nodes``; blocks meanwhile. ``on_report`` is called for each finished node, in the thread that booted it.

        Raises:
            AdapterError: the channel failed; the link is closed then.
        """
        self.link = link
        self.simulated_nodes = dict(simulated_nodes)
        try:
            self.booted = self._boot_all(list(nodes), on_report)
            link.begin()
        except BaseException:
            link.close()
            raise
        self.nodes = {node_id: link.parts(node_id) for node_id in self.booted}
        self._bootups = {  # boot-up messages before the end of the last boot-up
            node_id: parts.node.nmt.bootups for node_id, parts in self.nodes.items() if parts.has_objects
        }

    @property
    def absent(self) -> list[int]:
        """The optional nodes that have not appeared yet."""
        return [node_id for node_id, booted in self.booted.items() if booted.report.absent]

    @property
    def ports(self) -> dict[str, Port]:
        """The ports of the axes of all booted nodes, by name."""
        up = [node_id for node_id, booted in self.booted.items() if booted.report.ok]
        return {name: port for node_id in up for name, port in self.link.ports(node_id).items()}

    @property
    def parameters(self) -> dict[str, AxisParameters]:
        """The parameters of the axes of all booted nodes, by name."""
        up = [booted for booted in self.booted.values() if booted.report.ok]
        return {name: value for booted in up for name, value in booted.parameters.items()}

    def use(self, make: Callable[[Runtime], T]) -> T:
        """Return the result of ``make`` if all required nodes are present. On any failure leave the nodes and raise."""
        try:
            require_all(self.booted)
            self.link.ready()
            return make(self)
        except BaseException:
            self.leave()
            raise

    def leave(
        self,
        cores: Mapping[str, AxisCore] | None = None,
        rescued: Iterable[StopResult] = (),
        unsafe: Iterable[Unsafe] = (),
    ) -> None:
        """Leave each node as appropriate, and release everything, despite any failure; see ``node_shutdowns``."""
        for work in (
            partial(self.link.leave, node_shutdowns(self.booted, cores or {}, rescued, unsafe)),
            self.link.close,
        ):
            with suppress(AxisbusError, OSError):
                work()

    def _boot_all(self, nodes: list[int], on_report: Callable[[Booted], None] | None) -> dict[int, Booted]:
        def boot(node_id: int) -> Booted:
            booted = self.link.boot(node_id)
            if on_report is not None:
                on_report(booted)
            return booted

        results = in_parallel(self.link.clock, boot, nodes)
        return dict(zip(nodes, results, strict=True))

    def has_returned(self, node_id: int) -> bool:
        """Whether a node that has restarted since its boot-up, or is not operational, answers; blocks for at most one request."""
        return not self.is_operational(node_id) and self.link.answers(node_id)

    def is_operational(self, node_id: int) -> bool:
        """Whether a node is operational, and has not restarted since its boot-up."""
        nmt = self.nodes[node_id].node.nmt
        return bool(nmt.bootups == self._bootups[node_id] and nmt.operational(self.link.clock.now()))

    def boot_late(
        self,
        node_id: int,
        before: Mapping[Address, int] | None = None,
        on_step: Callable[[str], None] = lambda _: None,
    ) -> tuple[Booted, Mapping[str, Port]]:
        """Boot a node while the scan runs, as ``CellConnection.boot``; its ports are those of before if it does not come up."""
        booted = self.link.boot(node_id, before, on_step)
        self._bootups[node_id] = self.nodes[node_id].node.nmt.bootups
        self.nodes[node_id] = self.link.parts(node_id)
        return booted, self.link.ports(node_id)


def require_all(booted: Mapping[int, Booted]) -> None:
    """Raise the errors of required nodes that did not come up: one ``BootError``, or a group of them."""
    needed = [node.report for node in booted.values() if not node.report.optional]
    errors = [report.error for report in needed if report.error is not None]
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise ExceptionGroup(f"{len(errors)} of {counted(len(booted), 'node')} did not boot", errors)
