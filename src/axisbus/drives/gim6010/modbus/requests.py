"""Modbus requests, and whether a reply answers a request (manual v2.2, 4.3.1).

Theory of operation. The answer to a read in Modbus RTU contains neither a request number nor the register: a reply fits by its
function and its number of registers only. So a late reply may be accepted as the answer to the next request of the same shape;
``dialogue`` prevents that. A ``ModbusRequest`` always covers one whole value of the table: none can be made for a part of a value.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.modbus.registers import Bank, Register
from axisbus.errors import ArgumentError

_MEANINGS = {
    1: "it does not know this function",
    2: "it has no such register",
    3: "it does not accept this value",
    4: "it failed while it did this",
    5: "it has begun, and is not done yet",
    6: "it is busy",
    8: "its memory is damaged",
}


class ModbusFunction(IntEnum):
    """Function codes that a module supports."""

    READ_HOLDING = 0x03
    READ_INPUT = 0x04
    WRITE_ONE = 0x06
    WRITE_SEVERAL = 0x10


@dataclass(frozen=True, slots=True)
class ModbusRequest:
    """One request for a whole value; ``words`` are the registers to be written, most significant first, none in a read.

    Raises:
        ArgumentError: the words are not the whole value, or the value is one that can only be read.
    """

    register: Register
    words: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.writes and (len(self.words) != self.count or self.register.bank is Bank.INPUT):
            raise ArgumentError(
                f"{len(self.words)} from {self.address:02X}h by function {self.function:02X}h is not a whole value of a module",
                remedy="values of several registers are read and written whole, from their first address on",
            )

    @property
    def address(self) -> int:
        return self.register.address

    @property
    def count(self) -> int:
        return self.register.count

    @property
    def writes(self) -> bool:
        return bool(self.words)

    @property
    def function(self) -> ModbusFunction:
        if not self.writes:
            return ModbusFunction(self.register.bank.value)
        return ModbusFunction.WRITE_ONE if self.count == 1 else ModbusFunction.WRITE_SEVERAL

    @property
    def shape(self) -> tuple[int, int]:
        """Function and count: answers to requests of the same shape cannot be distinguished."""
        return int(self.function), self.count

    @property
    def pdu(self) -> bytes:
        """Function code and data, as sent between address and CRC."""
        head = bytes([self.function]) + self.address.to_bytes(2, "big")
        data = b"".join(word.to_bytes(2, "big") for word in self.words)
        if self.function is ModbusFunction.WRITE_ONE:
            return head + data
        count = self.count.to_bytes(2, "big")
        return head + count + (bytes([len(data)]) + data if self.writes else b"")

    def frame(self, device: int) -> bytes:
        """Return the frame to a device (1 to 247), without the CRC."""
        return bytes([device]) + self.pdu


@dataclass(frozen=True, slots=True)
class Reply:
    """A reply: the registers read, the repeated part of a write, or an exception code."""

    function: int
    words: tuple[int, ...] = ()
    address: int = -1
    count: int = 0
    exception: int = 0


def read(register: Register) -> ModbusRequest:
    return ModbusRequest(register)


def write(register: Register, value: Number) -> ModbusRequest:
    """Return the request that writes a value, in the register's unit.

    Raises:
        ArgumentError: the manual describes no write to the register, or the value is invalid.
        LimitError: the value is beyond its bounds or type.
    """
    if not register.writable:
        raise ArgumentError(f"{register.name} cannot be written", remedy="it is read-only")
    return ModbusRequest(register, register.words(value))


def fits(request: ModbusRequest, reply: Reply) -> bool:
    """Return whether a reply can be the answer to a request; an exception can be."""
    if reply.exception:
        return reply.function & 0x7F == request.function
    if reply.function != request.function:
        return False
    if not request.writes:
        return len(reply.words) == request.count
    if reply.address != request.address:
        return False
    return (
        reply.words == request.words
        if request.function is ModbusFunction.WRITE_ONE
        else reply.count == request.count
    )


def exception_words(code: int) -> str:
    """Return the meaning of an exception code (Modbus application protocol V1.1b3, 7)."""
    return f"exception {code}: {_MEANINGS.get(code, 'a code that Modbus does not have')}"


# -- Interface to a line for requests and replies, one exchange at a time, and its clock -------------------------------
#
# Implementations are a serial line, and a simulation for tests.


class ModbusTimeout(Exception):  # named for what happened; only ``dialogue`` catches it
    """No valid reply arrived in time: none at all, or one with a wrong checksum or length."""


class Wire(Protocol):
    """One line; use it from one thread at a time."""

    timeout: float  # s to wait for a reply

    def exchange(self, device: int, request: ModbusRequest) -> Reply:
        """Send a request to a device (1 to 247) and return its reply; blocks for at most ``timeout``.

        Raises:
            ModbusTimeout: no reply. AdapterError: the line is gone.
        """

    def drain(self, seconds: float) -> None:
        """Wait for ``seconds``, and discard all data received meanwhile."""

    def now(self) -> float:
        """Return the time in s of a monotonic clock."""

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds``."""

    def close(self) -> None:
        """Release the line; harmless when repeated."""
