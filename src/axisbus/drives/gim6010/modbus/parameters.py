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
)
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.dialogue import ModbusRefused
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.registers import named
from axisbus.drives.gim6010.parameters import values
from axisbus.drives.gim6010.parameters.interface import ParametersByNumber
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.errors import NodeError

_NUMBER, _VALUE, _RETURN = named("endpoint_number"), named("endpoint_value"), named("endpoint_return")
_TRIES = 3
_BYTES = 4


class ModbusParameters(ParametersByNumber):
    """``ModuleParameters`` of one module on a serial line."""

    def __init__(self, module: ModbusModule) -> None:
        """Prepare; nothing is sent before ``open``."""
        super().__init__()
        self.module = module
        self.node = module.device
        self.stop_remedy = module.stop_remedy

    def open(self, listed: EndpointList, made_for: Firmware) -> None:
        """Verify the list; blocks.

        Raises:
            NodeError: the module does not answer, or rejects access by endpoints.
            ArgumentError: the list does not fit the firmware that it reports, or its verification failed.
        """
        self.firmware = Firmware(*(self.fetch(number)[0] for number in VERSION_ENDPOINTS.values()))
        self._fit(listed, made_for)
        self.serial = int.from_bytes(self.fetch(SERIAL_ENDPOINT), "little")

    @property
    def axis_error(self) -> int:
        """Error word of the axis; blocks."""
        return self.module.errors().words["axis"]

    def _state(self) -> int:
        return self.module.state

    def save_and_leave(self) -> None:
        self.module.save_and_leave()

    def _clear(self) -> None:
        self.module.act("clear_errors")

    def _save(self) -> None:
        self.module.save()
        self._prove()

    def _fetch(self, endpoint: Endpoint) -> Value:
        return endpoint_messages.value(endpoint, self.fetch(endpoint.id))

    def _store(self, endpoint: Endpoint, value: Value) -> Value:
        """Write again only if the write was not confirmed."""
        data = int.from_bytes(endpoint_messages.value_bytes(endpoint, value), "little")
        for _ in range(_TRIES):
            self._select(endpoint.id)
            taken = self.module.dialogue.write(requests.write(_VALUE, data))
            held = self._fetch(endpoint)
            if taken or values.same(held, value):
                break
        return held

    def fetch(self, number: int) -> bytes:
        """Return the four bytes of an endpoint by its number, lowest first; blocks. The endpoint must be readable."""
        self._select(number)
        return int(self.module.read(_RETURN.name)).to_bytes(_BYTES, "little")

    def _select(self, number: int) -> None:
        """Select the endpoint for 31h and A2h. Raises NodeError: it is not certain that it was selected."""
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
