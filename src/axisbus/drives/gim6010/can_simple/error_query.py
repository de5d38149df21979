"""Get_Error: the request for an error word, and its answer, which does not name the word (manual v2.2, 4.1.2)."""

from __future__ import annotations

from enum import IntEnum

from axisbus.drives.gim6010.can_simple.codec import Outgoing, Reason, Unexpected, encode, short
from axisbus.drives.gim6010.can_simple.identifier import Identifier
from axisbus.drives.gim6010.can_simple.messages import LENGTH, named

GET_ERROR = named("Get_Error")


class ErrorType(IntEnum):
    """Error words that can be requested; the axis's is in each heartbeat."""

    MOTOR = 0
    ENCODER = 1
    CONTROLLER = 3
    SYSTEM = 4

    @property
    def category(self) -> str:
        """Category of its bits in the fault table."""
        return self.name.lower()

    @property
    def length(self) -> int:
        return 8 if self is ErrorType.MOTOR else 4


def request(node: int, which: ErrorType) -> Outgoing:
    """Return the frame that requests an error word from ``node`` (0 to 63): its type is the first of eight bytes.

    By owners' reports, remote and empty frames, which contain no type, are not answered. Request one word at a time, and the next
    after the answer or a time-out. Raises ArgumentError: the node ID is invalid.
    """
    return encode(node, GET_ERROR, {"Error_Type": int(which)})


def read(node: int, data: bytes, which: ErrorType) -> int | Unexpected:
    """Return the requested error word, 0 for no error, or the reason why the answer is invalid.

    An eight-byte answer for a type of four bytes must end with zeros. Otherwise it is a late answer to an earlier request for the
    motor's error word, which has eight bytes.
    """
    place = Identifier(node, GET_ERROR.command)
    if len(data) < which.length:
        return short(place, data, which.length)
    if any(data[which.length : LENGTH]):
        return Unexpected(*place, data, Reason.VALUE, "longer than the error word that was asked for")
    return int.from_bytes(data[: which.length], "little")
