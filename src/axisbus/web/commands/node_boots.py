"""Boot-ups of nodes that pages request: each blocks, so it runs in a thread of its own, and all pages show its step."""

from __future__ import annotations

import threading

from axisbus.errors import AxisbusError, StateError
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess
from axisbus.motion.command_status import Status
from axisbus.web.view import Values


class NodeBoots:
    """Hold the step of each boot-up under way. A boot-up continues when the page that requested it is closed."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._steps: dict[int, str] = {}

    def begin(self, node_id: int) -> Handle:
        """Boot a node of the running machine; does not block. The handle ends with the error of the boot-up, if it fails.

        Raises:
            AxisbusError: the cell has no such node, or a page already boots it.
        """
        node = self._machine.node(node_id)
        if node_id in self._steps:
            raise StateError(f"node {node_id} is already being booted", remedy="wait for the end of that")
        self._steps[node_id] = "waiting for its axes"
        handle = Handle(f"node({node_id}).boot()", self._machine.session.waiter)
        threading.Thread(target=self._run, args=(node, handle), name="axisbus-boot", daemon=True).start()
        return handle

    def unread(self) -> list[Values]:
        """Return the boot-ups under way as plain values."""
        return [{"node": node, "step": step} for node, step in self._steps.copy().items()]

    def _run(self, node: NodeAccess, handle: Handle) -> None:
        def show(step: str) -> None:
            self._steps[node.node_id] = f"step {step}"

        try:
            node.boot(show)
        except AxisbusError as error:
            handle._finish(Status.ERROR, error)
        else:
            handle._finish(Status.DONE)
        finally:
            del self._steps[node.node_id]
