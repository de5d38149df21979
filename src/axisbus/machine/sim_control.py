"""The plant of simulated drives that another process serves (``axisbus sim --control``), for tests."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from axisbus.core.process.remote_proxy import SimulatedDrivesHandle
from axisbus.errors import AdapterError, StateError
from axisbus.system.local_sockets import local_socket

if TYPE_CHECKING:
    from axisbus.core.simulated_nodes import SimulatedNode


class SimulationControl:
    """Access to simulated drives in another process, not through their bus; for a ``with`` block. Any thread may use it."""

    def __init__(self, path: str | Path) -> None:
        """Connect to the drives that ``axisbus sim CELL --control PATH`` serves; blocks for a moment.

        Raises:
            AdapterError: no process serves drives there.
        """
        line = local_socket()
        try:
            line.connect(str(path))
        except OSError as error:
            line.close()
            raise AdapterError(
                f"no simulated drives are served at {path}",
                observed=str(error.strerror or error),
                remedy=f"start them: axisbus sim CELL --control {path}",
            ) from error
        self._control = SimulatedDrivesHandle(line)
        self._simulated_nodes = self._control.simulated_nodes(self._control.nodes())

    def __enter__(self) -> SimulationControl:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def nodes(self) -> tuple[int, ...]:
        """The node-IDs of the drives."""
        return tuple(self._simulated_nodes)

    def simulated_node(self, node_id: int) -> SimulatedNode:
        """Return the simulated drive of a node: its plant, its fault settings, and faults on demand.

        Each access to it is a request to the other process.

        Raises:
            StateError: there is no such node.
        """
        if node_id not in self._simulated_nodes:
            raise StateError(
                f"there is no simulated node {node_id}",
                observed=f"there are {', '.join(map(str, self.nodes))}",
            )
        return self._simulated_nodes[node_id]

    def close(self) -> None:
        """Disconnect from the drives, which keep running; blocks for at most 2 s. Harmless when repeated."""
        self._control.end()
