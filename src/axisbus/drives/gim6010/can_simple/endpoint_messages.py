"""Reading and writing endpoints over CAN: RxSdo and TxSdo (manual v2.2, 4.1.2).

Theory of operation. Requests are sent on RxSdo, as in the manual's detailed part. Answers are accepted on RxSdo and on TxSdo, since
the manual names both and the maker's own program uses RxSdo. A value has four bytes, so that eight-byte values cannot be
transferred. All but the version needs a list that is verified (``FittedList``): with another firmware, the number of a parameter
may belong to a function, and it is unknown whether reading it would call it. Owners read endpoints of several modules and got no
answer at all: "not answered by this firmware" is to be expected.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from axisbus.drives.gim6010.can_simple.codec import (
    DecodedMessage,
    Outgoing,
    Reason,
    Unexpected,
    decode,
    packed,
)
from axisbus.drives.gim6010.can_simple.endpoints import (
    FORMATS,
    SERIAL_ENDPOINT,
    VERSION_ENDPOINTS,
    Endpoint,
    FittedList,
    protected,
)
from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.identifier import can_id, split
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.errors import ArgumentError, LimitError
from axisbus.wording import counted

RX_SDO, TX_SDO = named("RxSdo"), named("TxSdo")
COMMANDS = frozenset({RX_SDO.command, TX_SDO.command})
_READ, _WRITE = 0, 1
_BYTES = 4
_VALUE = range(4, 8)


@dataclass(frozen=True, slots=True)
class EndpointAnswer:
    """An answer: node, endpoint, whether it is for a read or a write, and its four bytes, which ``value`` decodes."""

    node: int
    endpoint: int
    write: bool
    data: bytes


def request_version(node: int) -> tuple[Outgoing, ...]:
    """Return the frames that request the firmware version of ``node`` (0 to 63): major, minor, revision, each one byte.

    Raises:
        ArgumentError: the node ID is invalid.
    """
    return tuple(_frame(node, _READ, number, 0) for number in VERSION_ENDPOINTS.values())


def request_serial(node: int) -> Outgoing:
    """Return the frame that requests the serial number of ``node`` (0 to 63); the answer has its lowest 32 bits.

    Raises:
        ArgumentError: the node ID is invalid.
    """
    return _frame(node, _READ, SERIAL_ENDPOINT, 0)


def read(node: int, listed: FittedList, path: str) -> Outgoing:
    """Return the frame that requests a parameter of ``node`` (0 to 63).

    Raises:
        ArgumentError: the node ID is invalid, the list has no such parameter, it is not readable, or longer than four bytes.
    """
    endpoint = listed.endpoint(path)
    require_readable(endpoint)
    return _frame(node, _READ, endpoint.id, 0)


def require_readable(endpoint: Endpoint, most: int = _BYTES) -> None:
    """Check that a parameter can be read, and that its value has at most ``most`` bytes.

    Raises:
        ArgumentError: it is not readable, holds no number, or is longer.
    """
    if not endpoint.readable:
        raise ArgumentError(f"{endpoint.path} cannot be read", remedy="it is write-only")
    _letter(endpoint, most)


def write(
    node: int, listed: FittedList, path: str, value: Number | bool, *, by_name: bool = False
) -> Outgoing:
    """Return the frame that writes a parameter of ``node`` (0 to 63). Read it back: a module does not report an invalid value.

    ``by_name``: the user named this very parameter. Protected parameters (``protected``) are written only then.

    Raises:
        ArgumentError: as ``read``, or it is not writable, is protected, or the value is not of its type.
        LimitError: the value is beyond its type.
    """
    endpoint = listed.endpoint(path)
    found = protected(endpoint.path)
    if found is not None and not by_name:
        raise ArgumentError(
            f"{endpoint.path} is protected: it {found.why}",
            remedy="to write it all the same, name exactly this parameter",
        )
    if not endpoint.writable:
        raise ArgumentError(f"{endpoint.path} cannot be written", remedy="it is read-only")
    return _frame(node, _WRITE, endpoint.id, int.from_bytes(value_bytes(endpoint, value), "little"))


def answer(identifier: int, data: bytes) -> EndpointAnswer | Unexpected:
    """Return the answer in a module's frame under RxSdo or TxSdo, or the reason why it is invalid."""
    found = decode(identifier, data, from_module=True)
    if isinstance(found, Unexpected):
        return found
    if not isinstance(found, DecodedMessage) or found.message.command not in COMMANDS:
        return Unexpected(*split(identifier), data, Reason.NOT_SENT, "no answer of an endpoint")
    opcode, number = int(found.values["opcode"]), int(found.values["Endpoint_ID"])
    return EndpointAnswer(found.node, number, opcode == _WRITE, data[_VALUE.start : _VALUE.stop])


def value(endpoint: Endpoint, data: bytes) -> Number | bool:
    """Return a parameter's value from the four bytes of an answer; a float may be NaN or infinite, if the module reports that.

    Raises:
        ArgumentError: the parameter has no value of at most four bytes.
    """
    letter = _letter(endpoint)
    (found,) = struct.unpack_from(f"<{letter}", data.ljust(_BYTES, b"\0"))
    return bool(found) if letter == "?" else found if letter != "f" else float(found)


def value_bytes(endpoint: Endpoint, value: Number | bool, most: int = _BYTES) -> bytes:
    """Return the bytes of a parameter's value, little-endian: four, or the size of its type if that is larger.

    ``most``: number of bytes that can be transferred.

    Raises:
        ArgumentError: the value needs more bytes, or is not of the parameter's type.
        LimitError: the value is beyond its type.
    """
    letter = _letter(endpoint, most)
    _check(endpoint, letter, value)
    try:
        return struct.pack(f"<{letter}", value).ljust(_BYTES, b"\0")
    except (struct.error, OverflowError):
        raise LimitError(f"{endpoint.path}: {value} is beyond the range of {endpoint.type}") from None


def _check(endpoint: Endpoint, letter: str, value: Number | bool) -> None:
    boolean = isinstance(value, bool)
    if letter == "f":
        good = isinstance(value, int | float) and not boolean and math.isfinite(value)
    else:
        good = boolean if letter == "?" else isinstance(value, int) and not boolean
    if not good:
        raise ArgumentError(
            f"{endpoint.path}: {value!r} is not a value of type {endpoint.type} that can be written"
        )


def _letter(endpoint: Endpoint, most: int = _BYTES) -> str:
    letter = FORMATS[endpoint.type]
    if not letter:
        raise ArgumentError(f"{endpoint.path} is of type {endpoint.type}, which holds no number")
    if struct.calcsize(f"<{letter}") > most:
        raise ArgumentError(
            f"{endpoint.path} is of type {endpoint.type}, which does not fit into {counted(8 * most, 'bit')}",
            remedy="read or write it over USB",
        )
    return letter


def _frame(node: int, opcode: int, number: int, value: int) -> Outgoing:
    values = {"opcode": opcode, "Endpoint_ID": number, "Value": value}
    return Outgoing(can_id(node, RX_SDO.command), packed(RX_SDO, values))
