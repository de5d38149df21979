"""Writes of nodes' programs by the core for clients: each continues if its client ends, and any client may ask for its progress."""

from __future__ import annotations

from axisbus.boot.program_facts import ProgramOrder, ProgramRunState
from axisbus.core.core import Core
from axisbus.core.late_boot import not_written
from axisbus.errors import AxisbusError, StateError

_LARGEST = 1 << 24  # bytes of a program
_EMPTY = bytearray()


class ProgramRuns:
    """The writes of a core by node, with the bytes that clients have sent for further ones; for any thread."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self._data: dict[tuple[int, int], bytearray] = {}  # by client and node
        self._states: dict[int, ProgramRunState] = {}

    def take_data(self, client: int, node_id: int, offset: int, data: bytes) -> None:
        """Add bytes of a client's program; the offset 0 begins a new one."""
        if offset == 0:
            self._data[client, node_id] = bytearray()
        held = self._data.get((client, node_id), _EMPTY)
        if offset != len(held) or offset + len(data) > _LARGEST:
            raise StateError(
                f"the program of node {node_id} was not received completely", remedy="write it again"
            )
        held += data

    def begin(
        self, client: int, node_id: int, identification: int | None, deadline: float | None
    ) -> ProgramOrder:
        """Return the program that a client has sent, and note that it is being written.

        Raises:
            StateError: another program of the node is being written.
        """
        if node_id in self._states and not self._states[node_id].ended:
            raise not_written(node_id, "another program is being written into it", "wait for the end of that")
        data = bytes(self._data.pop((client, node_id), _EMPTY))
        self._states[node_id] = ProgramRunState(0, len(data))
        return ProgramOrder(data, identification, deadline)

    def run(self, node_id: int, order: ProgramOrder) -> None:
        """Write a program; blocks for minutes. The state shows the result."""

        def progress(done: int, _total: int | None) -> None:
            self._states[node_id] = ProgramRunState(done, len(order.data))

        try:
            written = self._core.write_program(node_id, order, progress)
        except AxisbusError as error:
            self._states[node_id] = ProgramRunState(error=error)
        except BaseException as error:
            self._states[node_id] = ProgramRunState(
                error=not_written(node_id, repr(error), "report this as a mistake in axisbus")
            )
            raise
        else:
            self._states[node_id] = ProgramRunState(written=written)

    def state(self, node_id: int) -> ProgramRunState:
        """Return the state of the last write of a node."""
        return self._states.get(node_id, ProgramRunState())
