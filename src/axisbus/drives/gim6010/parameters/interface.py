"""Common interface to a module's parameters: endpoints over CAN and over Modbus, and the object tree on USB.

A written value is in RAM: it takes effect at once, and is lost with the next restart. ``save`` saves RAM to flash and restarts the
module (manual v2.2, 3.1.6). The contents of the flash cannot be read separately; after a restart, RAM and flash are the same.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from axisbus.drives.gim6010.can_simple import endpoint_messages
from axisbus.drives.gim6010.can_simple.endpoints import (
    Endpoint,
    EndpointList,
    Firmware,
    FittedList,
    found_in,
)
from axisbus.drives.gim6010.can_simple.messages import IDLE, state_words
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.errors import NodeError, StateError


class ModuleParameters(ABC):
    """The module ``node`` (its node ID), whose parameters can be read and written once it is open.

    It holds the values written since the last save. ``widest``: the maximum number of bytes of a value over this interface.
    ``firmware`` is the version that the module reported, ``serial`` its serial number, as far as the interface transfers it: the
    lowest 32 bits over CAN and Modbus. ``remedies`` are those of a value that it does not take, and of values that it has lost;
    ``stop_remedy`` is that of a module that is not idle.
    """

    node: int
    widest = rules.NARROW
    remedies = (
        "the module refuses this value, or this parameter over this interface: try it over USB",
        "the written values did not reach its flash: save them over USB",
    )

    stop_remedy = "stop and disable it with the program that controls it, then give the command again"

    def __init__(self) -> None:
        self.firmware = Firmware(0, 0, 0)
        self.serial = 0
        self.written: dict[str, Value] = {}

    # What each interface does in its own way.

    @property
    @abstractmethod
    def listed(self) -> EndpointList:
        """The parameters of its firmware."""

    @property
    @abstractmethod
    def axis_error(self) -> int:
        """Error word of the axis, 0 if the interface reports none; may block, and raises BusError without an answer."""

    @abstractmethod
    def _state(self) -> int:
        """Return the state of its axis; blocks, and raises BusError if it cannot be read."""

    @abstractmethod
    def save_and_leave(self) -> None:
        """Save like ``save``, but do not wait for the restart, for changes after which the module does not return."""

    @abstractmethod
    def _fetch(self, endpoint: Endpoint) -> Value:
        """Return the value of a readable parameter that fits; raises BusError as ``read``."""

    @abstractmethod
    def _store(self, endpoint: Endpoint, value: Value) -> Value:
        """Write a value into an idle module, and return the value then read back; raises BusError as ``write``."""

    @abstractmethod
    def _clear(self) -> None:
        """Send the command that clears the errors to an idle module; raises BusError without an answer."""

    @abstractmethod
    def _save(self) -> None:
        """Save RAM to flash, wait until the module answers again, and verify its list again; raises as ``save``."""

    # What is the same over all of them.

    @property
    def name(self) -> str:
        """The module in messages."""
        return f"module {self.node}"

    def require_idle(self) -> None:
        """Check that there is no power on its motor; blocks.

        Raises:
            StateError: it is in another state. BusError: its state cannot be read.
        """
        state = self._state()
        if state != IDLE:
            raise StateError(
                f"{self.name} is in {state_words(state)}, and only an idle module can be written or saved",
                remedy=self.stop_remedy,
            )

    def endpoint(self, path: str) -> Endpoint:
        """Return the description of a parameter; its path may begin with ``odrv0.``.

        Raises:
            ArgumentError: it does not exist; the message names similar ones.
        """
        return found_in(self.listed.endpoints, path, "parameter", self.listed.source)

    def read(self, path: str) -> Value:
        """Return a parameter's value in RAM; blocks.

        Raises:
            ArgumentError: the list has no such parameter, it is not readable, or the interface cannot transfer it.
            BusError: no answer, or the module restarted or was disconnected meanwhile.
        """
        endpoint = self.endpoint(path)
        endpoint_messages.require_readable(endpoint, self.widest)
        return self._fetch(endpoint)

    def write(self, path: str, value: Value, *, by_name: bool = False) -> Value:
        """Write a parameter into RAM, read it back and return the stored value; blocks.

        ``by_name``: the user named this very parameter.

        Raises:
            ArgumentError, LimitError: as ``read``; it is not writable or protected; the value is not of its type.
            StateError: the module is not idle. BusError: as ``read``, or it stores a value other than the written one.
        """
        endpoint = self.endpoint(path)
        rules.require_setting(endpoint, by_name=by_name)
        return self._put(endpoint, value)

    def _put(self, endpoint: Endpoint, value: Value) -> Value:
        endpoint_messages.value_bytes(endpoint, value, self.widest)
        self.require_idle()
        held = self._store(endpoint, value)
        if not values.same(held, value):
            raise NodeError(
                f"{self.name}: {endpoint.path} holds {values.show(held)} after {values.show(value)} was written",
                node=self.node,
                remedy=self.remedies[0],
            )
        self.written[endpoint.path] = held
        return held

    def save(self) -> None:
        """Save RAM to flash; the module restarts. Blocks until it answers again, and has all written values.

        Raises:
            StateError: it is not idle. BusError: it does not restart, does not come back, or has lost a written value.
        """
        self._save()
        lost = [path for path, value in self.written.items() if not values.same(self.read(path), value)]
        if lost:
            raise NodeError(
                f"{self.name} was saved, and has lost {', '.join(lost)}",
                node=self.node,
                remedy=self.remedies[1],
            )
        self.written.clear()

    def clear_errors(self) -> None:
        """Clear its errors, which enables nothing; blocks.

        Raises:
            StateError: it is not idle. BusError: no answer, or the axis's error remains.
        """
        self.require_idle()
        self._clear()
        word = self.axis_error
        if word:
            raise rules.not_cleared(self.name, self.node, word)


class ParametersByNumber(ModuleParameters):
    """Parameters by the numbers of endpoints, for which the list is verified on the module."""

    def __init__(self) -> None:
        super().__init__()
        self._fitted: FittedList | None = None

    @property
    def listed(self) -> EndpointList:
        return self._list.listed

    @property
    def _list(self) -> FittedList:
        if self._fitted is None:
            raise StateError(
                "no list of endpoints has been checked against the module", remedy="open it first"
            )
        return self._fitted

    def _fit(self, listed: EndpointList, made_for: Firmware) -> None:
        """Take a list that is made for the reported firmware and proven on the module; raises as ``open``."""
        self._fitted = FittedList(listed, made_for, self.firmware)
        self._prove()

    def _prove(self) -> None:
        found = self.read(rules.NODE_ID)
        if found != self.node:
            self._fitted = None
            raise rules.unfitting(self.node, values.show(found))
