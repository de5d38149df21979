"""A serial line as a wire: pymodbus makes the frames and verifies the checksums, pyserial provides the port."""

from __future__ import annotations

import logging
import time
from contextlib import suppress
from enum import Enum
from typing import Any

from axisbus.drives.gim6010.modbus.registers import FACTORY_RATE
from axisbus.drives.gim6010.modbus.requests import ModbusFunction, ModbusRequest, ModbusTimeout, Reply
from axisbus.errors import AdapterError, UserError

TIMEOUT = 0.2  # s for an answer; nine bytes take 1 ms


class Parity(Enum):
    """Parity bit; the manual does not document the module's."""

    NONE = "N"
    EVEN = "E"
    ODD = "O"


class SerialWire:
    """Modbus RTU on a serial port; ``Wire`` describes its methods."""

    def __init__(
        self, port: str, *, rate: int = FACTORY_RATE, parity: Parity = Parity.NONE, timeout: float = TIMEOUT
    ) -> None:
        """Open ``port`` (``/dev/ttyUSB0``, ``COM3``) exclusively; eight data bits, one stop bit. Sends nothing.

        Raises:
            UserError: the extra ``modbus`` is not installed. AdapterError: the port cannot be opened.
        """
        serial, make, self._failures = libraries()
        self._stuck, self._gone = serial.SerialTimeoutException, (serial.SerialException, OSError)
        self.port = port
        self.timeout = timeout
        self._require(serial, port, rate)
        self._client = make(
            port, baudrate=rate, bytesize=8, parity=parity.value, stopbits=1, timeout=timeout, retries=0
        )
        if not self._client.connect():
            raise _unusable(port, "pymodbus could not open it")

    def exchange(self, device: int, request: ModbusRequest) -> Reply:
        try:
            return _reply(self._call(device, request))
        except self._failures.ConnectionException as error:
            if self._client.connected:  # the write timed out, but the port is open
                raise ModbusTimeout(str(error)) from error
            raise _unusable(self.port, str(error)) from error
        except (
            self._failures.ModbusException,
            self._stuck,
        ) as error:  # older pymodbus does not convert ``_stuck``
            raise ModbusTimeout(str(error)) from error
        except self._gone as error:
            raise _unusable(self.port, str(error)) from error

    def drain(self, seconds: float) -> None:
        time.sleep(seconds)
        with suppress(Exception):  # if the port is gone, the next exchange raises
            if self._client.socket is not None:
                self._client.socket.reset_input_buffer()

    def now(self) -> float:
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)

    def close(self) -> None:
        self._client.close()

    def _call(self, device: int, request: ModbusRequest) -> Any:
        client, address = self._client, request.address
        match request.function:
            case ModbusFunction.READ_INPUT:
                return client.read_input_registers(address, count=request.count, device_id=device)
            case ModbusFunction.READ_HOLDING:
                return client.read_holding_registers(address, count=request.count, device_id=device)
            case ModbusFunction.WRITE_ONE:
                return client.write_register(address, request.words[0], device_id=device)
            case ModbusFunction.WRITE_SEVERAL:
                return client.write_registers(address, list(request.words), device_id=device)

    @staticmethod
    def _require(serial: Any, port: str, rate: int) -> None:
        """Open the port once without pymodbus, which does not report why it cannot open a port."""
        try:
            serial.serial_for_url(port, baudrate=rate, exclusive=True).close()
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise _unusable(port, str(error)) from error


def libraries() -> tuple[Any, Any, Any]:
    """Return pyserial, and the client and the exceptions of pymodbus. Raises UserError: one of them is not installed."""
    logging.getLogger("pymodbus").addHandler(logging.NullHandler())  # errors are raised, not logged
    try:
        import serial
        from pymodbus import exceptions
        from pymodbus.client import ModbusSerialClient

        return serial, ModbusSerialClient, exceptions
    except ImportError as error:
        raise UserError(
            "Modbus needs pymodbus and pyserial, and one of them is not installed",
            observed=str(error),
            remedy='install them: pip install "axisbus[modbus]"',
        ) from error


def _reply(answer: Any) -> Reply:
    """Return pymodbus's answer as a value; missing attributes get the defaults of ``Reply``."""
    exception = int(getattr(answer, "exception_code", 0)) if answer.isError() else 0
    return Reply(
        int(answer.function_code),
        tuple(getattr(answer, "registers", ())),
        int(getattr(answer, "address", -1)),
        int(getattr(answer, "count", 0)),
        exception,
    )


def _unusable(port: str, why: str) -> AdapterError:
    return AdapterError(
        f"the serial port {port} cannot be used",
        observed=why,
        remedy="check its name, that the adapter is plugged in, that this user may use it, and that no other program has it",
    )
