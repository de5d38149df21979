"""Results of decoding a frame: a message with its values, a request, or the reason why the frame is invalid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.messages import Message


class Reason(Enum):
    """Reason why a frame does not fit the message table."""

    NOT_STANDARD = "an identifier of 29 bits is not CAN Simple's"
    NO_COMMAND = "there is no such command"
    LENGTH = "it is too short"
    NOT_SENT = "that is not sent by this side"
    NOT_FINITE = "a value is not a finite number"
    WRONG_NODE = "it names another node than its identifier"
    VALUE = "a value is not one that the manual lists"


@dataclass(frozen=True, slots=True)
class DecodedMessage:
    """A message of a node; ``values`` by the manual's field names, each in its field's unit and at its field's side of the gear."""

    node: int
    message: Message
    values: Mapping[str, Number]
    from_module: bool


@dataclass(frozen=True, slots=True)
class MessageRequest:
    """A master's request for a message, as a remote frame or a data frame of zeros."""

    node: int
    message: Message


@dataclass(frozen=True, slots=True)
class Unexpected:
    """A frame that does not fit the message table; returned, not raised, since a foreign frame must not end a cycle.

    ``node`` and ``command`` are the parts of its identifier in CAN Simple, independent of its sender; -1 for a 29-bit identifier.
    """

    node: int
    command: int
    data: bytes
    reason: Reason
    details: str = ""

    @property
    def words(self) -> str:
        """The reason as text: ``command 09h: it is too short (7 bytes where 8 are needed)``."""
        more = f" ({self.details})" if self.details else ""
        where = "a frame" if self.command < 0 else f"command {self.command:02X}h"
        return f"{where}: {self.reason.value}{more}"
