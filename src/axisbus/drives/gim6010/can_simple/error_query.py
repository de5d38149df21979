"""Get_Error: which error word is asked for, and its answer, which does not name it (manual v2.2, 4.1.2)."""

from __future__ import annotations

from enum import IntEnum

from axisbus.drives.gim6010.can_simple.codec import Outgoing, encode, short
from axisbus.drives.gim6010.can_simple.decoded_message import Reason, Unexpected
from axisbus.drives.gim6010.can_simple.identifier import Identifier
from axisbus.drives.gim6010.can_simple.messages import LENGTH, named

GET_ERROR = named("Get_Error")


class ErrorType(IntEnum):
    """The error words that can be asked for; that of the axis is in each heartbeat."""

    MOTOR = 0
    ENCODER = 1
    CONTROLLER = 3
    SYSTEM = 4

    @property
    def category(self) -> str:
        """The category of its bits in the table of faults."""
        return self.name.lower()

    @property
    def length(self) -> int:
        """The bytes of its error word."""
        return 8 if self is ErrorType.MOTOR else 4


def request(node: int, which: ErrorType) -> Outgoing:
    """Return the frame that asks ``node`` (0 to 63) for an error word: its type in the first of eight bytes.

    Remote and empty frames, which name no type, owners found unanswered. Ask for one at a time, and for the next when the answer
    came or was given up.

    Raises:
        ArgumentError: the node is none.
    """
    return encode(node, GET_ERROR, {"Error_Type": int(which)})


def read(node: int, data: bytes, which: ErrorType) -> int | Unexpected:
    """Return the error word that was asked for, 0 for no error, or what is wrong with the answer.

    An answer of eight bytes to a type of four bytes must end with zeros; else it is the motor's, asked for before.
    """
    place = Identifier(node, GET_ERROR.command)
    if len(data) < which.length:
        return short(place, data, which.length)
    if any(data[which.length : LENGTH]):
        return Unexpected(*place, data, Reason.VALUE, "longer than the error word that was asked for")
    return int.from_bytes(data[: which.length], "little")
