"""Writes of nodes' programs by the core for clients: each continues if its client ends, and any client may ask for its progress."""

from __future__ import annotations

from axisbus.boot.program_facts import ProgramOrder, ProgramRunState
from axisbus.core.core import Core
from axisbus.core.late_boot import not_written
from axisbus.errors import AxisbusError, StateError

_LARGEST = 1 << 24  # bytes of a program


class ProgramRuns:
    """The writes of a core by node, with the bytes that clients have sent for further ones; for any thread."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self._data = bytearray()
        self._data_of: tuple[int, int] | None = None  # the client, and the node for which it has sent them
        self._states: dict[int, ProgramRunState] = {}

    def take_data(self, client: int, node_id: int, offset: int, data: bytes) -> None:
        """Add bytes of a client's program; the offset 0 begins a new one."""
        if offset == 0:
            self._data, self._data_of = bytearray(), (client, node_id)
        whole = self._data_of == (client, node_id) and offset == len(self._data)
        if not whole or offset + len(data) > _LARGEST:
            raise StateError(
                f"the program of node {node_id} was not received completely", remedy="write it again"
            )
        self._data += data

    def begin(
        self, client: int, node_id: int, identification: int | None, deadline: float | None
    ) -> ProgramOrder:
        """Return the program that a client has sent, and note that it is being written.

        Raises:
            StateError: another program of the node is being written. ArgumentError: no data have been sent.
        """
        if node_id in self._states and not self._states[node_id].ended:
            raise not_written(node_id, "another program is being written into it", "wait for the end of that")
        sent = self._data if self._data_of == (client, node_id) else b""
        self._data, self._data_of = bytearray(), None
        order = ProgramOrder(bytes(sent), identification, deadline)
        self._states[node_id] = ProgramRunState(0, len(order.data))
        return order

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
