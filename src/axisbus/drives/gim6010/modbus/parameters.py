"""Parameters of a module by endpoints over Modbus (manual v2.2, 4.3.3: A1h, A2h, 31h); implements ``ModuleParameters``.

Theory of operation
-------------------
The number of a parameter is written to A1h; its value is then read from 31h, and written to A2h. The endpoint list is verified
first, as over CAN: by the version, whose numbers are the same in every known list, and by the node ID. A value is written only if
it is certain that A1h has the right number: A1h is read back if the firmware permits that; otherwise the answer to its write
repeats it.
"""

from __future__ import annotations

from axisbus.drives.gim6010.can_simple import endpoint_messages
from axisbus.drives.gim6010.can_simple.endpoints import (
    SERIAL_ENDPOINT,
    VERSION_ENDPOINTS,
    Endpoint,
    EndpointList,
    Firmware,
    FittedList,
)
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.dialogue import ModbusRefused
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.registers import named
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.parameters.interface import Value
from axisbus.errors import ArgumentError, NodeError, StateError

_NUMBER, _VALUE, _RETURN = named("endpoint_number"), named("endpoint_value"), named("endpoint_return")
_TRIES = 3
_BYTES = 4


class ModbusParameters:
    """Parameters of one module; holds the verified list, and the values written since the last save."""

    widest = rules.NARROW

    def __init__(self, module: ModbusModule) -> None:
        """Prepare; nothing is sent before ``open``."""
        self.module = module
        self.firmware = Firmware(0, 0, 0)
        self.serial = 0
        self._fitted: FittedList | None = None
        self._written: dict[str, Value] = {}

    def open(self, listed: EndpointList, made_for: Firmware) -> None:
        """Verify the list; blocks.

        Raises:
            NodeError: the module does not answer, or rejects access by endpoints.
            ArgumentError: the list does not fit the firmware that it reports, or its verification failed.
        """
        self.firmware = self._version()
        self._fitted = FittedList(listed, made_for, self.firmware)
        self._prove()
        self.serial = int.from_bytes(self.fetch(SERIAL_ENDPOINT), "little")

    @property
    def listed(self) -> EndpointList:
        """The parameters of its firmware."""
        return self._list.listed

    def endpoint(self, path: str) -> Endpoint:
        """Return the description of a parameter; see ``ModuleParameters.endpoint``."""
        return self._list.endpoint(path)

    def read(self, path: str) -> Value:
        """Return a parameter's value in RAM; see ``ModuleParameters.read``."""
        endpoint = self._list.endpoint(path)
        if not endpoint.readable:
            raise ArgumentError(f"{endpoint.path} cannot be read", remedy="it is write-only")
        if not rules.travels(endpoint):
            raise ArgumentError(
                f"{endpoint.path} is of type {endpoint.type}, which does not fit into 32 bits",
                remedy="read it over USB",
            )
        return endpoint_messages.value(endpoint, self.fetch(endpoint.id))

    def write(self, path: str, value: Value, *, by_name: bool = False) -> Value:
        """Write a parameter into RAM and return the stored value; see ``ModuleParameters.write``."""
        endpoint = self._list.endpoint(path)
        rules.require_setting(endpoint, by_name=by_name)
        data = endpoint_messages.value_bytes(endpoint, value)
        self.module.require_idle(f"{endpoint.path} is written")
        held: Value = 0
        for _ in range(_TRIES):
            taken = self._put(endpoint.id, data)
            held = self.read(path)
            if values.same(held, value):
                self._written[endpoint.path] = held
                return held
            if taken:
                break
        raise NodeError(
            f"module {self.module.device}: {endpoint.path} holds {values.show(held)} after {values.show(value)} was written",
            node=self.module.device,
            remedy="the module refuses this value, or this parameter over Modbus: try it over USB",
        )

    def save(self) -> None:
        """Save RAM to flash, wait for the restart, verify the list again, and verify all written values."""
        self.module.save()
        self._prove()
        lost = [path for path, value in self._written.items() if not values.same(self.read(path), value)]
        if lost:
            raise NodeError(
                f"module {self.module.device} was saved, and has lost {', '.join(lost)}",
                node=self.module.device,
                remedy="the written values did not reach its flash: save them over USB",
            )
        self._written.clear()

    def save_and_leave(self) -> None:
        """Save like ``save``, but do not wait for the restart, for changes after which the module does not return."""
        self.module.save_and_leave()

    @property
    def axis_error(self) -> int:
        """Error word of the axis; blocks."""
        return self.module.errors().words["axis"]

    def clear_errors(self) -> None:
        """Clear its errors by the Modbus register; see ``ModuleParameters.clear_errors``."""
        left = self.module.clear_errors().words["axis"]
        if left:
            raise NodeError(
                f"module {self.module.device} got the command to clear its errors, and the error word of its axis is {left:08X}h",
                node=self.module.device,
                remedy="read its meaning: axisbus gim6010 modbus errors",
            )

    def require_idle(self) -> None:
        """Check that there is no power on its motor; see ``ModuleParameters.require_idle``."""
        self.module.require_idle("its parameters are written")

    @property
    def _list(self) -> FittedList:
        if self._fitted is None:
            raise StateError(
                "no list of endpoints has been checked against the module", remedy="open it first"
            )
        return self._fitted

    def _version(self) -> Firmware:
        return Firmware(*(self.fetch(number)[0] for number in VERSION_ENDPOINTS.values()))

    def _prove(self) -> None:
        found = self.read(rules.NODE_ID)
        if found != self.module.device:
            self._fitted = None
            raise rules.unfitting(self.module.device, values.show(found))

    def fetch(self, number: int) -> bytes:
        """Return the four bytes of an endpoint by its number, lowest first; blocks. The endpoint must be readable."""
        self._select(number)
        words = self.module.dialogue.read(requests.read(_RETURN))
        return int(_RETURN.value(words)).to_bytes(_BYTES, "little")

    def _put(self, number: int, data: bytes) -> bool:
        self._select(number)
        return self.module.dialogue.write(requests.write(_VALUE, int.from_bytes(data, "little")))

    def _select(self, number: int) -> None:
        """Select the endpoint for 31h and A2h.

        Raises:
            NodeError: it is not certain that it was selected.
        """
        request = requests.write(_NUMBER, number)
        for _ in range(_TRIES):
            taken = self.module.dialogue.write(request)
            held = self._selected()
            if held == number or (held is None and taken):
                return
        raise NodeError(
            f"module {self.module.device} does not accept the number of an endpoint ({number})",
            node=self.module.device,
            observed=f"A1h was written {_TRIES} times",
            remedy="another master may use endpoints at the same time; else read and write parameters over USB",
        )

    def _selected(self) -> int | None:
        """Return the number in A1h; None if the firmware does not permit reading it, which the manual leaves open."""
        try:
            return int(_NUMBER.value(self.module.dialogue.read(requests.read(_NUMBER))))
        except ModbusRefused:
            return None
