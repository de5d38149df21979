"""Parameters of a module by its object tree on USB; implements ``ModuleParameters``.

Theory of operation
-------------------
No endpoint list is needed: the module provides its own, which always fits its firmware, and a path is accessed by its name. Only
two functions are called: saving, which restarts the module, and clearing errors. After a restart the module is found by its serial
number, and all written values are read again.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.endpoints import (
    VERSION_ENDPOINTS,
    Endpoint,
    EndpointList,
    Firmware,
    found_in,
    parse,
)
from axisbus.drives.gim6010.can_simple.identifier import require_node
from axisbus.drives.gim6010.make import RESTART_BEGINS, RESTART_TIME
from axisbus.drives.gim6010.odrive_tree import Gone, OdriveTree
from axisbus.drives.gim6010.parameters import rules
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.errors import NodeError, NodeTimeout, StateError

SOURCE = "the module's own list"
_STATE = "axis0.current_state"
_SAVE, _CLEAR = "save_configuration", "clear_errors"
_LOOK = 0.05
_WIDEST = 8  # bytes of a value


class UsbParameters(ModuleParameters):
    """``ModuleParameters`` of one module on USB; holds its tree."""

    widest = _WIDEST
    remedies = (
        "the module limits this value, or does not accept it",
        "write it again, and check whether the value remains after switching the module off and on",
    )

    def __init__(self, tree: OdriveTree) -> None:
        """Prepare; nothing is read before ``open``."""
        super().__init__()
        self._tree = tree
        self._node = 0
        self.serial = tree.serial
        self._own: EndpointList | None = None

    def open(self) -> None:
        """Read its list, version and node ID; blocks.

        Raises:
            NodeError: it does not report them. ArgumentError: its list is invalid.
        """
        nodes = [{**member, "name": path} for path, member in self._tree.members.items()]
        self._own = parse(json.dumps(nodes), SOURCE)
        self.firmware = Firmware(*(int(self.read(path)) for path in VERSION_ENDPOINTS))
        self._node = int(self.read(rules.NODE_ID))

    @property
    def node(self) -> int:
        """Its node ID on CAN and RS485."""
        return self._node

    @property
    def name(self) -> str:
        """The module in messages, by its serial number."""
        return f"module {self.serial:X}h on USB"

    @property
    def listed(self) -> EndpointList:
        """The parameters of its firmware."""
        if self._own is None:
            raise StateError("the list of the module was not read", remedy="open it first")
        return self._own

    def set_node_id(self, new: int) -> None:
        """Change its node ID (0 to 63) in RAM and read it back; blocks. Does not check other nodes. Raises as ``write``."""
        require_node(new)
        self._node = int(self._put(self.endpoint(rules.NODE_ID), new))

    def _fetch(self, endpoint: Endpoint) -> Value:
        with self._there():
            found = self._tree.read(endpoint.path)
        if isinstance(found, bool | int | float):
            return found
        raise NodeError(
            f"{self.name}: {endpoint.path} was reported as {found!r}, which is not a number", node=self.node
        )

    def _store(self, endpoint: Endpoint, value: Value) -> Value:
        with self._there():
            self._tree.write(endpoint.path, value)
        return self._fetch(endpoint)

    def _save(self) -> None:
        """Save, and wait until the module is back on its port."""
        self.save_and_leave()
        self._tree = self._tree.again(RESTART_TIME)
        firmware = self.firmware
        self.open()
        if firmware != self.firmware:
            raise NodeError(
                f"{self.name} was saved, and has lost its firmware", node=self.node, remedy=self.remedies[1]
            )

    def save_and_leave(self) -> None:
        """Save like ``save``, but do not wait for the restart, for changes after which the module does not return."""
        self.require_idle()
        try:
            self._tree.call(self._function(_SAVE))
        except Gone:
            return
        if not self._goes():
            raise NodeError(
                f"{self.name} got the command to save, and does not restart",
                node=self.node,
                remedy="nothing is known to be saved: read the values again after switching it off and on",
            )

    @property
    def axis_error(self) -> int:
        """Error word of the axis; blocks."""
        return int(self.read(faults.WORD_PATHS["axis"]))

    def error_words(self) -> dict[str, int]:
        """Return its error words by category of the fault table; blocks.

        Raises:
            ArgumentError: its firmware has no such parameter. NodeError: no answer.
        """
        return {category: int(self.read(path)) for category, path in faults.WORD_PATHS.items()}

    def _clear(self) -> None:
        with self._there():
            self._tree.call(self._function(_CLEAR))

    def _state(self) -> int:
        return int(self.read(_STATE))

    def _function(self, path: str) -> str:
        return found_in(self.listed.functions, path, "function", SOURCE).path

    def _goes(self) -> bool:
        """Return whether it leaves its port within some seconds."""
        end = time.monotonic() + RESTART_BEGINS
        try:
            while time.monotonic() < end:
                self._tree.read(_STATE)
                time.sleep(_LOOK)
        except Gone:
            return True
        return False

    @contextmanager
    def _there(self) -> Iterator[None]:
        """Raise ``NodeTimeout`` if the module leaves its port in this block."""
        try:
            yield
        except Gone as gone:
            raise NodeTimeout(
                f"{self.name} is no longer there",
                node=self.node,
                observed=str(gone),
                remedy="it restarts, or was unplugged: check its cable and supply, then give the command again",
            ) from gone
